"""Rules about a scenario as a whole, checked before a run: names, materials, contact laws, the starting
positions.

Each check yields `Finding`s; nothing is raised here. The tables may come from a file of which other tables
could not be read (`Parts.damaged`): then rules that would only repeat that error are left out, so that one
mistake gives one message.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, TypeVar

import numpy as np

from carom.arrays import I64, Bool
from carom.errors import did_you_mean, quoted
from carom.scene.assembly.bodies import Bodies, expand
from carom.scene.assembly.held_apart import held_apart
from carom.scene.assembly.mechanics import MECHANICS, joints_for_core, numbers
from carom.scene.assembly.placing import Placed, placed_walls
from carom.scene.checks.areas import check_areas
from carom.scene.checks.attachments import check_names, check_rods
from carom.scene.checks.clumps import check_clumps, check_size, usable_clumps
from carom.scene.checks.deformation import check_deformation
from carom.scene.checks.flow import check_flow
from carom.scene.checks.joint_start import check_start
from carom.scene.checks.overlap import overlaps
from carom.scene.checks.penalty import check_penalty
from carom.scene.checks.walls import MOST, TOUCHING, check_periodic, check_walls, start_overlap
from carom.scene.messages import Finding
from carom.scene.plan import MOST_STEPS, SLACK, whole_steps
from carom.scene.tables.balls import MOST_BALLS, Generator
from carom.scene.tables.base import Table
from carom.scene.tables.clumps import Clump
from carom.scene.tables.flow import Inflow
from carom.scene.tables.joints import Joint
from carom.scene.tables.model import REPEATED, Contact, Material, Record, Scenario, World
from carom.scene.tables.options import RunBase
from carom.scene.tables.walls import WALLS
from carom.scene.toml.lines import Path

T = TypeVar("T", bound=Table)

SAMPLES = 200
"""Parts of equal length into which the times of a run are divided where its laws are looked at."""


@dataclass
class Parts:
    """The tables of a scenario that could be read, each with its place in the file."""

    run: RunBase | None
    entries: Mapping[str, Sequence[tuple[int, Table]]]
    damaged: frozenset[str] = frozenset()
    """Sections with a table that could not be read."""
    lost_materials: frozenset[str] = frozenset()
    """Names of materials whose tables could not be read."""
    world: World | None = None
    record: Record | None = None
    broken: Sequence[tuple[str, int, Mapping[str, Any]]] = ()
    """Tables that could not be read, each with its section and place: names in them are looked at all the same."""
    _walls: list[Placed] | None = field(default=None, repr=False)
    _bodies: Bodies | None = field(default=None, repr=False)

    def tables(self, kind: type[T]) -> list[tuple[int, T]]:
        """The tables of a kind, each with its place among those of the file."""
        section = next(name for name, known in REPEATED.items() if known is kind)
        return [(i, t) for i, t in self.entries[section] if isinstance(t, kind)]

    def materials(self) -> list[str]:
        return [t.name for _, t in self.tables(Material)]

    def contacts(self) -> list[tuple[int, Contact]]:
        return self.tables(Contact)

    @property
    def periods(self) -> tuple[float, float, float] | None:
        return self.world.periodic if self.world is not None else None

    def times(self) -> list[float]:
        """Instants of the run at which its laws are looked at, s; the start alone where the end is not known."""
        until = self.run.until if self.run is not None else None
        return np.linspace(0.0, until, SAMPLES + 1).tolist() if until else [0.0]

    def walls(self) -> list[Placed]:
        """All walls, in the order of the core."""
        if self._walls is None:
            self._walls = placed_walls(self.entries)
        return self._walls

    def balls_damaged(self) -> bool:
        """Whether a ball is missing because its table could not be read."""
        return bool(self.damaged & set(BALLS))

    def bodies(self) -> Bodies:
        if self._bodies is None:
            self._bodies = expand(self.entries, self.materials())
        return self._bodies

    def no_contact(self, bodies: I64) -> Callable[[I64, I64], Bool]:
        """Which pairs of these bodies, numbered as they are listed, have no contact."""
        every = self.bodies()
        number = numbers(every) if self.entries["joint"] else {}
        named = [(joint, joint.between or [joint.body]) for _, joint in self.tables(Joint)]
        # Balls that could not be read have no number.
        joined = joints_for_core([j for j, names in named if {*names} <= number.keys()], every, number)
        held = held_apart(joined, every.radius, every.clump)
        return lambda a, b: held.holds(bodies[a], bodies[b])

    def place(self, body: int) -> tuple[str, int, str]:
        """The key that says where a ball is, with its table."""
        section, index = self.bodies().origin(body)
        keys = {"sphere": "position", "rack": "apex", "lattice": "origin", "clump": "position"}
        return section, index, keys.get(section, "region")


class Whole(Parts):
    """The tables of a scenario that was read without errors; once `check` found none it has balls and an end."""

    run: RunBase
    world: World
    record: Record

    @classmethod
    def of(cls, tree: Scenario) -> Whole:
        entries = {name: list(enumerate(getattr(tree, name))) for name in SECTIONS}
        return cls(tree.run, entries, world=tree.world, record=tree.record)

    @property
    def until(self) -> float:
        assert self.run.until is not None
        return self.run.until


BALLS = ("sphere", "rack", "lattice", "clump", "inflow")
SECTIONS = ("material", "contact", *BALLS, *WALLS, "outlet", *MECHANICS)


def check(parts: Parts) -> Iterator[Finding]:
    """Everything that forbids a run."""
    yield from check_times(parts)
    crowd = list(_crowd(parts))
    yield from crowd
    if crowd:
        return  # before anything is allocated for so many
    yield from _names(parts)
    yield from _materials(parts)
    yield from _pairs(parts)
    yield from check_clumps(parts)
    yield from check_deformation(parts)
    yield from check_penalty(parts)
    yield from check_rods(parts)
    wrong_names = list(check_names(parts))
    yield from wrong_names
    if len(parts.bodies().names) == 0:
        if not parts.balls_damaged():
            cure = "add a [[sphere]], [[packing]], [[rack]] or [[lattice]]"
            yield Finding(("sphere",), "the scene has no spheres", cure, "add one with scene.sphere(...)")
        return
    bad_numbers = list(_usable_numbers(parts))
    yield from bad_numbers
    if not bad_numbers:
        yield from check_walls(parts)
        yield from check_periodic(parts)
        yield from check_areas(parts)
        yield from check_size(parts)
        yield from check_flow(parts)
        wrong = parts.damaged | {finding.path[0] for finding in wrong_names}
        if "joint" not in wrong:  # joints say which balls may overlap
            yield from _overlaps(parts)
        if not wrong_names and not parts.balls_damaged():
            yield from check_start(parts)


def steps(run: RunBase) -> int:
    """Number of steps of a run: those that reach `until`."""
    return whole_steps(run.until or 0.0, run.step)


def check_times(parts: Parts) -> Iterator[Finding]:
    """An end that there is, and that some steps reach, but not too many."""
    run = parts.run
    if run is None:
        return
    if run.until is None:
        cure = "add until = 3.0 (simulated time, s); it has no default"
        yield Finding(
            ("run", "until"), "is missing", cure, "pass until=... (simulated time, s); it has no default"
        )
    elif run.until < run.step * (1 - SLACK):
        if run.options()["method"] == "events":
            cause = f"until = {run.until:g} s is shorter than the {run.step:g} s between two frames"
            cure = f'give a longer until, or method = "events" and step = {run.until:g} together'
            yield Finding(("run", "until"), cause, cure)
        else:
            cause = f"until = {run.until:g} s is shorter than one step of {run.step:g} s"
            yield Finding(("run", "until"), cause, "give a longer until or a shorter step")
    elif steps(run) > MOST_STEPS:
        cause = f"{run.until:g} s in steps of {run.step:g} s are more than 10^12 steps"
        yield Finding(("run", "step"), cause, "give a longer step or a shorter until")


def _crowd(parts: Parts) -> Iterator[Finding]:
    """Every table may stand for `MOST_BALLS` balls, and all of them together."""
    total = 0
    for section in BALLS:
        for i, table in parts.entries[section]:
            total += table.size() if isinstance(table, Generator | Clump | Inflow) else 1
            if total > MOST_BALLS:
                cause = f"with this table there are more than {MOST_BALLS} balls"
                yield Finding((section, i), cause, "reduce their number")
                return


def _names(parts: Parts) -> Iterator[Finding]:
    seen: set[str] = set()
    for i, table in parts.tables(Material):
        if table.name in seen:
            yield Finding(
                ("material", i, "name"), f"{quoted(table.name)} is declared twice", "remove one of them"
            )
        seen.add(table.name)
    bodies = parts.bodies()
    # Clumps c1 to c12 may have one called as a ball of another: who means which of both is refused, where one is meant.
    known = {name: "sphere" for name, of in zip(bodies.names, bodies.clump, strict=True) if of < 0}
    if len(set(bodies.names)) < len(bodies.names):
        for body in islice(_repeated(bodies.names), MOST):
            section, index = bodies.origin(body)
            cause = f"there are two spheres {quoted(bodies.names[body])}"
            yield Finding((section, index, "name"), cause, _rename(section))
    clumps = [("clump", i, clump.name, "clump") for i, clump in parts.tables(Clump)]
    clumps += [
        ("inflow", i, clump.name, "clump") for i, flow in parts.tables(Inflow) for clump in flow.clumps()
    ]
    walls = ((wall.section, wall.index, wall.name, _words(wall.section)) for wall in parts.walls())
    for section, index, name, what in (*clumps, *walls):
        if name in known and not what == known[name] == "clump":  # their balls are called alike too
            cause = f"there is already a {known[name]} {quoted(name)}"
            yield Finding((section, index, "name"), cause, f"give the {_words(section)} another name")
        known[name] = what


def _words(section: str) -> str:
    return section.replace("_", " ")


def _repeated(names: Sequence[str]) -> Iterator[int]:
    """Places of names that stood further up."""
    met: set[str] = set()
    for place, name in enumerate(names):
        if name in met:
            yield place
        met.add(name)


def _rename(section: str) -> str:
    single = section in ("sphere", "clump")
    return "give one another name" if single else "change name (the prefix) or first_number"


def _materials(parts: Parts) -> Iterator[Finding]:
    known = parts.materials()
    admitted = set(known) | parts.lost_materials
    unknown = [(path, name) for path, name in _named_materials(parts) if name not in admitted]
    if not admitted and "material" not in parts.damaged and unknown:
        names = ", ".join(quoted(name) for name in sorted({name for _, name in unknown}))
        yield Finding(
            unknown[0][0], "no material is declared", f"add [[material]] with name = ... for {names}"
        )
        return
    for path, name in unknown:
        yield Finding(path, f"unknown material {quoted(name)}", did_you_mean(name, known))


def _named_materials(parts: Parts) -> Iterator[tuple[Path, str]]:
    """Every name of a material with its place, also in tables that are wrong in another way."""
    read = [(section, i, vars(table)) for section, tables in parts.entries.items() for i, table in tables]
    for section, i, table in (*read, *parts.broken):
        key = "between" if section == "contact" else "material"
        if section in ("contact", *BALLS, *WALLS):
            given = table.get(key)
            names = given if isinstance(given, list | tuple) else [given]
            for name in dict.fromkeys(name for name in names if isinstance(name, str)):
                yield (section, i, key), name


def _pairs(parts: Parts) -> Iterator[Finding]:
    laws: set[frozenset[str]] = set()
    for i, contact in parts.contacts():
        pair = frozenset(contact.between)
        if pair in laws:
            names = " and ".join(quoted(n) for n in contact.between)
            yield Finding(("contact", i, "between"), f"a second law for {names}", "remove one of the two")
        laws.add(pair)
    if "contact" in parts.damaged:
        return
    known = set(parts.materials())
    for (a, b), why in meetings(parts).items():
        if frozenset((a, b)) not in laws and {a, b} <= known:
            place = max(i for i, t in parts.tables(Material) if t.name in (a, b))
            cure = f'add [[contact]] between = ["{a}", "{b}"] with friction and restitution'
            call = f'add scene.contact("{a}", "{b}", friction=..., restitution=...)'
            yield Finding(
                ("material", place), f"no contact law for {quoted(a)} and {quoted(b)}: {why}", cure, call
            )


def meetings(parts: Parts) -> dict[tuple[str, str], str]:
    """Pairs of materials that can meet (walls do not meet walls), with two bodies that show it."""
    first: dict[str, list[str]] = {}  # the first two balls of each material that are no parts of one clump
    bodies = parts.bodies()
    names = parts.materials()
    kinds, starts = np.unique(bodies.material, return_index=True)
    clump = bodies.clump
    for kind, start in zip(kinds, starts, strict=True):
        if kind >= 0:
            apart = (clump < 0) | (clump != clump[start])
            apart[start] = False
            others = np.flatnonzero((bodies.material == kind) & apart)[:1].tolist()
            first[names[kind]] = [bodies.names[k] for k in (start, *others)]
    found: dict[tuple[str, str], str] = {}
    ordered = list(first)
    for k, a in enumerate(ordered):
        if len(first[a]) > 1:
            found[a, a] = f"spheres {quoted(first[a][0])} and {quoted(first[a][1])} can meet"
        for b in ordered[k + 1 :]:
            found[a, b] = f"spheres {quoted(first[a][0])} and {quoted(first[b][0])} can meet"
        for wall in parts.walls():
            pair = (a, wall.material)
            if pair not in found and pair[::-1] not in found:
                what = f"{_words(wall.section)} {quoted(wall.name)}"
                found[pair] = f"sphere {quoted(first[a][0])} can meet {what}"
    return found


def _usable_numbers(parts: Parts) -> Iterator[Finding]:
    """Sizes at which squares and cubes neither overflow nor vanish, distances that doubles resolve."""
    bodies = parts.bodies()
    limits = (
        ("radius", bodies.radius, 1e-12, 1e12),
        ("mass", bodies.mass, 1e-60, 1e60),
        ("inertia", bodies.inertia, 1e-90, 1e90),
    )
    unusable = False
    for segment in bodies.segments:
        for key, values, least, most in limits:
            several = values[segment.start : segment.start + (segment.each or 1)]
            wrong = several[~((several >= least) & (several <= most))]  # also catches nan
            if len(wrong):
                cause = f"{key} comes to {wrong[0]:g}, outside {least:g} to {most:g}"
                place = "spheres" if segment.each else key
                yield Finding((segment.section, segment.index, place), cause, "check the units")
                unusable = True
                break  # mass and inertia follow from the radius
    moments = [] if unusable else list(usable_clumps(parts))
    yield from moments
    if unusable or moments:
        return
    far = ~(np.abs(bodies.position).max(axis=1) <= 1e12 * bodies.radius)  # also catches nan
    for body in np.flatnonzero(far)[:MOST]:
        cause = f"{quoted(bodies.names[body])} is more than 10^12 radii from the origin"
        yield Finding((*bodies.origin(int(body)), "position"), cause, "move the origin near the spheres")


def _overlaps(parts: Parts) -> Iterator[Finding]:
    bodies = parts.bodies()
    there = np.flatnonzero(bodies.present)
    position, radius = bodies.position[there], bodies.radius[there]
    admitted = start_overlap(parts)
    no_contact = parts.no_contact(there)
    for first, second, gap in overlaps(position, radius, admitted, MOST, parts.periods, no_contact):
        a, b = int(there[first]), int(there[second])
        too_deep = -gap - (admitted - TOUCHING) * min(radius[first], radius[second])
        names = f"{quoted(bodies.names[a])} and {quoted(bodies.names[b])}"
        cause = f"spheres {names} overlap at the start, gap {gap:.4g} m"
        section, index, key = parts.place(b)
        if section == "sphere":
            cure = f"move them {too_deep:.4g} m further apart"
        elif section == "rack" and bodies.origin(a) == (section, index):
            cure = "give a larger gap or less jitter"
        elif section == "lattice" and bodies.origin(a) == (section, index):
            cure = "give a larger spacing or less jitter"
        else:
            cure = f"move the {section} by more than {too_deep:.4g} m"
        yield Finding((section, index, key), cause, cure)
