"""Balances of mechanics on random scenes: momentum, angular momentum, energy, no penetration. The bounds are of rounding
wherever the scheme is exact; `docs/reference/determinism.md` lists what is exact and what holds to which order.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from physics_scenes import F64
from random_scenes import (
    Case,
    Run,
    angular_momentum,
    directions,
    free_scenes,
    gaps,
    hold,
    hundredths,
    in_both_tiers,
    laws,
    momentum,
    vectors,
    walled_scenes,
)
from trials import Trials

# Rounding of some thousand sums of terms that cancel.
ROUNDING = 1e-13


def size(case: Case) -> float:
    """Sum of the momenta's sizes, kg m/s: what rounding of momentum is measured by."""
    return float(case.m @ np.linalg.norm(case.v, axis=1))


def kinetic(case: Case, v: F64, w: F64) -> float:
    inertia = case.kappa * case.m * case.r**2
    return float(0.5 * (case.m @ (v * v).sum(1) + inertia @ (w * w).sum(1)))


def small(bound: float, measured: Any, case: Case, what: str) -> None:
    worst = float(np.max(measured, initial=0.0))
    assert worst <= bound, f"{what}: {worst:.3e} is above {bound:.1e} in\n{case.to_toml()}"


# ----------------------------------------------------------------------------------------- momentum of free balls


def momentum_is_conserved(case: Case) -> None:
    """Every impulse acts twice, with opposite signs, whatever the solver left: no tolerance enters. Nor do those of
    the position level move the centre of mass."""
    run = case.run()
    p = momentum(case, run)
    small(ROUNDING, np.abs(p - p[0]) / (size(case) or 1.0), case, "momentum")
    centre = np.einsum("i,tik->tk", case.m, run.x) / case.m.sum()
    uniform = centre[0] + case.step * np.arange(len(p))[:, None] * p[0] / case.m.sum()
    small(ROUNDING, np.abs(centre - uniform), case, "way of the centre of mass, m")


def angular_momentum_changes_as_the_impulses_say(case: Case, about: F64) -> None:
    """Impacts act where bodies touch at t_{n+1}, loads along the frame half-way, and positions are corrected without
    velocities: angular momentum is conserved to first order in h, and to rounding it changes as `gains` says."""
    run = case.run()
    momenta = angular_momentum(case, run, about)
    explained = np.zeros_like(momenta)
    np.add.at(explained, run.contact_step, gains(case, run))
    reach = np.abs(run.x - about).max() + case.r.max()
    scale = reach * size(case) + case.kappa * case.m * case.r**2 @ np.linalg.norm(case.w, axis=1)
    small(
        ROUNDING, np.abs(np.diff(momenta, axis=0) - explained[1:]) / (scale or 1.0), case, "angular momentum"
    )


def gains(case: Case, run: Run) -> F64:
    """What each row of contacts adds to the angular momentum, (rows, 3): P x (v_A - v_B), and for the parts F of impacts and
    of loads ((x_A - x_B)(n+1) - (r_A + r_B) n) x F, n that of t_{n+1} and half-way between both ends of the step."""
    pairs = np.asarray(run.contacts["body"]).astype(int)
    (a, b), k = pairs.T, run.contact_step
    before, after = run.x[k - 1, a] - run.x[k - 1, b], run.x[k, a] - run.x[k, b]
    normal, reach = np.asarray(run.contacts["normal"]), (case.r[a] + case.r[b])[:, None]
    middle = before / np.linalg.norm(before, axis=1)[:, None] + normal
    middle /= np.linalg.norm(middle, axis=1)[:, None]
    hits = np.zeros_like(normal)
    rows = {(int(step), *map(int, pair)): row for row, (step, pair) in enumerate(zip(k, pairs, strict=True))}
    table = run.impacts
    for step, pair, problem, impulse in zip(
        *(table[c] for c in ("step", "body", "problem", "impulse")), strict=True
    ):
        if problem > 0:
            hits[rows[int(step), *map(int, pair)]] += impulse
    loads = np.asarray(run.contacts["impulse"]) - hits
    gained = np.cross(run.contacts["position_impulse"], run.v[k - 1, a] - run.v[k - 1, b])
    gained += np.cross(after - reach * normal, hits) + np.cross(after - reach * middle, loads)
    return np.asarray(gained)


