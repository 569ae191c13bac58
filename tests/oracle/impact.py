"""Velocity level: the sequence of impact problems of one island (sections 5 and 7 of the specification; eqs. 24-29).

`sequence` (load offset in stage 0, rules R2-R4), `sequence-paper` (the paper as printed), `one-shot` (one simultaneous
problem with Newton's law), `poisson` (compression, then expansion) `compliant` and `binary`
(stiff springs).
"""

import itertools
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from .compliant import spring_impulses
from .contact import Impulse, to_world
from .island import SPRINGS, connected
from .island import Island as Island
from .model import F64
from .newton import solve

ENERGY_SLACK = 1e-10
"""A problem may produce this fraction of the kinetic energy of its bodies (rule R4)."""
PROBLEMS_PER_CONTACT = 200
"""Contacts that the problems of a sequence may solve for each contact of the island, where `max_problems` is 0."""


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
    """Smallest s of rule R4, from no restitution (0) to all of it (1)."""
    work: float
    """Kinetic energy gained in this problem [J], 1/2 sum of impulses times (gamma^- + gamma^+), against those before it."""


@dataclass
class IslandResult:
    """Velocity jump and total impulses of an island, with the problems that led there."""

    jump: F64
    """W (d,) [m/s, rad/s]."""
    multipliers: F64
    """Sum over the problems that count, (m,) [N s, N s m]; of the joints their totals."""
    problems: list[ImpactProblem] = field(default_factory=list)
    truncated: bool = False
    tolerance: F64 | None = None
    """Closing tolerance of each contact [m/s], None where there was nothing to solve."""


@dataclass
class _Solved:
    multipliers: F64
    """Of the members, (m,)."""
    jump: F64
    """Of these and the fixed impulses, (d,)."""
    iterations: int
    history: list[float]
    fallback: str


def _solve_members(
    island: Island, members: list[int], offset: F64, fixed: F64, what: str, least: F64 | None = None
) -> _Solved:
    """Solve the contacts `members` and all joints; `fixed` (m,) are the impulses of contacts that already act."""
    problem, columns, rows = island.problem(members, offset, fixed)
    if least is not None:
        problem.least = least[members]
    found = solve(problem, island.jump(fixed)[columns], island.model.options, what)
    multipliers = np.zeros(island.layout.rows)
    multipliers[rows] = found.multipliers
    multipliers[island.layout.joint_rows] = 0.0
    jump = island.jump(fixed + multipliers)
    return _Solved(multipliers, jump, found.iterations, found.history, found.fallback)


def _work(island: Island, contacts: list[int], before: F64, first: F64, second: F64) -> float:
    """1/2 first.G (v + second) over the rows of some contacts [J], `v` (d,) twice the velocity that `before` gives.

    `first` (m,) impulses and `second` (d,) a jump, both counted from the impulses `before` (m,). Both velocities satisfy the
    joints: those that prescribe nothing do no work, and that of the others is no gain.
    """
    work = first * (island.gradient @ (island.u_check + island.jump(before) + 0.5 * second))
    return float(sum(np.sum(work[island.layout.slices[i]]) for i in contacts))


def _pushing_islands(
    island: Island, members: list[int], solutions: list[F64]
) -> list[tuple[list[int], list[int]]]:
    """Contacts with impulse in any solution (m,) that hang together, also by joints and loads; the spheres of each group."""
    start = island.layout.start
    pushing = [i for i in members if any(of[start[i]] > 0.0 for of in solutions)]
    links = [row.bodies for row in island.layout.joints]
    joined = (load.joins() for load in island.model.loads)
    links += [bodies for bodies in joined if len(bodies) > 1 and set(bodies) <= set(island.layout.bodies)]
    sets = [island.elements[i].pair.bodies for i in pushing] + links
    result = []
    for group in connected(sets):
        contacts = [pushing[k] for k in group if k < len(pushing)]
        if contacts:
            result.append((contacts, sorted({body for k in group for body in sets[k]})))
    return result


def _returned(island: Island, element: int) -> float:
    """Share of what a contact loses without restitution that Newton's law may give back."""
    law = island.elements[element].pair.law
    slips_back = law.tangential_restitution != 0.0 and island.model.options.impact not in SPRINGS
    return 1.0 if law.restitution_law is not None or slips_back else law.restitution**2


