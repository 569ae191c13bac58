"""Velocity level: the sequence of impact problems of one island (sections 5 and 7 of the specification; eqs. 24-29).

Three laws: `sequence` (load offset in stage 0, rules R2-R4), `sequence-paper` (the paper as printed) and
`one-shot` (one simultaneous problem with Newton's law).
"""

import itertools
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from .contact import Impulse, to_world
from .island import Island as Island
from .island import connected
from .model import F64
from .newton import solve

ENERGY_SLACK = 1e-10
"""A problem may produce this fraction of the kinetic energy of its bodies (rule R4)."""
PROBLEMS_PER_CONTACT = 200
"""Contacts that the problems of a sequence may solve for each contact of the island, where `max_problems` is 0."""
BISECTIONS = 12
BISECTIONS_JOINTS = 30
"""In islands with joints a gain of 1e-9 of the energy may be only the turn of a rod: it must not take 2e-4 off e."""


@dataclass
class ImpactProblem:
    """Record of one problem: its stage ('0', '1', ..., 'one-shot', 'truncated'), members, impulses."""

    island: tuple[int, ...]
    """Spheres of the island."""
    stage: str
    members: list[tuple[int, int]]
    impulses: dict[tuple[int, int], Impulse]
    iterations: int
    history: list[float]
    fallback: str
    scale: float
    """Smallest factor the energy safeguard put on a restitution of this problem; 1 if it did nothing."""
    work: float
    """Kinetic energy gained in this problem [J], 1/2 sum lambda.(gamma^- + gamma^+)."""


@dataclass
class IslandResult:
    """Velocity jump and total impulses of an island, with the problems that led there."""

    jump: F64
    """W (d,) [m/s, rad/s]."""
    multipliers: F64
    """Sum over the problems that count, (m,) [N s, N s m]; of the joints their totals."""
    problems: list[ImpactProblem] = field(default_factory=list)
    truncated: bool = False
    tolerance: float | None = None
    """Closing tolerance [m/s], None where there was nothing to solve."""


@dataclass
class _Solved:
    multipliers: F64
    """Of the members, (m,)."""
    jump: F64
    """Of these and the fixed impulses, (d,)."""
    iterations: int
    history: list[float]
    fallback: str


def _solve_members(island: Island, members: list[int], offset: F64, fixed: F64, what: str) -> _Solved:
    """Solve the contacts `members` and all joints; `fixed` (m,) are the impulses of contacts that already act."""
    problem, columns, rows = island.problem(members, offset, fixed)
    found = solve(problem, island.jump(fixed)[columns], island.model.options, what)
    multipliers = np.zeros(island.layout.rows)
    multipliers[rows] = found.multipliers
    multipliers[island.layout.joint_rows] = 0.0
    jump = island.jump(fixed + multipliers)
    return _Solved(multipliers, jump, found.iterations, found.history, found.fallback)


def _gain(island: Island, contacts: list[int], solved: _Solved, before: F64) -> float:
    """w of rule R4 over some contacts [J]; `before` (d,) the jump of the fixed impulses.

    Both velocities satisfy the joints: those that prescribe nothing do no work, and that of the others is no gain.
    """
    mean = 0.5 * (before + solved.jump) + island.u_check
    work = solved.multipliers * (island.gradient @ mean)
    return float(sum(np.sum(work[island.layout.slices[i]]) for i in contacts))


def _pushing_islands(
    island: Island, members: list[int], solved: _Solved
) -> list[tuple[list[int], list[int]]]:
    """Contacts with impulse that hang together, also through joints; and the spheres of each group."""
    pushing = [i for i in members if solved.multipliers[island.layout.start[i]] > 0.0]
    links = [row.bodies for row in island.layout.joints]
    sets = [island.elements[i].pair.bodies for i in pushing] + links
    result = []
    for group in connected(sets):
        contacts = [pushing[k] for k in group if k < len(pushing)]
        if contacts:
            result.append((contacts, sorted({body for k in group for body in sets[k]})))
    return result


