"""The scenario as arrays: every ball of every table, in the order spheres, racks, lattices, clumps, inflows.

This order is the numbering of the core and of the results. A generator's balls depend on its keys and its
seed alone: the random numbers are the raw 64-bit output of PCG64, whose stream NumPy promises to keep, and
the positions use only additions, multiplications and square roots, which are the same on every machine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64, Bool
from carom.scene.assembly.vectors import cross, dot, scaled, unit
from carom.scene.tables.balls import Ball, Lattice, Rack, Sphere
from carom.scene.tables.base import Table
from carom.scene.tables.clumps import Clump
from carom.scene.tables.flow import Inflow

Entries = Mapping[str, Sequence[tuple[int, Table]]]
"""Tables by section, each with its place in the file."""


@dataclass(frozen=True)
class Segment:
    """Balls `start` to `stop` (excluded) come from table number `index` of `section`."""

    start: int
    stop: int
    section: str
    index: int
    each: int = 0
    """Balls of each clump, one after the other; 0 of balls that are no parts of clumps."""

    def clumps(self) -> int:
        """Number of clumps."""
        return (self.stop - self.start) // self.each if self.each else 0


@dataclass(frozen=True)
class Bodies:
    """N balls, SI. `material` holds indices into the list of materials given, -1 if unknown."""

    names: list[str]
    radius: F64  # (N,) m
    mass: F64  # (N,) kg
    inertia: F64  # (N,) kg m^2
    position: F64  # (N, 3) m
    velocity: F64  # (N, 3) m/s
    angular_velocity: F64  # (N, 3) rad/s, fixed axes
    orientation: F64  # (N, 4) unit quaternion, w first
    material: I64  # (N,)
    segments: list[Segment]

    @property
    def present(self) -> Bool:
        """Which balls are there at the start, (N,): not those of inflows."""
        there = np.ones(len(self.names), dtype=bool)
        for segment in self.segments:
            if segment.section == "inflow":
                there[segment.start : segment.stop] = False
        return there

    @property
    def clump(self) -> I64:
        """Number of the clump that each ball is a part of, (N,), as the core counts them; -1 of the others."""
        found, first = np.full(len(self.names), -1), 0
        for segment in self.segments:
            if segment.each:
                numbers = np.arange(first, first + segment.clumps())
                found[segment.start : segment.stop] = np.repeat(numbers, segment.each)
            first += segment.clumps()
        return found

    @property
    def whole_mass(self) -> F64:
        """Mass of the rigid body that each ball is or is a part of, (N,), kg."""
        return self.whole(self.mass)

    def whole(self, parts: F64) -> F64:
        """The sum of `parts`, (N,), over the rigid body that each ball is or is a part of, (N,)."""
        found = parts.copy()
        for segment in self.segments:
            if segment.each:
                shares = found[segment.start : segment.stop].reshape(-1, segment.each)
                shares[:] = shares.sum(axis=1, keepdims=True)
        return found

    def origin(self, body: int) -> tuple[str, int]:
        """Section and place in the file of the table that a ball comes from."""
        starts = [segment.start for segment in self.segments]
        segment = self.segments[int(np.searchsorted(starts, body, side="right")) - 1]
        return segment.section, segment.index


def expand(entries: Entries, materials: Sequence[str]) -> Bodies:
    """All balls of the sections sphere, rack, lattice, clump and inflow."""
    known = {name: i for i, name in enumerate(materials)}
    spheres = [(i, t) for i, t in entries.get("sphere", ()) if isinstance(t, Sphere)]
    segments = [Segment(k, k + 1, "sphere", i) for k, (i, _) in enumerate(spheres)]
    names = [s.name for _, s in spheres]
    balls: list[tuple[Ball, int]] = [(s, 1) for _, s in spheres]
    behind: list[Clump | Inflow] = []  # whose balls may differ from one another
    n = len(spheres)
    position = [np.array([s.position for _, s in spheres], dtype=float).reshape(n, 3)]
    velocity = [np.array([s.velocity for _, s in spheres], dtype=float).reshape(n, 3)]
    for section in ("rack", "lattice", "clump", "inflow"):
        for i, table in entries.get(section, ()):
            assert isinstance(table, Rack | Lattice | Clump | Inflow)
            with np.errstate(over="ignore", invalid="ignore"):  # absurd sizes are reported by the checks
                centres = _centres(table)
            count = len(centres)
            segments.append(Segment(len(names), len(names) + count, section, i, _each(table)))
            names += table.ball_names()
            if isinstance(table, Clump | Inflow):
                behind.append(table)
            else:
                balls.append((table, count))
            position.append(centres)
            velocity.append(_velocities(table, count))
    counts = [count for _, count in balls]
    kinds = [b.material for b, _ in balls] + [t.material for t in behind]

    def each(first: list[float], others: list[F64]) -> F64:
        return np.concatenate([np.repeat(np.array(first, dtype=float), counts), *others])

    total = len(names)
    spin = np.zeros((total, 3))
    orientation = np.zeros((total, 4))
    orientation[:, 0] = 1.0
    spin[:n] = np.array([s.angular_velocity for _, s in spheres], dtype=float).reshape(n, 3)
    orientation[:n] = np.array([unit(s.orientation) for _, s in spheres], dtype=float).reshape(n, 4)
    tables = {section: dict(entries.get(section, ())) for section in ("clump", "inflow")}
    for segment in segments:
        if segment.each:
            table = tables[segment.section][segment.index]
            clump = table.shape() if isinstance(table, Inflow) else table
            assert isinstance(clump, Clump)
            spin[segment.start : segment.stop] = clump.angular_velocity
            orientation[segment.start : segment.stop] = clump.turn()
    return Bodies(
        names=names,
        radius=each([b.radius for b, _ in balls], [t.radii() for t in behind]),
        mass=each([b.mass_kg() for b, _ in balls], [t.masses() for t in behind]),
        inertia=each([b.inertia_kg_m2() for b, _ in balls], [t.inertias() for t in behind]),
        position=np.concatenate(position),
        velocity=np.concatenate(velocity),
        angular_velocity=spin,
        orientation=orientation,
        material=np.repeat(
            np.array([known.get(kind, -1) for kind in kinds], dtype=np.int64),
            [*counts, *(t.size() for t in behind)],
        ),
        segments=segments,
    )


def _each(table: Rack | Lattice | Clump | Inflow) -> int:
    """Balls of each clump of a table; 0 of one that makes balls."""
    if isinstance(table, Rack | Lattice) or not table.spheres:
        return 0
    return len(table.spheres)


def _velocities(table: Rack | Lattice | Clump | Inflow, count: int) -> F64:
    """Velocities (N, 3) at the start of the balls of a table."""
    if isinstance(table, Clump):
        return table.velocities()
    start = (0.0, 0.0, 0.0) if isinstance(table, Rack) else table.velocity
    return np.broadcast_to(np.array(start), (count, 3))


def _centres(table: Rack | Lattice | Clump | Inflow) -> F64:
    """Centres (N, 3) of the balls of a table."""
    if isinstance(table, Clump):
        return table.centres()
    if isinstance(table, Rack):
        return rack_centres(table)
    if isinstance(table, Lattice):
        return lattice_centres(table)
    shape = table.shape()  # where they wait, out of the world
    return np.tile([table.region.centre()] if shape is None else shape.centres(), (table.count, 1))


def rack_centres(rack: Rack) -> F64:
    """Centres (N, 3) of a rack, apex first, in each row from left to right as seen along its direction."""
    up = scaled(rack.up)
    along = scaled(rack.direction)
    along = scaled([a - dot(along, up) * u for a, u in zip(along, up, strict=True)])  # into the table
    left = np.array(cross(up, along))
    pitch = 2.0 * rack.radius + rack.gap
    lengths = rack.row_lengths()
    rows = np.repeat(np.arange(len(lengths)), lengths)
    first = np.repeat(np.cumsum([0, *lengths[:-1]]), lengths)
    place = np.arange(len(rows)) - first
    aside = 0.5 * (np.repeat(lengths, lengths) - 1) - place  # in pitches, positive to the left
    centres = (
        np.array(rack.apex)
        + np.outer(rows * (np.sqrt(3.0) / 2.0 * pitch), along)
        + np.outer(aside * pitch, left)
    )
    if rack.jitter > 0:
        offset = uniform(rack.seed or 0, (len(rows), 2)) * rack.jitter
        centres += np.outer(offset[:, 0], along) + np.outer(offset[:, 1], left)
    return centres


def lattice_centres(lattice: Lattice) -> F64:
    """Centres (N, 3) of a lattice, x fastest, then y, then z."""
    spacing = 2.0 * lattice.radius if lattice.spacing is None else lattice.spacing
    a, b, c = lattice.counts
    k, j, i = (g.ravel().astype(float) for g in np.meshgrid(range(c), range(b), range(a), indexing="ij"))
    # bcc and fcc are layers of squares, shifted by half a square in turn: neighbours are one spacing apart
    if lattice.kind == "bcc":
        i, j, k = (
            np.sqrt(4.0 / 3.0) * (i + 0.5 * (k % 2)),
            np.sqrt(4.0 / 3.0) * (j + 0.5 * (k % 2)),
            k / np.sqrt(3.0),
        )
    elif lattice.kind == "fcc":
        i, j, k = i + 0.5 * (k % 2), j + 0.5 * (k % 2), np.sqrt(0.5) * k
    elif lattice.kind == "hcp":
        i, j, k = i + 0.5 * ((j + k) % 2), np.sqrt(0.75) * (j + (k % 2) / 3), np.sqrt(2.0 / 3.0) * k
    centres: F64 = np.array(lattice.origin) + spacing * np.stack([i, j, k], axis=1)
    if lattice.jitter > 0:
        centres += uniform(lattice.seed or 0, centres.shape) * lattice.jitter
    return centres


def uniform(seed: int, shape: tuple[int, ...]) -> F64:
    """Random numbers in [-1, 1) that depend on `seed` alone, also across versions of NumPy."""
    count = int(np.prod(shape))
    raw = np.random.PCG64(seed).random_raw(count) >> np.uint64(11)  # 53 random bits each
    return (raw.astype(np.float64) * 2.0**-52 - 1.0).reshape(shape)