@st.composite
def head_on(draw: Any) -> tuple[Case, int]:
    """Two balls that meet on the line of their centres, about which they spin, within some steps; both drift together."""
    case = draw(free_scenes(most=2))
    along, speed, steps = draw(directions()), draw(hundredths(10, 300)), draw(st.integers(1, 20))
    part = draw(hundredths(0, 100))
    reach = case.r.sum() + (steps - draw(hundredths(1, 99))) * case.step * speed
    drift = draw(vectors())
    x = np.array([np.zeros(3), reach * along])
    v = drift + speed * np.array([part * along, (part - 1) * along])
    w = np.array([draw(hundredths(-3000, 3000)) * along for _ in range(2)])
    return replace(case, x=x, v=v, w=w, law=draw(laws())), steps


def angular_momentum_of_a_head_on_hit_is_conserved(hit: tuple[Case, int], about: F64) -> None:
    """The normal does not turn in the step of the hit, approach and corrections lie along it: nothing is left to gain.
    Spins across it would slip, and the position level's friction push the centres aside."""
    case, steps = hit
    run = case.run(steps)
    assert set(run.contact_step) == {steps}
    momenta = angular_momentum(case, run, about)
    reach = np.abs(run.x - about).max() + case.r.max()
    scale = reach * size(case) + case.kappa * case.m * case.r**2 @ np.linalg.norm(case.w, axis=1)
    small(ROUNDING, np.abs(momenta - momenta[0]) / scale, case, "angular momentum")


def spins_of_smooth_balls_do_not_change(case: Case) -> None:
    """Without friction nothing turns a ball: the same bits."""
    run = case.run()
    assert np.array_equal(run.w, np.broadcast_to(case.w, run.w.shape)), case.to_toml()


# ------------------------------------------------------------------------------------------- energy, penetration


def rises(case: Case, run: Run) -> tuple[F64, float]:
    """Rise of the energy in each step, (S,), and the total it is measured by, J."""
    # The energy at the start is not in the table of steps; the first step counts all the same.
    start = kinetic(case, case.v, case.w) - float(case.m @ (case.x @ case.gravity))
    fall = case.m.sum() * np.linalg.norm(case.gravity) * np.abs(run.x).max()
    total = float(kinetic(case, case.v, case.w) + fall)
    return np.diff(np.concatenate([[start], run.energy])), total or 1.0


def curved_path(case: Case, run: Run) -> F64:
    """What balls that slide or roll on one another may gain in each step, (S,) J: h^2 N v^2/(2 rho) for each contact, rho
    the distance of the centres (section 10 of docs/theory/algorithm.md). N h is the impulse of both levels."""
    gained = np.zeros(len(run.x) - 1)
    contacts = run.contacts
    for k, step in enumerate(run.contact_step):
        a, b = (int(i) for i in contacts["body"][k])
        if b >= len(case.r):
            continue
        n = np.asarray(contacts["normal"][k])
        pressed = abs(contacts["impulse"][k] @ n) + abs(contacts["position_impulse"][k] @ n) / case.step
        speeds = [run.v[s, a] - run.v[s, b] for s in (step - 1, step)]
        across = max(float(u @ u - (u @ n) ** 2) for u in speeds)
        gained[step - 1] += case.step * pressed * across / (2 * (case.r[a] + case.r[b]))
    return gained


def energy_of_free_balls_never_rises(case: Case) -> None:
    """At every step, alone and in clusters, with any restitution and friction."""
    rise, total = rises(case, case.run())
    small(1e-12, rise / total, case, "rise of the energy in a step, of the total")


def energy_rises_by_no_more_than_curved_paths_explain(case: Case) -> None:
    """Under gravity and among walls balls roll on each other for long. Four times what a smooth path gains: a step may
    begin or end a contact."""
    run = case.run()
    rise, total = rises(case, run)
    small(
        1e-12, (rise - 4 * curved_path(case, run)) / total, case, "unexplained rise of the energy in a step"
    )