def impact_problem(
    island: Island,
    members: list[int],
    fixed: F64,
    u_minus: F64 | None,
    tolerance: float,
    stage: str,
    paper: bool = False,
) -> tuple[F64, ImpactProblem]:
    """One problem with members C: its impulses (m,), and a record. `u_minus` (d,) is V^-, None for e = 0."""
    what = f"impact problem, stage {stage}, spheres {island.layout.bodies}"
    scale = np.ones(len(island.elements))

    def at(factors: F64) -> _Solved:
        offset = island.plastic if u_minus is None else island.offset(u_minus, factors, tolerance, paper)
        return _solve_members(island, members, offset, fixed, what)

    solved = at(scale)
    before = island.jump(fixed)
    if u_minus is not None and not paper and island.model.options.energy_safeguard:
        energy = 0.5 * island.layout.mass * (island.u_check + before) ** 2
        # scaling one group may let a contact between two groups push: look again until no group gains
        for _ in range(len(members)):
            gaining = []
            for group, bodies in _pushing_islands(island, members, solved):
                own = np.isin(island.layout.dofs // 6, bodies)
                bound = ENERGY_SLACK * float(np.sum(energy[own]))
                if _gain(island, group, solved, before) > bound:
                    gaining.append((group, bound))
            if not gaining:
                break
            for group, bound in gaining:
                low, high = 0.0, 1.0
                joined = island.bonds is not None and bool(island.bonds.group.joints)
                for _ in range(BISECTIONS_JOINTS if joined else BISECTIONS):
                    trial = scale.copy()
                    trial[group] *= 0.5 * (low + high)
                    if _gain(island, group, at(trial), before) <= bound:
                        low = 0.5 * (low + high)
                    else:
                        high = 0.5 * (low + high)
                scale[group] *= low
            solved = at(scale)
    record = ImpactProblem(
        island=tuple(island.layout.bodies),
        stage=stage,
        members=[island.elements[i].pair.key for i in members],
        impulses={
            island.elements[i].pair.key: to_world(
                island.elements[i], solved.multipliers[island.layout.slices[i]]
            )
            for i in members
        },
        iterations=solved.iterations,
        history=solved.history,
        fallback=solved.fallback,
        scale=float(np.min(scale)),
        work=_gain(island, members, solved, before),
    )
    return solved.multipliers, record


class ProblemSolver(Protocol):
    """What `solve_island` calls for each problem: `impact_problem`, or a judge of impulses found elsewhere."""

    def __call__(
        self,
        island: Island,
        members: list[int],
        fixed: F64,
        u_minus: F64 | None,
        tolerance: float,
        stage: str,
        paper: bool = False,
    ) -> tuple[F64, ImpactProblem]: ...


def solve_island(island: Island, impact_problem: ProblemSolver = impact_problem) -> IslandResult:
    """All impact problems of one island by the law that the options name."""
    result = IslandResult(island.start, island.start_multipliers)
    impulses = np.zeros(island.layout.rows)
    tolerance = result.tolerance = island.closing_tolerance()
    if tolerance is not None and island.elements:
        if island.model.options.impact == "one-shot":
            everything = list(range(len(island.elements)))
            impulses, record = impact_problem(island, everything, impulses, island.u_n, tolerance, "one-shot")
            result.problems.append(record)
        else:
            impulses = _sequence(island, impact_problem, tolerance, result)
    if np.any(impulses):
        result.jump, result.multipliers = island.respond(impulses)
    return result


def _sequence(island: Island, impact_problem: ProblemSolver, tolerance: float, result: IslandResult) -> F64:
    """The problems of `sequence` and `sequence-paper`, put into `result`; the impulses of all contacts (m,)."""
    paper = island.model.options.impact == "sequence-paper"
    impulses = np.zeros(island.layout.rows)
    offset_jump = island.start
    loaded: set[int] = set()
    if not paper:
        resting = np.flatnonzero(island.normal_velocity(island.u_n) >= -tolerance).tolist()
        closing = island.normal_velocity(island.u_check + island.start) < -tolerance
        loaded = {i for i in resting if closing[i]}
        if loaded:
            impulses, record = impact_problem(island, resting, impulses, None, tolerance, "0")
            result.problems.append(record)
            offset_jump = island.jump(impulses)

    jump = offset_jump
    most, solved = island.model.options.max_problems, 0
    for number in itertools.count(1):
        members = set(np.flatnonzero(island.normal_velocity(island.u_check + jump) < -tolerance).tolist())
        if not members:
            break
        solved += len(members) if number > 1 or paper else 0
        if (number > most) if most else (solved > PROBLEMS_PER_CONTACT * len(island.elements)):
            # the sequence does not end: one problem that leaves nothing approaching and cannot gain energy
            everything = list(range(len(island.elements)))
            added, record = impact_problem(island, everything, impulses, None, tolerance, "truncated")
            result.truncated = True
            result.problems.append(record)
            return impulses + added
        if number == 1:
            members |= loaded
            for i in members:
                impulses[island.layout.slices[i]] = 0.0
        u_minus = island.u_n + jump - offset_jump if number > 1 else island.u_n
        added, record = impact_problem(
            island, sorted(members), impulses, u_minus, tolerance, str(number), paper=paper
        )
        impulses = impulses + added
        result.problems.append(record)
        jump = island.jump(impulses)
    return impulses