def _limit(
    island: Island,
    members: list[int],
    fixed: F64,
    before: F64,
    plastic: _Solved,
    full: _Solved,
    collective: bool,
) -> tuple[_Solved, F64]:
    """Rule R4: `plastic` + s (`full` - `plastic`) with the largest s per group that gains nothing; s per contact (m,).

    A collective impact gives back at most e^2 of what `plastic` loses, with the largest e of a group.
    """
    base = island.jump(before)
    given = [fixed - before + of.multipliers for of in (plastic, full)]
    change = [of.jump - base for of in (plastic, full)]
    energy = 0.5 * island.layout.mass * (island.u_check + base) ** 2
    scale = np.ones(len(island.elements))
    multipliers = full.multipliers.copy()
    for group, bodies in _pushing_islands(
        island, members, [fixed + plastic.multipliers, fixed + full.multipliers]
    ):
        own = np.isin(island.layout.dofs // 6, bodies)
        lost = _work(island, group, before, given[0], change[0])
        kept = max(_returned(island, i) for i in group) if collective else 1.0
        gained = _work(island, group, before, given[1], change[1]) - (1.0 - kept) * lost
        if gained <= ENERGY_SLACK * float(np.sum(energy[own])):
            continue
        # the work of r0 + s d is c0 + c1 s + c2 s^2, with c0 <= 0: it is known at 0, at 1 and at 1/2
        c0, half, one = (
            _work(
                island,
                group,
                before,
                given[0] + s * (given[1] - given[0]),
                change[0] + s * (change[1] - change[0]),
            )
            for s in (0.0, 0.5, 1.0)
        )
        c2 = 2.0 * (c0 + one - 2.0 * half)
        roots = np.roots([c2, one - c0 - c2, kept * c0])
        s = 0.0 if c0 >= 0.0 else float(np.clip(np.max(roots.real), 0.0, 1.0))
        scale[group] = s
        for i in group:
            rows = island.layout.slices[i]
            multipliers[rows] = (1.0 - s) * plastic.multipliers[rows] + s * full.multipliers[rows]
    mixed = _Solved(
        multipliers,
        island.jump(fixed + multipliers),
        plastic.iterations + full.iterations,
        full.history,
        full.fallback or plastic.fallback,
    )
    return mixed, scale


def impact_problem(
    island: Island,
    members: list[int],
    fixed: F64,
    before: F64,
    u_minus: F64 | None,
    tolerance: F64,
    stage: str,
    paper: bool = False,
    compressed: F64 | None = None,
    known: F64 | None = None,
) -> tuple[F64, ImpactProblem]:
    """One problem with members C: its impulses (m,), and a record. `u_minus` (d,) is V^-, None for e = 0.

    `before` (m,) are all impulses before the problem; of these it solves some anew, and leaves those that are `fixed` (m,).
    With `compressed` (m,) it is the expansion of Poisson's law, and `before` what was before the compression.
    Impulses that are `known` (m,) are those with restitution, which no contact problem gives.
    """
    what = f"impact problem, stage {stage}, spheres {island.layout.bodies}"
    scale = np.ones(len(island.elements))
    offset, least = island.plastic, None
    if compressed is not None:
        least, offset = island.expansion(compressed)
    elif u_minus is not None:
        offset = island.offset(u_minus, tolerance, paper)
    if known is None:
        solved = _solve_members(island, members, offset, fixed, what, least)
    else:
        solved = _Solved(known, island.jump(fixed + known), 0, [], "")
    restores = not (u_minus is None and compressed is None and known is None)
    if restores and not paper and island.model.options.energy_safeguard:
        given, change = fixed - before + solved.multipliers, solved.jump - island.jump(before)
        collective = stage == "truncated"
        if collective or any(_work(island, [i], before, given, change) > 0.0 for i in members):
            plastic = _Solved(np.zeros(island.layout.rows), island.jump(fixed), 0, [], "")
            if compressed is None:
                plastic = _solve_members(island, members, island.plastic, fixed, what)
            solved, scale = _limit(island, members, fixed, before, plastic, solved, collective)
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
        work=_work(
            island,
            members,
            before,
            fixed - before + solved.multipliers,
            solved.jump - island.jump(before),
        ),
    )
    return solved.multipliers, record


class ProblemSolver(Protocol):
    """What `solve_island` calls for each problem: `impact_problem`, or a judge of impulses found elsewhere."""

    def __call__(
        self,
        island: Island,
        members: list[int],
        fixed: F64,
        before: F64,
        u_minus: F64 | None,
        tolerance: F64,
        stage: str,
        paper: bool = False,
        compressed: F64 | None = None,
        known: F64 | None = None,
    ) -> tuple[F64, ImpactProblem]: ...


