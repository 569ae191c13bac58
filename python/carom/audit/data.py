"""A run as the auditor reads it: the files through `carom.load`, the scenario as arrays, frames in blocks of intervals.

Nothing here computes physics. An *interval* is what lies between two neighbouring frames: the state at both ends, and what
`/contacts`, `/impacts` and `/steps` recorded in between.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from carom.audit.formula import law
from carom.audit.report import Place
from carom.audit.surfaces import Surface
from numpy.typing import NDArray

if TYPE_CHECKING:
    from carom.result import Result

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

#: Numbers that a block holds of one frame column at most.
BLOCK = 200_000

NAMES = ("friction", "restitution", "tangential_restitution", "rolling_radius", "spinning_radius")


def zeros(form: Any) -> F64:
    """A stand-in for a Python load function, which no file can hold."""
    raise AssertionError("a load function is never called by the auditor")


class Run:
    """What a run left behind, as arrays in SI units. N bodies, T frames, S steps."""

    def __init__(self, result: Result) -> None:
        from carom.scene import Scene

        self.result = result
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
        self.radius: F64 = result.bodies["radius"]
        self.mass: F64 = result.bodies["mass"]
        self.inertia: F64 = result.bodies["inertia"]
        self.material = np.asarray(result.bodies["material"]).astype(np.int64)
        self.gravity: F64 = result.gravity
        self.period: F64 | None = result.periodic
        self.names = [*result.names, *result.wall_names]
        self.bodies = len(self.radius)
        self.walls = _walls(self.model)
        self.joints: list[Any] = list(self.model.get("joints", ()))
        self.loads: list[Any] = list(self.model.get("loads", ()))
        self.time = np.asarray(result.time)
        self.step = np.asarray(result.step).astype(np.int64)
        self.frames = len(self.time)
        self.steps = {name: np.asarray(result.steps[name]) for name in result.steps.columns}

    @cached_property
    def loosest(self) -> dict[str, float]:
        """Each tolerance at its loosest: `carom resume --set` may have changed it within the run."""
        names = ("tolerance", "pile_tolerance", "gap_tolerance", "touching_tolerance", "tolerance_floor")
        found = {name: float(self.options[name]) for name in names}
        for change in self.result._about.get("changes", ()):
            for name, value in {**change, **change.get("options", {})}.items():
                if name in found:
                    found[name] = max(found[name], float(value))
        return found

    @cached_property
    def law_of(self) -> I64:
        """Number of the contact law of two materials, (M, M), -1 where there is none."""
        a, b = self.model["law_a"], self.model["law_b"]
        most = 1 + max([*a, *b, *self.material, *(w.material for w in self.walls)], default=0)
        found = np.full((most, most), -1, dtype=np.int64)
        found[a, b] = found[b, a] = np.arange(len(a))
        return found

    def law_index(self, a: I64, b: I64) -> I64:
        """Laws of the pairs of bodies a and b (walls from N on)."""
        of_walls = np.array([w.material for w in self.walls], dtype=np.int64)
        material = np.concatenate([self.material, of_walls])
        return np.asarray(self.law_of[material[a], material[b]])

    def coefficient(self, name: str, index: I64) -> F64:
        """A column of the contact laws."""
        return np.asarray(np.asarray(self.model[name], dtype=np.float64)[index])

    def friction(self, index: I64, slip: F64) -> F64:
        """mu at the slip speed of the start of the step, m/s; without a law of it the constant."""
        mu = self.coefficient("friction", index)
        for k, form in enumerate(self.model.get("friction_law") or ()):
            if form is not None:
                mine = index == k
                mu[mine] = law(form, slip[mine])[0]
        return mu

    @property
    def friction_varies(self) -> bool:
        """Whether any friction is a law of the slip speed."""
        return any(form is not None for form in self.model.get("friction_law") or ())

    @property
    def has_contacts(self) -> bool:
        """Whether impulses of contacts were recorded."""
        return bool(self.record.contacts)

    @property
    def has_impacts(self) -> bool:
        """Whether the table of impacts was recorded."""
        return self.record.impacts is not False

    def between(self, a: F64, b: F64) -> F64:
        """`a - b` of places (K, 3), to the nearest image in a periodic world."""
        d = a - b
        if self.period is None:
            return d
        length = np.where(self.period > 0, self.period, 1.0)
        return np.asarray(d - np.where(self.period > 0, self.period, 0.0) * np.rint(d / length))

    def meet(self, time: F64, a: I64, b: I64, x: F64, y: F64) -> tuple[F64, F64]:
        """Gap (K,) and normal (K, 3) from B to A at the times (K,): `x` places of A, `y` of B (unused at walls)."""
        d = self.between(x, y)
        distance = np.sqrt((d * d).sum(axis=1))
        other = np.append(self.radius, 0.0)[np.minimum(b, self.bodies)]
        gap = distance - self.radius[a] - other
        normal = np.divide(d, distance[:, None], out=np.zeros_like(d), where=distance[:, None] > 0)
        for k in np.unique(b[b >= self.bodies]):
            rows = b == k
            gap[rows], normal[rows] = self.walls[k - self.bodies].meet(time[rows], x[rows], self.radius[a[rows]])
        return gap, normal

    def blocks(self) -> Iterator[Block]:
        """All intervals, in blocks."""
        size = max(1, min(2000, BLOCK // (3 * self.bodies), 2_000_000 // self.bodies**2 or 1))
        for first in range(1, self.frames, size):
            yield Block(self, first, min(self.frames, first + size))

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
    def cut(self) -> NDArray[np.bool_]:
        """(S,) steps that were made in parts: halved for convergence, or cut for travel."""
        parts = np.zeros(len(self.steps["step"])) if self.method == "penalty" else self.steps["substeps"]
        return np.asarray((self.steps["halvings"] > 0) | (parts > 0))

    def over(self, column: F64, block: Block) -> F64:
        """Largest value of a column of the steps in each interval of a block, (B,)."""
        ends = np.clip(np.stack([block.s0, block.s1]), 0, len(column))
        return np.array([column[i:j].max(initial=0) for i, j in ends.T], dtype=np.float64)

    def total(self, column: F64, block: Block) -> F64:
        """Sum of a column of the steps over each interval of a block, (B,)."""
        sums = np.concatenate([[0.0], np.cumsum(column)])
        # Differences of running sums would carry their rounding into quiet intervals.
        ends = np.clip(np.stack([block.s0, block.s1]), 0, len(column))
        if len(sums) > 1 and (ends[1] - ends[0] == 1).all():
            return np.asarray(column[ends[0]], dtype=np.float64)
        return np.array([column[i:j].sum() for i, j in ends.T], dtype=np.float64)


@dataclass(frozen=True)
class Rows:
    """Contacts of a block, K rows: interval `k`, bodies, and what was recorded of them."""

    k: I64
    a: I64
    b: I64
    normal: F64
    gap: F64
    impulse: F64
    moment: F64
    position_impulse: F64
    position_moment: F64
    work: F64
    """Normal, sliding, rolling, spinning: (K, 4), J."""

    def __len__(self) -> int:
        return len(self.k)


class Block:
    """Intervals `first - 1 -> first` to `end - 2 -> end - 1` of the frames: B of them."""

    def __init__(self, run: Run, first: int, end: int) -> None:
        self.run = run
        self.first = first
        self.count = end - first
        r, rows = run.result, slice(first - 1, end)
        x, v, w, q = (
            np.asarray(c[rows]) for c in (r.position, r.velocity, r.angular_velocity, r.orientation)
        )
        self.x0, self.v0, self.w0, self.q0 = x[:-1], v[:-1], w[:-1], q[:-1]
        self.x1, self.v1, self.w1, self.q1 = x[1:], v[1:], w[1:], q[1:]
        self.t0, self.t1 = run.time[rows][:-1], run.time[rows][1:]
        self.s0, self.s1 = run.step[rows][:-1], run.step[rows][1:]
        self.n = self.s1 - self.s0
        """Steps of each interval."""
        self.dt = self.n * run.h
        present = np.asarray(r.present[rows])
        self.there = present[:-1] & present[1:]
        """(B, N) bodies that were there all the time."""
        self._leave_out_events()
        self.cut = run.over(run.cut, self) > 0
        """(B,) intervals with a step in parts."""
        self.single = (self.n == 1) & ~self.cut & (run.method != "penalty")
        """(B,) intervals of one whole step: there all laws can be judged exactly."""
        self.updates = self.n + run.total(run.steps["substeps"] + run.steps["halvings"], self)
        """(B,) how often the state was written."""

    def _leave_out_events(self) -> None:
        events = self.run.result.events
        if not len(events):
            return
        step, body = np.asarray(events["step"]).astype(np.int64), np.asarray(events["body"]).astype(np.int64)
        k = np.searchsorted(self.s1, step)
        here = (k < self.count) & (step > self.s0[np.minimum(k, self.count - 1)])
        self.there[k[here], body[here]] = False

    def place(self, k: int, *bodies: int) -> Place:
        """A place at the end of an interval."""
        return self.run.frame_place(self.first + k, *bodies)

    def per_body(self, flat: int) -> Place:
        """The place of an entry of a (B, N) array."""
        k, body = divmod(flat, self.run.bodies)
        return self.place(k, body)

    @cached_property
    def kept(self) -> NDArray[np.bool_]:
        """(B,) whether the impulses of contacts and joints of the interval are whole: the last frame of a run that did not
        reach its end is the bare state.
        """
        run = self.run
        if run.result.status == "done":
            return np.ones(self.count, dtype=bool)
        every = run.result._segments.attributes["every"]
        return np.asarray(self.s1 % int(every) == 0)

    @cached_property
    def centres(self) -> F64:
        """(B, N, 3) where the velocity level of the last step has the centres, for the velocity of walls: those of the frame;
        Moreau-Jean takes the end of the smooth motion.
        """
        run = self.run
        if run.method != "moreau" or not any(wall.moves for wall in run.walls):
            return self.x1
        from carom.audit.forces import of_loads

        theta, dt = float(run.options["theta"]), self.dt[:, None, None]
        gained = of_loads(self).impulse[..., :3] / run.mass[:, None] + dt * run.gravity
        return np.asarray(self.x0 + dt * (self.v0 + theta * gained))

    @cached_property
    def rows(self) -> Rows:
        """The contacts that were recorded in these intervals."""
        run = self.run
        ends = np.asarray(run.result._segments.column("frames", "contact_end")[self.first - 1 : self.first + self.count])
        ends = ends.astype(np.int64)
        table = run.result.contacts
        low, high = int(ends[0]), int(ends[-1])

        def column(name: str) -> Any:
            return np.asarray(table[name][low:high])

        body = column("body").astype(np.int64).reshape(-1, 2)
        k = np.searchsorted(ends[1:], np.arange(low, high), side="right")
        work = np.stack([column(f"work_{c}") for c in ("normal", "friction", "rolling", "spinning")], axis=1)
        vectors = (column(c) for c in ("impulse", "moment", "position_impulse", "position_moment"))
        return Rows(k, body[:, 0], body[:, 1], column("normal"), column("gap"), *vectors, work)

    @cached_property
    def start(self) -> tuple[F64, F64]:
        """Gap and normal of the recorded contacts at the first frame of their interval."""
        return self._meet(self.x0, self.t0)

    @cached_property
    def end(self) -> tuple[F64, F64]:
        """The same at the second."""
        return self._meet(self.x1, self.t1)

    def _meet(self, x: F64, time: F64) -> tuple[F64, F64]:
        c = self.rows
        other = np.minimum(c.b, self.run.bodies - 1)
        return self.run.meet(time[c.k], c.a, c.b, x[c.k, c.a], x[c.k, other])

    @cached_property
    def large(self) -> NDArray[np.bool_]:
        """(B,) intervals in which an island may have had more than `dense_contacts` contacts."""
        return np.asarray(self.run.over(self.run.steps["candidates"], self) > self.run.options["dense_contacts"])

    @cached_property
    def piled(self) -> NDArray[np.bool_]:
        """(B,) intervals in which an island may have been solved as a pile."""
        o = self.run.options
        many = self.run.over(self.run.steps["candidates"], self)
        least = o["dense_contacts"] if o["pile_tolerance"] >= 1e-5 else o["pile_contacts"]
        return np.asarray(many > least)

    @cached_property
    def tolerance(self) -> F64:
        """(B,) tol_r of eq. 44 as it held in each interval."""
        t = self.run.loosest
        return np.where(self.large, max(t["tolerance"], t["pile_tolerance"]), t["tolerance"])

    def left(self, size: F64) -> F64:
        """(B,) what a solver may leave of multipliers `size` (K,) of the contacts: tol_r times the sum of the four norms of
        eq. 44 (inertia, contact, constraint and multiplier rows), each the root of the sum of the squares of all contacts.
        """
        squares = np.bincount(self.rows.k, size * size, minlength=self.count)
        return np.asarray(4.0 * self.tolerance * np.sqrt(squares))


def read(path: str | Path) -> Run:
    """Open a run directory, also one that did not reach its end."""
    from carom.result import UnfinishedRun, load

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnfinishedRun)
        return Run(load(path))


def _walls(model: dict[str, Any]) -> list[Surface]:
    motions = {int(k): motion for k, motion in model.get("wall_motion", ())}
    planes = zip(model["plane_point"], model["plane_normal"], model["plane_material"], strict=True)
    shapes = [(("plane", normal), point, material) for point, normal, material in planes]
    shapes += [(w["shape"], w["point"], w["material"]) for w in model.get("walls", ())]
    return [Surface(s, p, int(m), motions.get(k)) for k, (s, p, m) in enumerate(shapes)]
