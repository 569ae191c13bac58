"""A run as the auditor reads it: the files through `carom.load`, the scenario as arrays, frames in blocks of intervals.

Nothing here computes physics. An *interval* is what lies between two neighbouring frames: the state at both ends, and what
`/contacts`, `/impacts` and `/steps` recorded in between.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from copy import copy
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from carom import _core
from carom.arrays import F64, I64, Array, Bool, connected
from carom.audit import guided, rigid
from carom.audit.formula import law
from carom.audit.lattice import Lattice
from carom.audit.meshes import Parts
from carom.audit.report import Place
from carom.audit.surfaces import Surface
from carom.audit.vectors import UP, direction, norm
from carom.result.record import Segments, clumps
from carom.result.record.walls import tables
from carom.result.tables import Table
from carom.run.result import Result, UnfinishedRun, load
from carom.scene.assembly.held_apart import HeldApart, held_apart
from carom.scene.assembly.triangles import Triangles
from carom.scene.scene import Scene
from carom.scene.tables.impact_laws import LAWS, ImpactLaw
from carom.scene.tables.options import MOST_PROBLEMS, loads_once, stepping

LEVELS = ("smooth", "position", "velocity")

#: Tolerances that bounds are made of; no table shows how large those of `UNSEEN` were.
SHOWN = ("tolerance", "pile_tolerance", "gap_tolerance")
UNSEEN = (
    "touching_tolerance",
    "tolerance_floor",
    "closing_tolerance_load",
    "closing_tolerance_speed",
)
#: Sizes of islands from which on bounds are wider: the smaller, the more of them.
SIZES = ("dense_contacts", "pile_contacts")

NAMES = ("friction", "restitution", "tangential_restitution", "rolling_radius", "spinning_radius")


def _share(t: Mapping[str, float], tolerance: str) -> float:
    """What counts as closing, over the speed of the loads."""
    return float(min(1e5 * t[tolerance], t["closing_tolerance_load"]))


def zeros(form: Any) -> F64:
    """A stand-in for a Python load function, which no file can hold."""
    raise AssertionError("a load function is never called by the auditor")


class Run:
    """What a run left behind, as arrays in SI units. N bodies, T frames, S steps."""

    def __init__(self, result: Result) -> None:
        self.result = result
        self.doubted = False
        #: What was computed of it (`block.once`).
        self.known: dict[Any, Any] = {}
        self.path = Path(result.path)
        scene = Scene.from_toml(self.path / "scenario.toml")
        self.opaque = [place.name for place in scene.load_functions if place.function is None]
        for name in list(self.opaque):
            scene.load_function(zeros, name=name)
        self.model = scene.to_model()
        self.options: dict[str, Any] = dict(self.model["options"])
        self.record = scene.record
        self.method = str(self.options["method"])
        self.h = float(self.options["step"])
        self.until = float(scene.run.until or 0.0)
        self.every = int(scene.record.every or 1)
        of_balls: list[F64] = [np.asarray(result.bodies[n]) for n in ("radius", "mass", "inertia")]
        #: Number of balls; free walls are the bodies behind them.
        self.balls = len(of_balls[0])
        self.free_walls = guided.of_model(self.model)
        free = len(self.free_walls)
        # A free wall has no radius: where numbers are compared with one it has that of the smallest ball.
        smallest = float(of_balls[0].min(initial=np.inf))
        self.radius: F64 = np.append(of_balls[0], np.full(free, smallest))
        self.mass: F64 = np.append(of_balls[1], [wall.mass for wall in self.free_walls])
        self.inertia: F64 = np.append(of_balls[2], np.full(free, guided.HELD))
        #: Rigid bodies of balls, which are bodies themselves.
        self.clumps = rigid.of_model(self.model, len(self.mass))
        #: (N,) the clump of each body, -1 where there is none.
        self.clump_of: I64 = np.full(len(self.mass), -1)
        #: Masses of bodies, of balls of clumps those of the whole clumps, kg: what they may press with.
        self.heavy: F64 = self.mass.copy()
        #: Mass of all bodies together, kg.
        self.whole_mass = float(self.mass.sum())
        self.clump_of[self.clumps.balls] = self.clumps.of
        self.whole_mass += float(self.clumps.mass.sum() - self.mass[self.clumps.balls].sum())
        self.heavy[self.clumps.balls] = self.clumps.mass[self.clumps.of]
        #: (N,) the body that stands for each where joints and loads act: of balls of clumps the first one of the clump.
        self.node: I64 = np.arange(len(self.mass))
        self.node[self.clumps.balls] = self.clumps.first[self.clumps.of]
        #: Of these their least moments of inertia, kg m^2, and how far they reach from their centres, m.
        self.node_inertia, self.node_reach = self.inertia.copy(), self.radius.copy()
        self.node_inertia[self.clumps.first] = self.clumps.least
        self.node_reach[self.clumps.first] = self.clumps.reach
        self.mass, self.inertia = rigid.lightest(self.clumps, self.radius, self.mass, self.inertia)
        #: Levers of bodies, and of walls at last, m: none at walls.
        self.reach: F64 = np.concatenate([of_balls[0], np.zeros(free + 1)])
        #: Lengths that gaps of bodies, and of walls at last, are compared with, m: walls have none of their own.
        self.length: F64 = np.concatenate([of_balls[0], np.full(free + 1, np.inf)])
        self.material = np.asarray(self.model["material"]).astype(np.int64)
        self.gravity: F64 = result.gravity
        self.period: F64 | None = result.periodic
        #: The periodic box over time.
        self.box = Lattice(self.model, self.period)
        self.names = [*scene.names, *scene.wall_names]
        self.bodies = self.balls + free
        #: Gravity as bodies have it, (3,) or (N, 3), m/s^2.
        self.falls: F64 = self.gravity
        if free:
            falls = [wall.fall(self.gravity) for wall in self.free_walls]
            self.falls = np.vstack([np.tile(self.gravity, (self.balls, 1)), falls])
        #: Walls that stand, or move as prescribed.
        self.walls = _walls(self.model)[free:]
        for wall in self.walls:
            wall.taken_by_steps(self.h)
        self.given_walls = len(self.walls)
        self.parts = Parts(self.walls, self.names, self.bodies)
        for table in (result.contacts, result.impacts):
            for first in range(0, len(table) if self.parts.meshes else 0, 1_000_000):
                self.pairs(table, first, first + 1_000_000)  # parts have the planes that the run names
        self.wall_tables = tables(scene.wall_names, self.model)
        self.clump_table: dict[str, Any] = clumps.table(scene.clumps, self.model).get("clumps", {})
        if self.clumps:
            _ = result.clumps  # which refuses tables that do not fit
        self.joints: list[Any] = list(self.model.get("joints", ()))
        #: Whether some pairs attract each other.
        self.cohesive = bool(np.any(np.asarray(self.model.get("cohesion", 0.0)) > 0.0))
        self.loads: list[Any] = [
            *self.model.get("loads", ()),
            *([{"kind": "cohesion"}] if self.cohesive else []),
        ]
        #: Whether loads act on balls.
        self.loads_on_balls = bool(self.loads)
        self.time = np.asarray(result.time)
        self.step = np.asarray(result.step).astype(np.int64)
        self.frames = len(self.time)
        self.steps = {name: np.asarray(result.steps[name]) for name in result.steps.columns}
        self._press()

    def _press(self) -> None:
        """Adds the forces of free walls to the loads."""
        #: Areas that pressures of free walls act on at the times of the grid, m^2; 1 of forces.
        self.areas: list[F64] = []
        if not self.free_walls:
            return
        grid = np.concatenate([[0.0], self.steps["time"]])
        moved_by = np.asarray(self.result._segments.column("frames", "free_walls")[:])
        for w, wall in enumerate(self.free_walls):
            series = guided.areas(self.model, wall, grid, self.time, moved_by)
            self.areas.append(series[1])
            self.loads += wall.load(self.balls + w, series)

    def state(self, rows: slice) -> tuple[F64, F64, F64, F64]:
        """Places, velocities, angular velocities and orientations of all bodies at some frames, (T, N, ...): of free walls
        their displacements along their normals, and their velocities along these.
        """
        r = self.result
        x, v, w, q = (
            np.asarray(c[rows]) for c in (r.position, r.velocity, r.angular_velocity, r.orientation)
        )
        if not self.free_walls:
            return x, v, w, q
        along = np.asarray(r._segments.column("frames", "free_walls")[rows])
        normal = np.array([wall.normal for wall in self.free_walls])
        still = np.zeros((*along.shape[:2], 3))
        upright = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*along.shape[:2], 4))
        of_walls = along[..., :1] * normal, along[..., 1:] * normal, still, upright
        x, v, w, q = (np.concatenate(both, axis=1) for both in zip((x, v, w, q), of_walls, strict=True))
        return x, v, w, q

    def motion_of_clumps(self, rows: slice) -> F64:
        """(T, C, 13) centres, principal axes, velocities and angular velocities of the clumps at some frames."""
        if not self.clumps:
            return np.zeros((len(self.time[rows]), 0, 13))
        return np.asarray(self.result._segments.column("frames", "clumps")[rows])

    @property
    def in_clump(self) -> Bool:
        """(N,) which bodies are balls of clumps."""
        return self.clump_of >= 0

    def present(self, rows: slice) -> Bool:
        """(T, N) which bodies are there at some frames."""
        of_balls = np.asarray(self.result.present[rows])
        free = np.ones((len(of_balls), len(self.free_walls)), dtype=bool)
        return np.hstack([of_balls, free])

    def is_free_wall(self, b: I64) -> Bool:
        """(K,) which bodies are free walls."""
        return np.asarray((b >= self.balls) & (b < self.bodies))

    def taken(self, b: I64, given: F64) -> F64:
        """What bodies `b` (K,) take of impulses (K, 3): free walls the part along their normals."""
        return guided.taken(self.free_walls, self.balls, b, given)

    def wall_number(self, b: I64) -> I64:
        """(K,) which of all given walls the bodies are, in the order of the tables of walls."""
        return self.given(b) - self.balls

    @cached_property
    def loosest(self) -> dict[str, float]:
        """Each claimed tolerance, but none looser than the run shows: the largest residual, or overlap, of its steps, and
        not below the default. Who claims a looser one widens no bound by it.
        """
        found, usual, s = dict(self.claimed), _core.defaults(), self.steps
        if self.doubted:
            found.update({name: min(found[name], float(usual[name])) for name in UNSEEN})
            found.update({name: max(found[name], float(usual[name])) for name in SIZES})
        residual = max(float(s[f"residual_{level}"].max(initial=0.0)) for level in LEVELS)
        overlap = float(s["penetration_relative"].max(initial=0.0))
        shown = {"tolerance": residual, "pile_tolerance": max(residual, 2.0 * overlap)}
        if not self.joints:  # whose lengths no step reports
            shown["gap_tolerance"] = overlap
        for name, most in shown.items():
            found[name] = min(found[name], max(float(usual[name]), most))
        return found

    @cached_property
    def claimed(self) -> dict[str, float]:
        """Each tolerance at its loosest, each size of islands at its smallest."""
        worst = dict.fromkeys(SHOWN + UNSEEN, max) | dict.fromkeys(SIZES, min)
        return {name: of(self.held_to(name)) for name, of in worst.items()}

    def held_to(self, name: str) -> list[float]:
        """All values that an option had within the run: `carom resume --set` may have changed it."""
        changes = self.result._about.get("changes", ())
        values = (change.get("options", {}).get(name, ()) for change in changes)
        return [float(self.options[name]), *(float(value) for pair in values for value in pair)]

    @property
    def unseen(self) -> list[str]:
        """Claims that widen bounds and that no table bears out, as "option = value"."""
        usual = _core.defaults()
        found = [name for name in UNSEEN if self.claimed[name] > float(usual[name])]
        # What counts as closing follows from the tolerance that was asked for, whatever residuals the solvers reached.
        found += [name for name in SHOWN[:2] if _share(self.claimed, name) > _share(self.loosest, name)]
        found += [name for name in SIZES if self.claimed[name] < float(usual[name])]
        return [f"{name} = {self.options[name]:g}" for name in found]

    def load_share(self, contacts: I64 | F64) -> F64:
        """Closing tolerance over the speed of the loads (rule R3) in islands of so many contacts."""
        t = self.loosest if self.doubted else self.claimed
        small, coarse = _share(t, "tolerance"), _share(t, "pile_tolerance")
        return np.where(contacts > self.loosest["dense_contacts"], max(small, coarse), small)

    def by_default(self) -> Run:
        """The same run, as if it had made none of the claims that no table bears out."""
        found = copy(self)
        found.__dict__.pop("loosest", None)
        found.known = {}
        found.doubted = True
        return found

    @cached_property
    def law_of(self) -> I64:
        """Number of the contact law of two materials, (M, M), -1 where there is none."""
        a, b = self.model["law_a"], self.model["law_b"]
        of_walls = [*(w.material for w in self.free_walls), *(w.material for w in self.walls)]
        most = 1 + max([*a, *b, *self.material, *of_walls], default=0)
        found = np.full((most, most), -1, dtype=np.int64)
        found[a, b] = found[b, a] = np.arange(len(a))
        return found

    def law_index(self, a: I64, b: I64) -> I64:
        """Laws of the pairs of bodies a and b (walls from N on)."""
        of_free = np.array([w.material for w in self.free_walls], dtype=np.int64)
        of_walls = np.array([w.material for w in self.walls], dtype=np.int64)
        material = np.concatenate([self.material, of_free, of_walls])
        return np.asarray(self.law_of[material[a], material[b]])

    def coefficient(self, name: str, index: I64) -> F64:
        """A column of the contact laws; not a number where there is no law (index -1)."""
        column = np.append(np.asarray(self.model[name], dtype=np.float64), np.nan)
        return np.asarray(column[index])

    def varying(self, name: str, index: I64, speed: F64) -> F64:
        """A coefficient that may be a law of a speed, m/s; without one the constant."""
        found = self.coefficient(name, index)
        for k, form in enumerate(self.model.get(f"{name}_law") or ()):
            if form is not None:
                mine = index == k
                found[mine] = law(form, speed[mine])[0]
        return found

    def friction(self, index: I64, slip: F64) -> F64:
        """mu at the slip speed of the start of the step, m/s."""
        return self.varying("friction", index, slip)

    def restitution(self, index: I64, approach: F64) -> F64:
        """e_N at the approach speed, m/s."""
        return np.clip(self.varying("restitution", index, np.maximum(approach, 0.0)), 0.0, 1.0)

    def rebound(self, index: I64, approach: F64, slack: F64) -> F64:
        """How much `e_N v` may change where the approach speed v is known to `slack`, beyond that of a constant e_N."""
        if not self.model.get("restitution_law"):
            return np.zeros(len(index))
        near = [self.restitution(index, approach + side * slack) for side in (-1.0, 1.0)]
        return np.asarray(np.abs(near[1] - near[0]) * np.maximum(approach, 0.0))

    @property
    def friction_varies(self) -> bool:
        """Whether any friction is a law of the slip speed."""
        return any(form is not None for form in self.model.get("friction_law") or ())

    @property
    def small(self) -> float:
        """Contacts of an island up to which it is solved to `tolerance`: larger ones, and piles, to `pile_tolerance`."""
        return min(self.loosest["dense_contacts"], self.loosest["pile_contacts"])

    @property
    def loads_once(self) -> bool:
        """Whether loads were solved once, for velocities and positions (`audit.loads_once`)."""
        return loads_once(self.options)

    @property
    def projects(self) -> bool:
        """Whether Moreau-Jean projects positions."""
        return self.method == "moreau" and bool(self.options["position_projection"])

    @property
    def loads_once_within(self) -> bool:
        """The same of the steps that were made: those of `events`, while bodies press one another, are of `nsga`."""
        return loads_once(stepping(self.options))

    @property
    def impact_law(self) -> ImpactLaw:
        """The row of its impact law."""
        return LAWS[self.options["impact"]]

    @property
    def guarded(self) -> bool:
        """Whether impacts cannot add energy (rule R4)."""
        return bool(self.options["energy_safeguard"]) and self.impact_law.energy

    @property
    def has_contacts(self) -> bool:
        """Whether impulses of contacts were recorded."""
        return bool(self.record.contacts)

    @property
    def has_impacts(self) -> bool:
        """Whether the table of impacts was recorded."""
        return self.record.impacts is not False

    @cached_property
    def impact_step(self) -> I64:
        """Steps of the rows of the table of impacts: every block looks there for its own."""
        return np.asarray(self.result.impacts["step"]).astype(np.int64)

    def pairs(self, table: Table, low: int, high: int) -> I64:
        """Bodies (K, 2) of rows of contacts or impacts; what of a mesh is touched is a wall of its own."""
        body = np.asarray(table["body"][low:high]).astype(np.int64).reshape(-1, 2)
        if not self.parts.meshes or "part" not in table.columns:
            return body
        return self.parts.of_rows(body, np.asarray(table["part"][low:high]).astype(np.int64))

    def given(self, b: I64) -> I64:
        """Bodies (K,) with meshes in place of what of them is touched."""
        owner = np.concatenate(
            [np.arange(self.bodies), self.bodies + np.array(self.parts.owner, dtype=np.int64)]
        )
        return np.asarray(owner[b])

    def between(self, time: F64, a: F64, b: F64) -> F64:
        """`a - b` of places (K, 3) at the times (K,), to the nearest image in a periodic world."""
        d = a - b
        return self.box.nearest(time, d) if self.box.any else d

    def image(self, time: F64, b: I64, x: F64, y: F64) -> F64 | None:
        """(K, 3) of which image of bodies `b` those at the places `x` are nearest, at the times (K,), where `b` are at `y`:
        none away of walls. None where images do not move.
        """
        if not self.box.deforms:
            return None
        return np.where((b < self.balls)[:, None], self.box.away(time, x - y), 0.0)

    def on_walls(self, b: I64) -> Iterator[tuple[int, I64]]:
        """Numbers of the walls that are among bodies (K,), and the rows of each."""
        rows = np.flatnonzero(b >= self.bodies)
        of = b[rows] - self.bodies
        order = np.argsort(of, kind="stable")
        found, first = np.unique(of[order], return_index=True)
        yield from zip(found.tolist(), np.split(rows[order], first[1:]), strict=False)

    def meet(self, time: F64, a: I64, b: I64, x: F64, y: F64) -> tuple[F64, F64]:
        """Gap (K,) and normal (K, 3) from B to A at the times (K,): `x` places of A, `y` of B
        (displacements of free walls, unused at others).
        """
        d = self.between(time, x, y)
        distance = norm(d)
        other = self.reach[np.minimum(b, self.bodies)]
        gap = distance - self.radius[a] - other
        normal = direction(d, UP)
        for w, rows in self.on_walls(b):
            gap[rows], normal[rows] = self.walls[w].meet(time[rows], x[rows], self.radius[a[rows]])
        for w, free in enumerate(self.free_walls):
            rows = np.flatnonzero(b == self.balls + w)
            gap[rows], normal[rows] = free.meet(x[rows], y[rows], self.radius[a[rows]])
        return gap, normal

    def frame_place(self, frame: int, *bodies: int) -> Place:
        """A place at a frame."""
        who = tuple(self.names[b] if 0 <= b < len(self.names) else f"body {b}" for b in bodies)
        return Place(int(frame), int(self.step[frame]), float(self.time[frame]), who)

    def step_place(self, step: int, *bodies: int) -> Place:
        """A place at a step, with the first frame that follows it."""
        frame = int(np.searchsorted(self.step, step))
        who = tuple(self.names[b] if 0 <= b < len(self.names) else f"body {b}" for b in bodies)
        return Place(min(frame, self.frames - 1), int(step), float(step * self.h), who)

    @cached_property
    def linked(self) -> I64:
        """(N,) a body for each, the same for all that joints and dampers link: impulses go through these at once."""
        return self.joined(
            [load for load in self.loads if load["kind"] == "spring" and load["damping"] > 0.0]
        )

    def joined(self, loads: list[Any]) -> I64:
        """(N,) a body for each, the same for all that joints, clumps and these loads, if between two, link."""
        links = [
            (one["a"], one["b"])
            for one in (*self.joints, *loads)
            if min(one.get("a", -1), one.get("b", -1)) >= 0
        ]
        links += list(zip(self.clumps.first[self.clumps.of], self.clumps.balls, strict=True))
        return connected(self.bodies, *np.array(links, dtype=np.int64).reshape(-1, 2).T)

    @cached_property
    def held_apart(self) -> HeldApart:
        """Pairs of balls that joints, or a clump of both, keep from meeting."""
        return held_apart(self.joints, self.radius[: self.balls], self.clump_of[: self.balls])

    @cached_property
    def jointed(self) -> Bool:
        """(N,) balls with a joint, and of clumps with one."""
        found = np.zeros(self.bodies + 1, dtype=bool)
        found[[body for joint in self.joints for body in (joint["a"], joint["b"])]] = (
            True  # the ground is last
        )
        return np.asarray(found[:-1] | self._of_clumps(found[:-1]))

    @cached_property
    def answering(self) -> Bool:
        """(N,) bodies with a joint, or with loads that depend on the motion: these answer within an impact problem."""
        found = np.zeros(self.bodies, dtype=bool)
        loads = [one for one in self.loads if one["kind"] not in ("force", "cohesion")]
        for one in (*self.joints, *loads):
            mine = [int(one[key]) for key in ("a", "b", "body") if key in one]
            found[[body for body in mine if body >= 0]] = True
            found |= not mine  # a function may act on all
        return np.asarray(found | self._of_clumps(found))

    def _of_clumps(self, chosen: Bool) -> Bool:
        """(N,) balls of clumps of which one is among the `chosen` (N,)."""
        found = np.zeros(self.bodies, dtype=bool)
        found[self.clumps.balls] = self.clumps.over(np.logical_or, chosen[None])[0][self.clumps.of]
        return found

    @cached_property
    def loaded(self) -> Bool:
        """(N,) those, and bodies with forces of the time alone."""
        found = self.answering.copy()
        found[[load["body"] for load in self.loads if load["kind"] == "force"]] = True
        return np.asarray(found | self._of_clumps(found))

    @cached_property
    def top_speeds(self) -> F64:
        """(N,) largest speed of each body at any frame, m/s; where frames leave out steps at most that of all energy."""
        best = self._fastest(0)
        if len(self.steps["step"]) >= self.frames:
            best = np.maximum(best, np.sqrt(2.0 * self.steps["energy_kinetic"].max(initial=0.0) / self.mass))
        return best

    @cached_property
    def top_speeds_later(self) -> F64:
        """(N,) the same at frames after the start."""
        return self._fastest(1)

    def _fastest(self, begin: int) -> F64:
        best, size = np.zeros(self.bodies), max(1, 1_000_000 // self.bodies)
        for first in range(begin, self.frames, size):
            v = np.nan_to_num(self.state(slice(first, first + size))[1])
            best = np.maximum(best, norm(v).max(axis=0))
        return best

    @cached_property
    def top_wall_speeds(self) -> F64:
        """(W, N) largest speed of each moving wall at the place of each body at any frame, m/s."""
        best = np.zeros((self.given_walls, self.balls))
        size = max(1, 1_000_000 // self.balls)
        for first in range(0, self.frames, size):
            x = np.asarray(self.result.position[first : first + size])
            time = np.repeat(self.time[first : first + size], self.balls)
            for w, wall in enumerate(self.walls[: self.given_walls]):
                if wall.travels:
                    for end in (False, True):
                        speed = np.nan_to_num(norm(wall.velocity(time, x.reshape(-1, 3), end=end)[0]))
                        best[w] = np.maximum(best[w], speed.reshape(-1, self.balls).max(axis=0))
        return best

    def lengths(self, time: F64) -> F64:
        """(K,) m, lengths whose roundings places of images and of moving walls have: of walls, whose laws know times to
        a rounding, their way at their largest speed."""
        return np.asarray(self.box.rounding(time) + np.abs(time) * self.top_wall_speeds.max(initial=0.0))

    @cached_property
    def cut(self) -> Bool:
        """(S,) steps that were made in parts: halved for convergence, or cut for travel."""
        parts = np.zeros(len(self.steps["step"])) if self.method == "penalty" else self.steps["substeps"]
        return np.asarray((self.steps["halvings"] > 0) | (parts > 0))

    @property
    def divides(self) -> bool:
        """Whether the method divides steps by itself: then no step is one whole."""
        return self.method in ("penalty", "events")

    def ends(self, problem: Array) -> Bool:
        """Whether an impact problem of this number ends a sequence that was cut."""
        return np.asarray(problem > (self.options["max_problems"] or MOST_PROBLEMS))


def read(path: str | Path) -> Run:
    """Open a run directory, also one that did not reach its end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnfinishedRun)
        result = load(path)
    assert isinstance(result._segments, Segments)  # of files
    result._segments.of_this_layout()
    return Run(result)


def _walls(model: dict[str, Any]) -> list[Surface]:
    motions = {int(k): motion for k, motion in model.get("wall_motion", ())}
    planes = zip(model["plane_point"], model["plane_normal"], model["plane_material"], strict=True)
    shapes = [(("plane", normal), point, material) for point, normal, material in planes]
    shapes += [(w["shape"], w["point"], w["material"]) for w in model.get("walls", ())]
    for mesh in model.get("meshes", ()):
        made = Triangles(mesh["vertices"], np.asarray(mesh["triangles"]))
        shapes.append((("mesh", made), mesh["point"], mesh["material"]))
    return [Surface(s, p, int(m), motions.get(k)) for k, (s, p, m) in enumerate(shapes)]
