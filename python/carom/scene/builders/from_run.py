"""`Taker`: the call of a `carom.Scene` that takes over the balls of a run."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from carom.errors import CaromError, CaromWarning
from carom.scene.builders.balls import Builder, make
from carom.scene.checks.walls import touching
from carom.scene.tables.balls import Sphere
from carom.scene.tables.clumps import Clump
from carom.units import number

if TYPE_CHECKING:
    from carom.result.data import RunData


class Taker(Builder):
    """Balls from elsewhere; `carom.Scene` is one."""

    def spheres_from(
        self, result: RunData, frame: int = -1, *, time: float | str | None = None
    ) -> tuple[Sphere | Clump, ...]:
        """Add the balls and clumps of a run as they are at a frame, and return them: to go on from there in another scene.

        `frame` counts as in arrays, the last one by default; with `time` (s, or a text with a unit) it is the nearest one.
        Names, radii, masses, inertias, materials (by name), positions and velocities of balls and clumps are those of the
        run to the last bit. Orientations, and places of balls in clumps, are so to rounding; absent balls are left out.
        Walls, laws, gravity, joints and loads are those of this scene, whose time begins at 0. Of a run whose periodic box
        deforms velocities are those against its mean flow, as scenes have them; the box is not taken over, and one that is
        sheared fits where `result.box(frame).tilt` is 0.

        Balls of a settled pile overlap by up to about the `pile_tolerance` of its run. Give this scene the same one, and
        they count as touching. Method `moreau` does so with `position_projection = true` alone.
        """
        times = np.asarray(result.time)
        if time is not None and len(times):
            time = number("spheres_from", "time", time, "time")
            if not times[0] * (1 - 1e-9) <= time <= times[-1] * (1 + 1e-9):
                told = f"{time:.12g} s is outside of the run, {times[0]:.12g} to {times[-1]:.12g} s"
                raise CaromError(f"spheres_from: time: {told}; give one within")
            frame = int(np.abs(times - time).argmin())
        if not -len(times) <= frame < len(times):
            cure = (
                f"give one of {-len(times)} to {len(times) - 1}"
                if len(times)
                else "wait until the run has some"
            )
            raise CaromError(f"there is no frame {frame}; {cure}")
        _warn_of_overlaps(result)
        materials = [material.name for material in result.scene.materials]
        state = {
            name: np.asarray(getattr(result, name)[frame]).tolist()
            for name in ("position", "velocity", "angular_velocity", "orientation")
        }
        bodies = {
            name: np.asarray(result.bodies[name]).tolist()
            for name in ("radius", "mass", "inertia", "material")
        }
        box = result.box(frame)
        if box is not None and box.deforms:
            # Velocities of a scene are against its mean flow.
            flow = box.flow_velocity(np.asarray(result.position[frame]))
            state["velocity"] = (np.asarray(result.velocity[frame]) - flow).tolist()
        there = np.flatnonzero(np.asarray(result.present[frame])).tolist()
        parts = {k for clump in result.clumps.values() for k in clump.numbers.tolist()}
        label = "Scene.spheres_from"
        spheres: list[Sphere] = []
        for k in there:
            if k in parts:
                continue
            radius, mass, inertia = bodies["radius"][k], bodies["mass"][k], bodies["inertia"][k]
            spheres.append(
                make(
                    Sphere,
                    label,
                    name=result.names[k],
                    radius=radius,
                    mass=mass,
                    inertia=None if inertia == 0.4 * mass * radius * radius else inertia,
                    material=materials[bodies["material"][k]],
                    **{name: values[k] for name, values in state.items()},
                )
            )
        clumps: list[Clump] = []
        for clump, table in zip(result.clumps.values(), result.scene.clumps, strict=True):
            if not clump.present[frame]:
                continue
            placed = table.placed(clump.position[frame], clump.orientation[frame])
            placed.velocity = clump.velocity[frame]
            if box is not None and box.deforms:
                placed.velocity = clump.velocity[frame] - box.flow_velocity(clump.position[frame])
            placed.angular_velocity = clump.angular_velocity[frame]
            clumps.append(placed)
        taken: tuple[Sphere | Clump, ...] = (*spheres, *clumps)
        for one in taken:  # all names before anything is added: a scene is left as it was where one is taken
            self._take_name(one.name, label)
        for material in dict.fromkeys(one.material for one in taken):
            self.material(material)
        self._tree.sphere.extend(spheres)
        self._tree.clump.extend(clumps)
        return taken


def _warn_of_overlaps(result: RunData) -> None:
    """Balls that no scene begins with, even with the options of their run."""
    deepest = result.summary.get("penetration_max_relative") or 0.0
    if deepest > (most := touching(result.scene.run.options())):
        told = f"balls of this run overlapped by up to {deepest:.2g} radii, and scenes begin with {most:.2g} at most"
        cure = 'compute it with position_projection = true (method moreau), or with method = "nsga"'
        warnings.warn(f"spheres_from: {told}; {cure}", CaromWarning, stacklevel=3)
