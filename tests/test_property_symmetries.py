"""Symmetries of mechanics on random scenes: turned, mirrored, moved, relabelled, begun later, in other units.

Some hold bit for bit, since no operation of the step tells the scene from its image; the others to the rounding that hits
amplify. `docs/reference/determinism.md` lists which.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import carom
import numpy as np
import pytest
from carom import _core, audit
from hypothesis import settings
from hypothesis import strategies as st
from oracle_scenes import nullity
from physics_scenes import F64
from random_scenes import Case, Run, directions, free_scenes, hold, in_both_tiers, vectors, walled_scenes
from trials import Trials

# Hits multiply a difference by about (way between hits)/r, the solver leaves 1e-12; see the figures in the document.
AGREE = 1e-9
# A difference begins where it is above this share of what is allowed.
ONSET = 0.01
#: Scenes whose motion was not unique.
REDUNDANT: Counter[str] = Counter()

State = tuple[F64, F64, F64]
"""x, v, w of all steps, (S+1, N, 3)."""


def state(run: Run) -> State:
    return run.x, run.v, run.w


def speed(case: Case) -> float:
    """Largest speed of centres and surfaces, that of a fall through the run included, m/s."""
    moving = np.linalg.norm(case.v, axis=1) + case.r * np.linalg.norm(case.w, axis=1)
    return float(moving.max() + 60 * case.step * np.linalg.norm(case.gravity)) or 1.0


def sure(run: Run) -> int:
    """States before the first sequence of impacts that was cut off. It ends by a problem in which contacts are redundant, as
    those of a ball in a corner of three rough walls: its solution need not be unique (docs/theory/algorithm.md, section 6),
    and rounding chooses. `relabelled` found it: velocities then differ by 1e-6 to 1e-4."""
    cut = np.flatnonzero(run.steps["truncated"])
    return int(cut[0]) + 1 if len(cut) else len(run.x)


def agree(case: Case, run: Run, other: State, what: str, bound: float = AGREE) -> None:
    """Positions over the smallest radius, velocities over the fastest speed, as long as the motion is unique."""
    one, until = state(run), sure(run)
    scales = (case.r.min(), speed(case), speed(case) / case.r.min())
    off = np.array(
        [np.abs(a - b)[:until].max(axis=(1, 2)) / scale for a, b, scale in zip(one, other, scales)]
    )
    if off.max() <= bound:
        return
    first = int(np.argmax((off > ONSET * bound).any(axis=0)))
    name = "xvw"[int(off.max(axis=1).argmax())]
    assert is_redundant(case, first), (
        f"{what}: {name} differs by {off.max():.2e}, above {bound:.0e}, from step {first} on, in\n{case.to_toml()}"
    )


def is_redundant(case: Case, step: int) -> bool:
    """Whether loaded contacts of a step have dependent rows, so that forces need not be unique, nor what friction does with
    them: a ball that spins in a groove of three walls creeps along it as these share its load. The auditor judges the run.
    """
    core = _core.Simulation(case.model())
    if step == 0:
        return False
    core.advance(step - 1, 1, True, 1e9)
    block = core.advance(1, 1, True, 1e9)
    if nullity(core, case.model(), block) == 0:
        return False
    REDUNDANT[case.to_toml()] += 1
    scene = carom.Scene.from_toml(case.to_toml())
    return audit.check(carom.simulate(scene, every=1, contacts=True, impacts="every")).ok


def same_bits(case: Case, one: State, other: State, what: str) -> None:
    """Zeros of either sign are the same number."""
    for name, a, b in zip("xvw", one, other):
        assert np.array_equal(a, b), f"{what}: {name} has other bits in\n{case.to_toml()}"


def back(run: Run, q: F64) -> State:
    """The motion of a scene turned by `q`, turned back."""
    return run.x @ q, run.v @ q, np.linalg.det(q) * run.w @ q


def rotations() -> st.SearchStrategy[F64]:
    """Proper rotations and such that mirror: reflections in two planes, and in one."""

    def reflect(n: F64) -> F64:
        return np.asarray(np.eye(3) - 2 * np.outer(n, n))

    one = directions().map(reflect)
    return one | st.tuples(one, one).map(lambda two: two[0] @ two[1])


# ------------------------------------------------------------------------------------------------------- space


def turned(case: Case, q: F64) -> None:
    agree(case, case.run(), back(case.turned(q).run(), q), "turned or mirrored")


def mirrored_in_x_or_y(case: Case) -> None:
    """Tangents are found by a rule in which x and y may change sign, so these mirrors leave every bit."""
    one = state(case.run())
    for signs in ((-1, 1, 1), (1, -1, 1), (-1, -1, 1)):
        q = np.diag(np.array(signs, dtype=float))
        same_bits(case, one, back(case.turned(q).run(), q), f"signs {signs}")


def elsewhere(case: Case, shift: F64) -> None:
    """Rounding of positions then is that of larger numbers."""
    run = replace(case, x=case.x + shift, point=case.point + shift).run()
    agree(case, case.run(), (run.x - shift, run.v, run.w), "moved")


# ----------------------------------------------------------------------------------------------- moving observers


def observed_in_motion(case: Case, shift: F64, bound: float = AGREE, **options: Any) -> None:
    case = case.with_options(**options)
    still, moving = case.run(), replace(case, v=case.v + shift).run()
    way = case.step * np.arange(len(still.x))[:, None, None] * shift
    agree(case, still, (moving.x - way, moving.v - shift, moving.w), "Galilean shift", bound)


def galilean(case: Case, shift: F64) -> None:
    """Exact in the law: with no closing tolerance, nothing knows of absolute velocities."""
    observed_in_motion(case, shift, closing_tolerance_speed=1e-13)


def galilean_by_default(case: Case, shift: F64) -> None:
    """Contacts that close by less than 1e-6 of the fastest absolute speed are left to the next step (rule R3): what a
    scene does may differ by as much, and hits pass it on."""
    fastest = speed(case) + float(np.linalg.norm(shift))
    observed_in_motion(case, shift, bound=1e-6 * 100 * fastest / speed(case))


# -------------------------------------------------------------------------------------------------------- time


def begun_later(case: Case, first: int) -> None:
    """From the state of any step: what else a step hands on (`a_n`, accelerations) follows from loads alone while these
    are constant. Without gravity it is zero and the bits are the same."""
    whole = case.run()
    rest = replace(case, x=whole.x[first], v=whole.v[first], w=whole.w[first]).run(60 - first)
    tail = (whole.x[first:], whole.v[first:], whole.w[first:])
    if case.gravity.any():
        agree(case, rest, tail, f"begun at step {first}")
    else:
        same_bits(case, tail, state(rest), f"begun at step {first}")


# ------------------------------------------------------------------------------------------------------- labels


def relabelled(case: Case, order: list[int]) -> None:
    """Who is A and who is B, and the order of the rows in each problem, follow from the indices: rounding differs."""
    permutation = np.array([k for k in order if k < len(case.r)])
    run, inverse = case.ordered(permutation).run(), np.argsort(permutation)
    agree(case, case.run(), (run.x[:, inverse], run.v[:, inverse], run.w[:, inverse]), "relabelled")


def groups_apart(cases: list[Case], order: list[int]) -> None:
    """Groups of balls far from each other: each moves as it does alone, bit for bit, wherever its balls stand in the list
    of balls, as long as they stand in the same order."""
    law = cases[0].law
    groups = [
        replace(c, x=c.x + np.array([16.0 * k, 0, 0]), law=law, wall_law=law, gravity=cases[0].gravity)
        for k, c in enumerate(cases)
    ]
    owner = np.concatenate([np.full(len(c.r), k) for k, c in enumerate(groups)])
    together = replace(
        groups[0], **{k: np.concatenate([getattr(c, k) for c in groups]) for k in ("x", "v", "w", "r", "m", "kappa")}
    )  # fmt: skip
    # Balls of the groups are dealt out like cards: those of a group keep their order.
    ranks = np.array(order[: len(owner)])
    places = np.empty(len(owner), dtype=int)
    for k in range(len(groups)):
        places[owner == k] = np.sort(ranks[owner == k])
    dealt = np.argsort(places)
    run = together.ordered(dealt).run()
    for k, case in enumerate(groups):
        mine = owner[dealt] == k
        alone = state(case.run())
        same_bits(together, alone, (run.x[:, mine], run.v[:, mine], run.w[:, mine]), f"group {k}")


# -------------------------------------------------------------------------------------------------------- units


def unscaled(case: Case, length: float, mass: float, time: float) -> State:
    run = case.scaled(length, mass, time).run()
    return run.x / length, run.v / (length / time), run.w * time


def in_any_units(case: Case, powers: tuple[int, int, int]) -> None:
    length, mass, time = (3.0 ** (0.25 * k) for k in powers)
    agree(case, case.run(), unscaled(case, length, mass, time), f"units {powers}")


def same_in_binary(case: Case, other: State, what: str) -> None:
    """The solvers of islands of more than 10 contacts take the best of their iterates by a residual that compares impulses
    with velocities, in the units given: units may choose another one within the tolerance."""
    run = case.run()
    if run.steps["candidates"].max() <= 10:
        same_bits(case, state(run), other, what)
    else:
        agree(case, run, other, what)


def in_binary_units(case: Case, mass: int, time: int) -> None:
    """Such a change rounds nothing, and no number of the program has a unit of mass or of time. Powers of four for
    masses, since factorisations take roots of them."""
    same_in_binary(case, unscaled(case, 1.0, 4.0**mass, 2.0**time), f"mass 4^{mass}, time 2^{time}")


def in_binary_lengths(case: Case, length: int, mass: int, time: int) -> None:
    """The same for lengths where forces alone act; moments beside forces in one matrix are pivots of another size."""
    law, wall = case.law.copy(), case.wall_law.copy()
    law[3:] = wall[3:] = 0.0
    case = replace(case, law=law, wall_law=wall)
    other = unscaled(case, 2.0**length, 4.0**mass, 2.0**time)
    same_in_binary(case, other, f"length 2^{length}, mass 4^{mass}, time 2^{time}")


# --------------------------------------------------------------------------------------------------- both tiers

powers = st.integers(-8, 8)
LAWS: dict[str, tuple[Callable[..., None], list[Any]]] = {
    "turned": (turned, [walled_scenes(), rotations()]),
    "mirrored in x, y": (mirrored_in_x_or_y, [walled_scenes()]),
    "elsewhere": (elsewhere, [walled_scenes(), vectors(2.0)]),
    "Galilei": (galilean, [free_scenes(), vectors(2.0)]),
    "Galilei, by default": (galilean_by_default, [free_scenes(), vectors(2.0)]),
    "begun later": (begun_later, [walled_scenes(), st.integers(1, 59)]),
    "relabelled": (relabelled, [walled_scenes(), st.permutations(range(12))]),
    "groups apart": (
        groups_apart,
        [st.lists(free_scenes(most=4), min_size=2, max_size=5), st.permutations(range(20))],
    ),
    "units": (in_any_units, [walled_scenes(), st.tuples(powers, powers, powers)]),
    "units of mass and time, bits": (in_binary_units, [walled_scenes(), powers, powers]),
    "units of length, bits": (in_binary_lengths, [walled_scenes(), powers, powers, powers]),
}


@in_both_tiers
@pytest.mark.parametrize("name", LAWS)
def test_law(name: str, tier: settings, trials: Trials) -> None:
    REDUNDANT.clear()
    hold(*LAWS[name], tier, trials, "symmetries of mechanics, random scenes")
    assert len(REDUNDANT) <= 0.025 * tier.max_examples