def solve_island(island: Island, impact_problem: ProblemSolver = impact_problem) -> IslandResult:
    """All impact problems of one island by the law that the options name."""
    result = IslandResult(island.start, island.start_multipliers)
    impulses = np.zeros(island.layout.rows)
    tolerance = result.tolerance = island.closing_tolerance()
    if tolerance is not None and island.elements:
        law = island.model.options.impact
        if law == "one-shot":
            everything = list(range(len(island.elements)))
            impulses, record = impact_problem(
                island, everything, impulses, impulses, island.u_n, tolerance, "one-shot"
            )
            result.problems.append(record)
        elif law == "poisson":
            impulses = _poisson(island, impact_problem, tolerance, result)
        elif law in SPRINGS and (len(island.elements) > 1 or _couples(island)):
            impulses = _binary(island, impact_problem, tolerance, result)
        elif law in ("sequence", "sequence-paper", *SPRINGS):
            impulses = _sequence(island, impact_problem, tolerance, result)
        else:
            raise ValueError(f"impact: {law!r} is not a law of the reference")
    if np.any(impulses):
        result.jump, result.multipliers = island.respond(impulses)
    return result


def _loads(
    island: Island, impact_problem: ProblemSolver, tolerance: F64, result: IslandResult
) -> tuple[F64, set[int]]:
    """Stage 0: the impulses (m,) of the loads, put into `result`, and the resting contacts that they close."""
    impulses = np.zeros(island.layout.rows)
    resting = np.flatnonzero(island.normal_velocity(island.u_n) >= -tolerance).tolist()
    closing = island.normal_velocity(island.u_check + island.start) < -tolerance
    loaded = {i for i in resting if closing[i]}
    if loaded:
        impulses, record = impact_problem(island, resting, impulses, impulses, None, tolerance, "0")
        result.problems.append(record)
    return impulses, loaded


def _poisson(island: Island, impact_problem: ProblemSolver, tolerance: F64, result: IslandResult) -> F64:
    """Loads; then all contacts: compression on top of them, and expansion. The impulses of all contacts (m,)."""
    loads, _ = _loads(island, impact_problem, tolerance, result)
    if not np.any(island.normal_velocity(island.u_check + island.jump(loads)) < -tolerance):
        return loads
    everything = list(range(len(island.elements)))
    compressed = island.compressed()
    added, record = impact_problem(island, everything, loads, loads, None, tolerance, "1")
    impulses = loads + added
    result.problems.append(record)
    if np.any(island.expansion(compressed)[0] > 0.0):
        added, record = impact_problem(
            island, everything, impulses, loads, None, tolerance, "2", compressed=compressed
        )
        impulses = impulses + added
        result.problems.append(record)
    return impulses


def _couples(island: Island) -> bool:
    """Whether a normal impulse at its only contact changes a slip that friction acts on."""
    return bool(island.layout.joint_radius.size) and island.elements[0].slides


def _binary(island: Island, impact_problem: ProblemSolver, tolerance: F64, result: IslandResult) -> F64:
    """Loads; springs; what the loads have closed meanwhile. The impulses of all contacts (m,)."""
    impulses, _ = _loads(island, impact_problem, tolerance, result)
    everything = list(range(len(island.elements)))
    for stage, springs in (("1", True), ("2", False)):
        if not np.any(island.normal_velocity(island.u_check + island.jump(impulses)) < -tolerance):
            break
        known = spring_impulses(island) if springs else None
        added, record = impact_problem(
            island, everything, impulses, impulses, None, tolerance, stage, known=known
        )
        impulses = impulses + added
        result.problems.append(record)
    return impulses


def _sequence(island: Island, impact_problem: ProblemSolver, tolerance: F64, result: IslandResult) -> F64:
    """The problems of `sequence` and `sequence-paper`, put into `result`; the impulses of all contacts (m,)."""
    paper = island.model.options.impact == "sequence-paper"
    impulses = np.zeros(island.layout.rows)
    offset_jump = island.start
    loaded: set[int] = set()
    if not paper:
        impulses, loaded = _loads(island, impact_problem, tolerance, result)
        offset_jump = island.jump(impulses) if loaded else offset_jump

    jump = offset_jump
    most, solved = island.model.options.max_problems, 0
    for number in itertools.count(1):
        members = set(np.flatnonzero(island.normal_velocity(island.u_check + jump) < -tolerance).tolist())
        if not members:
            break
        solved += len(members) if number > 1 or paper else 0
        u_minus = island.u_n + jump - offset_jump if number > 1 else island.u_n
        if (number > most) if most else (solved > PROBLEMS_PER_CONTACT * len(island.elements)):
            # the sequence does not end: one problem with all contacts, after which nothing approaches
            everything = list(range(len(island.elements)))
            added, record = impact_problem(
                island, everything, impulses, impulses, None if paper else u_minus, tolerance, "truncated"
            )
            result.truncated = True
            result.problems.append(record)
            return impulses + added
        before = impulses.copy()
        if number == 1:
            members |= loaded
            for i in members:
                impulses[island.layout.slices[i]] = 0.0
        added, record = impact_problem(
            island, sorted(members), impulses, before, u_minus, tolerance, str(number), paper=paper
        )
        impulses = impulses + added
        result.problems.append(record)
        jump = island.jump(impulses)
    return impulses