@pytest.mark.parametrize(("friction", "degrees", "sideways"), [(0.0, 5, 0.0), (0.8, 20, 0.3), (0.3, 20, 0.3)])
def test_what_a_ball_on_a_ball_gains_is_the_path(friction: float, degrees: float, sideways: float) -> None:
    """A ball slides or rolls off another on a floor: the largest rise is h^2 N v^2/(2 rho) to a few per cent by the printed
    position level, and next to nothing where loads are solved once."""
    r, lean = np.array([0.01, 0.02]), np.deg2rad(degrees)
    x = np.array([[0, 0, 0.01], [0.03 * np.sin(lean), 0, 0.01 + 0.03 * np.cos(lean)]])
    law = np.array([friction, 0.0, 0.0, 0.0, 0.0])
    case = Case(x, np.array([[0, 0, 0], [0, sideways, 0]]), np.zeros((2, 3)), r, 8e3 * r**3, np.full(2, 0.4),
                np.array([0, 0, -9.8]), np.zeros((1, 3)), np.array([[0, 0, 1.0]]), law, law)  # fmt: skip
    assert rises(case, case.run())[0].max() < 1e-8
    run = case.with_options(position_friction="paper").run()
    rise, _ = rises(case, run)
    k = int(np.argmax(rise))
    assert rise[k] > 1e-7
    pressed = np.abs(np.einsum("ck,ck->c", run.contacts["impulse"], run.contacts["normal"]))
    between = [c for c in np.flatnonzero(run.contact_step == k + 1) if run.contacts["body"][c][1] == 1]
    [contact] = between
    n, u = np.asarray(run.contacts["normal"][contact]), run.v[k + 1, 0] - run.v[k + 1, 1]
    assert rise[k] == pytest.approx(case.step * pressed[contact] * (u @ u - (u @ n) ** 2) / 0.06, rel=0.1)


def nothing_penetrates(case: Case) -> None:
    """At the end of every step, measured from the positions alone: within 1e-10 of the smaller radius."""
    run = case.run()
    small(1e-10, [-gaps(x, case.r).min() for x in run.x[1:]], case, "overlap of balls, of the radius")
    for point, normal in zip(case.point, case.normal):
        small(1e-10, -((run.x[1:] - point) @ normal - case.r) / case.r, case, "overlap with a plane")
    orientation = np.linalg.norm(run.q, axis=2)
    small(1e-14, np.abs(orientation - 1), case, "length of the quaternions")


@st.composite
def elastic(draw: Any) -> Case:
    """Smooth balls with e_N = 1."""
    return replace(draw(free_scenes(frictionless=True)), law=np.array([0.0, 1.0, 0.0, 0.0, 0.0]))


def perfectly_elastic_balls_keep_their_energy(case: Case) -> None:
    """Hits of several at once, solved one problem after the other, included, as long as the sequence ends by itself."""
    run = case.run()
    start = kinetic(case, case.v, case.w)
    assume(start > 0 and not run.steps["truncated"].any())
    small(1e-11, np.abs(run.energy / start - 1), case, "change of the energy, of the total")


# --------------------------------------------------------------------------------------------------- both tiers

LAWS = {
    "momentum": (momentum_is_conserved, [free_scenes()]),
    "angular momentum": (angular_momentum_changes_as_the_impulses_say, [free_scenes(), vectors(3.0)]),
    "angular momentum, head-on": (angular_momentum_of_a_head_on_hit_is_conserved, [head_on(), vectors(3.0)]),
    "spins of smooth balls": (spins_of_smooth_balls_do_not_change, [free_scenes(frictionless=True)]),
    "energy, free": (energy_of_free_balls_never_rises, [free_scenes()]),
    "energy, among walls": (energy_rises_by_no_more_than_curved_paths_explain, [walled_scenes()]),
    "energy of elastic balls": (perfectly_elastic_balls_keep_their_energy, [elastic()]),
    "penetration": (nothing_penetrates, [walled_scenes()]),
}


@in_both_tiers
@pytest.mark.parametrize("name", LAWS)
def test_law(name: str, tier: settings, trials: Trials) -> None:
    hold(*LAWS[name], tier, trials, "balances of mechanics, random scenes")


# --------------------------------------------------------------------------------------- the scenes are no toys


def test_the_scenes_hold_what_they_should() -> None:
    """Impacts of several balls, islands, rolling contacts, quick and slow balls: laws about nothing would all hold."""
    seen: dict[str, int] = dict.fromkeys(
        ("scenes", "impacts", "several", "islands of 3", "rest", "slip", "stick"), 0
    )

    @settings(max_examples=60)
    @given(walled_scenes())
    def count(case: Case) -> None:
        run = case.run(20)
        status = np.asarray(run.contacts["status"])
        seen["scenes"] += 1
        seen["impacts"] += len(run.impacts["step"]) > 0
        seen["several"] += bool(np.any(np.asarray(run.impacts["problem"]) > 1))
        seen["islands of 3"] += bool(run.steps["largest_island"].max() >= 3)
        seen["rest"] += bool(np.abs(run.v[-1] - run.v[-2]).max() == 0)
        seen["stick"] += bool((status == 1).any())
        seen["slip"] += bool((status == 2).any())

    count()
    print(seen)
    for name, least in {"impacts": 12, "several": 4, "islands of 3": 6, "stick": 1, "slip": 6}.items():
        assert seen[name] >= least, seen
