"""GSD in HOOMD's schema, written by its own package; OVITO, HOOMD and freud read it.

The schema keeps single precision. The exact positions, velocities and angular velocities are in the file too, as
`log/particles/position` and so on. Contacts of two balls are bonds, which change from frame to frame, with what they
carry in `log/bonds`; those with walls have no second particle and are left to the other formats.

A file of this kind has a box about the origin: of a periodic scene its own, to whose centre all positions are shifted
(`log/configuration/origin`) and into which they are folded (`image` counts the periods); of others one that holds all
balls in all frames, without a shift. Of a box that deforms each frame has its own lengths and tilt factors.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError, extra
from carom.export.atomic import whole_file
from carom.export.frames import Selection
from carom.export.glyphs import contact_glyphs
from carom.result.boxes import Boxes
from carom.scene.packing.periodic import PeriodicBox
from carom.show.surfaces import box

#: What a bond has of its contact, in the file as `log/bonds/NAME`, with the shape of one; meaning and units: `GLYPHS`.
CARRIED: dict[str, tuple[int, ...]] = {
    "force": (3,),
    "normal_force": (),
    "friction_force": (),
    "gap": (),
    "status": (),
    "closed": (),
}


def write(selection: Selection, directory: Path) -> list[Path]:
    """`balls.gsd`."""
    hoomd = extra("gsd.hoomd", "the format gsd needs the package gsd", "export")
    result = selection.result
    low, high = box(selection)
    boxes, around = result.boxes, 2.0 * np.maximum(np.abs(low), np.abs(high))
    origin = np.zeros(3) if boxes is None else np.where(boxes.first.lengths > 0, boxes.first.centre, 0.0)
    if boxes is not None and (upper := boxes.first).flow > upper.gradient and _sheared(boxes, selection):
        flow, gradient = "xyz"[upper.flow], "xyz"[upper.gradient]
        raise CaromError(
            f"gsd has no box that is sheared along {flow} across {gradient}: its tilts are along x across y and z, and"
            " along y across z; export extxyz, or name the axes of the scene in this order"
        )
    materials = int(np.max(selection.fixed()["material"], initial=0)) + 1
    inertia = np.asarray(result.bodies["inertia"])
    path = directory / "balls.gsd"
    contacts = _contacts(selection)
    with whole_file(path) as temporary, hoomd.open(name=str(temporary), mode="w") as file:
        for frame, (pairs, carried) in zip(selection, contacts, strict=True):
            found = frame.quantities
            snapshot = hoomd.Frame()
            snapshot.configuration.step = frame.step
            cell = None if boxes is None else boxes[frame.index].tilted
            snapshot.configuration.box = _configuration(cell, around)
            particles = snapshot.particles
            particles.N = len(frame.body)
            particles.types = [f"M{k}" for k in range(materials)]
            particles.typeid = found["material"]
            image = np.zeros_like(frame.position) if cell is None else cell.turns(frame.position)
            particles.position = frame.position - origin - (0.0 if cell is None else image @ cell.vectors)
            particles.image = image.astype(np.int32)
            particles.velocity = found["velocity"]
            particles.orientation = found["orientation"]
            particles.mass = found["mass"]
            particles.diameter = 2.0 * found["radius"]
            particles.moment_inertia = np.repeat(inertia[frame.body][:, None], 3, axis=1)
            particles.angmom = _angular_momentum(
                found["orientation"], inertia[frame.body][:, None] * found["angular_velocity"]
            )
            # A bond needs both of its balls, one of which may have left since.
            both = np.isin(pairs, frame.body).all(axis=1)
            pairs, carried = pairs[both], {k: values[both] for k, values in carried.items()}
            bonds = snapshot.bonds
            bonds.N, bonds.types = len(pairs), ["contact"]
            bonds.typeid = np.zeros(len(pairs), dtype=np.uint32)
            # Places in the frame, from which balls may be absent.
            bonds.group = np.searchsorted(frame.body, pairs)
            snapshot.log = {
                "configuration/time": np.array([frame.time]),
                "configuration/origin": origin,
                "particles/id": frame.body,
                **{f"particles/{k}": found[k] for k in ("position", "velocity", "angular_velocity")},
                **{f"bonds/{k}": carried[k] for k in CARRIED},
            }
            file.append(snapshot)
    return [path]


def _contacts(selection: Selection) -> Iterator[tuple[Any, dict[str, Any]]]:
    """Of each chosen frame the pairs (C, 2) of balls that touch, and what their contacts carry."""
    if not selection.with_contacts:
        none = np.zeros((0, 2), dtype=np.int64), {k: np.zeros((0, *shape)) for k, shape in CARRIED.items()}
        yield from repeat(none, len(selection.frames))
        return
    count = len(selection.result.names)
    for glyphs in contact_glyphs(selection):
        for _, data in glyphs:
            pairs = np.stack([data["body_a"], data["body_b"]], axis=1)
            of_balls = pairs[:, 1] < count
            yield pairs[of_balls], {k: data[k][of_balls] for k in CARRIED}


def _sheared(boxes: Boxes, selection: Selection) -> bool:
    """Whether images are displaced at one of the chosen frames, by more than whole lengths."""
    return any(boxes[frame].tilt for frame in selection.frames)


def _configuration(cell: PeriodicBox | None, around: F64) -> list[float]:
    """The box as HOOMD has it: lengths, of axes that do not repeat those `around` all balls, and the tilts xy, xz, yz."""
    if cell is None:
        return [*around.tolist(), 0.0, 0.0, 0.0]
    lengths = np.where(cell.lengths > 0, cell.lengths, around)
    tilts = cell.vectors / lengths[:, None]
    return [*lengths.tolist(), *(float(x) for x in (tilts[1, 0], tilts[2, 0], tilts[2, 1]))]


def _angular_momentum(orientation: Any, momentum: Any) -> Any:
    """HOOMD's quaternion 2 q * (0, L_body) = 2 (0, L_world) * q of balls, (n, 4); L (n, 3), kg m^2/s."""
    w, v = orientation[:, :1], orientation[:, 1:]
    scalar = -np.sum(momentum * v, axis=1, keepdims=True)
    return 2.0 * np.hstack([scalar, w * momentum + np.cross(momentum, v)])
