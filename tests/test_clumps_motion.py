"""Clumps move as rigid bodies do: free turns, impacts, rolling and sliding, against closed forms."""

from __future__ import annotations

import carom
import numpy as np
import pytest
from carom import audit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

F64 = NDArray[np.float64]
G, R, ARM = 9.81, 0.01, 0.03
ROD = [[-ARM, 0, 0, R], [ARM, 0, 0, R]]
ODD = [[0.02, 0, 0, R], [-0.02, 0, 0, R], [0.0, 0.03, 0, 0.8 * R], [0.0, 0.01, 0.012, R]]


def scene(*, e: float = 0.0, mu: float = 0.0, gravity: float = G, floor: bool = True) -> carom.Scene:
    made = carom.Scene()
    made.world.gravity = (0.0, 0.0, -gravity)
    made.material("steel")
    made.contact("steel", "steel", friction=mu, restitution=e)
    if floor:
        made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="steel")
    return made


def turned(quaternion: F64) -> Rotation:
    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1))


def euler(moments: F64, w: F64, until: float) -> Rotation:
    """How a free body turns whose principal axes are those of the world at first."""

    def rate(_: float, y: F64) -> F64:
        own, q = y[:3], y[3:]
        dq = 0.5 * np.array([-q[1:] @ own, *(q[0] * own + np.cross(q[1:], own))])
        return np.concatenate([-np.cross(own, moments * own) / moments, dq])

    start = np.concatenate([w, [1.0, 0.0, 0.0, 0.0]])
    found = solve_ivp(rate, (0.0, until), start, method="DOP853", rtol=1e-13, atol=1e-13)
    return turned(found.y[3:, -1])


def test_a_free_body_turns_as_eulers_equations_say() -> None:
    moments = np.array([1.0e-5, 2.0e-5, 2.6e-5])
    made = scene(gravity=0.0, floor=False)
    spin = np.array([0.3, 60.0, 0.4])  # about the middle axis: it turns over
    made.clump("body", spheres=ODD, material="steel", mass=0.1, inertia=moments, centre=(0, 0, 0),
               position=(0, 0, 0), velocity=(0.3, 0, 0), angular_velocity=spin)  # fmt: skip
    exact = euler(moments, spin, 1.0)
    errors = []
    for step in (2e-3, 5e-4):
        body = carom.simulate(made, step=step, until=1.0, every=10).clumps["body"]
        errors.append((turned(body.orientation[-1]) * exact.inv()).magnitude())
        assert np.abs(body.angular_momentum - body.angular_momentum[0]).max() < 1e-12 * 2.6e-5 * 60
        assert np.ptp(body.kinetic_energy) < 1e-6 * body.kinetic_energy[0]
        assert body.position[-1] == pytest.approx([0.3, 0, 0], abs=1e-12)
        assert (turned(body.orientation).apply([0, 1, 0])[:, 1] < -0.9).any()
    assert errors[0] < 1e-8
    assert errors[1] < 1e-10


def test_its_balls_go_along() -> None:
    made = scene(mu=0.3, e=0.4)
    made.clump("body", spheres=ODD, material="steel", density=7800, position=(0, 0, 0.06),
               velocity=(0.3, 0.1, 0), angular_velocity=(5, 20, 3))  # fmt: skip
    result = carom.simulate(made, step=5e-4, until=0.5, every=1)
    body = result.clumps["body"]
    turn, places = turned(body.orientation), np.array(ODD)[:, :3]
    for k, place in enumerate(places):
        lever = turn.apply(place - body.centre)
        off = result.position[:, k] - body.position - lever
        assert np.abs(off).max() < 1e-15 + 1e-14
        speed = body.velocity + np.cross(body.angular_velocity, lever)
        assert np.abs(result.velocity[:, k] - speed).max() < 1e-12
        assert np.abs(result.angular_velocity[:, k] - body.angular_velocity).max() < 1e-12
        assert (turned(result.orientation[:, k]) * turn.inv()).magnitude().max() < 1e-9
    assert result.position[..., 2].min() > 0.8 * R - 1e-9
    assert body.kinetic_energy[-1] < 0.1 * body.kinetic_energy.max()


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_an_impact_out_of_the_centre(e: float) -> None:
    angle, m = 0.5, 0.2
    moments = np.array([1e-5, 9e-5, 9.5e-5])
    made = scene(e=e, gravity=0.0)
    q = (np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0)
    v, w = np.array([0.4, 0.1, -1.0]), np.array([0.3, 0.2, 0.1])
    made.clump("rod", spheres=ROD, material="steel", mass=m, inertia=moments, orientation=q,
               position=(0, 0, R + ARM * np.sin(angle) + 1e-5), velocity=v, angular_velocity=w)  # fmt: skip
    result = carom.simulate(made, step=1e-5, until=1e-4, every=1)
    rod = result.clumps["rod"]
    hit = np.asarray(result.impacts["step"])[0]
    at = turned(rod.orientation[hit])
    lever = at.apply([ARM, 0, 0]) - [0, 0, R]
    tensor = at.as_matrix() @ np.diag(moments) @ at.as_matrix().T
    n = np.array([0.0, 0.0, 1.0])
    arm = np.cross(lever, n)
    before = rod.angular_velocity[hit - 1]
    # angular momentum stays until the impact
    before = np.linalg.solve(tensor, rod.angular_momentum[hit - 1])
    speed = n @ (v + np.cross(before, lever))
    impulse = -(1 + e) * speed / (1 / m + arm @ np.linalg.solve(tensor, arm))
    after = before + np.linalg.solve(tensor, arm) * impulse
    assert np.asarray(result.impacts["impulse"])[0] == pytest.approx([0, 0, impulse], rel=2e-6)
    assert rod.velocity[hit] == pytest.approx(v + impulse / m * n, rel=2e-6)
    assert rod.angular_velocity[hit] == pytest.approx(after, rel=2e-5)
    if e == 1.0:
        assert rod.kinetic_energy[-1] == pytest.approx(
            rod.kinetic_energy[0], rel=1e-7
        )  # of first order in the step


def test_two_that_collide_keep_what_both_have() -> None:
    made = scene(mu=0.4, e=0.6, gravity=0.0, floor=False)
    for name, x, v, q in (("one", -0.06, 1.0, (1, 0, 0, 0)), ("two", 0.06, -0.7, (0.8, 0, 0.6, 0))):
        made.clump(name, spheres=ODD, material="steel", density=7800, position=(x, 0.004, 0.002),
                   velocity=(v, 0.05, 0), angular_velocity=(3, 2, 9), orientation=q)  # fmt: skip
    lost = []
    for step in (1e-4, 1e-5):
        result = carom.simulate(made, step=step, until=0.1, every=1)
        assert len(np.asarray(result.impacts["step"])) > 0
        pair = [result.clumps[name] for name in ("one", "two")]
        momentum = sum(c.mass * c.velocity for c in pair)
        turning = sum(c.angular_momentum + c.mass * np.cross(c.position, c.velocity) for c in pair)
        assert np.abs(momentum - momentum[0]).max() < 1e-14
        energy = sum(c.kinetic_energy for c in pair)
        assert np.diff(energy).max() < 1e-12 * energy[0]
        assert energy[-1] < 0.95 * energy[0]
        lost.append(np.abs(turning - turning[0]).max() / np.abs(turning).max())
    # Corrections of overlaps move bodies, as those of balls do: of first order in the step.
    assert lost[0] < 0.01
    assert lost[1] < 0.5 * lost[0]


def test_one_ball_is_a_ball() -> None:
    made = scene(mu=0.2, e=0.5)
    for name, y in (("ball", 0.0), ("clump", 0.5)):
        keys = {
            "material": "steel",
            "position": (0, y, 0.05),
            "velocity": (1, 0, 0),
            "angular_velocity": (0, -30, 40),
        }
        if name == "ball":
            made.sphere(name, radius=R, mass=0.1, **keys)
        else:
            made.clump(name, spheres=[[0, 0, 0, R]], mass=0.1, **keys)
    result = carom.simulate(made, step=1e-3, until=1.0, every=10)
    ball, clump = 0, 1
    moved = result.position[:, clump] - result.position[:, ball] - [0, 0.5, 0]
    assert np.abs(moved).max() < 1e-9
    assert np.abs(result.angular_velocity[:, clump] - result.angular_velocity[:, ball]).max() < 1e-6


def test_a_weighted_ball_rocks() -> None:
    r, d, m, about = 0.02, 0.004, 0.1, 1.2e-5
    made = scene(mu=5.0)
    made.clump("ball", spheres=[[0, 0, 0, r]], material="steel", mass=m, inertia=[about] * 3,
               centre=(0, 0, -d), position=(0, 0, r), orientation=(np.cos(0.01), np.sin(0.01), 0, 0))  # fmt: skip
    rate = np.sqrt(m * G * d / (about + m * (r - d) ** 2))
    period = 2 * np.pi / rate
    result = carom.simulate(made, step=period / 2000, until=3 * period, every=1)
    spin = result.clumps["ball"].angular_velocity[:, 0]
    up = np.flatnonzero((spin[:-1] < 0) & (spin[1:] >= 0))
    times = result.time[up] + (result.time[up + 1] - result.time[up]) * -spin[up] / (spin[up + 1] - spin[up])
    assert np.diff(times).mean() == pytest.approx(period, rel=1e-4)
    # nothing is lost while it rolls
    assert np.abs(spin[-600:]).max() == pytest.approx(np.abs(spin[:2000]).max(), rel=1e-4)


@pytest.mark.parametrize("mu", [0.2, 0.4])
def test_a_sledge_on_a_slope(mu: float) -> None:
    slope = 0.3  # tan 0.309
    feet = [[x, y, 0, R] for x in (-0.04, 0.04) for y in (-0.03, 0.03)]
    made = carom.Scene()
    made.world.gravity = (G * np.sin(slope), 0.0, -G * np.cos(slope))
    made.material("steel")
    made.contact("steel", "steel", friction=mu, restitution=0.0)
    made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="steel")
    made.clump("sledge", spheres=feet, material="steel", density=7800, position=(0, 0, R))
    result = carom.simulate(made, step=1e-3, until=0.5, every=1)
    sledge = result.clumps["sledge"]
    slides = max(0.0, G * (np.sin(slope) - mu * np.cos(slope)))
    assert sledge.velocity[-1] == pytest.approx([slides * 0.5, 0, 0], abs=1e-6)
    assert np.abs(sledge.angular_velocity).max() < 1e-6
    floor = np.asarray(result.steps["contacts"])
    assert floor[-1] == 4


def test_a_rod_is_two_balls_that_a_joint_holds() -> None:
    spheres = [[-R, 0, 0, R], [R, 0, 0, R]]
    start = {"velocity": (0.2, 0.1, -0.3), "angular_velocity": (2.0, 6.0, 5.0)}
    tilt = (np.cos(0.2), 0.0, np.sin(0.2), 0.0)
    made = scene(mu=0.3, e=0.3)
    made.clump(
        "rod",
        spheres=spheres,
        material="steel",
        density=7800,
        position=(0, 0, 0.03),
        orientation=tilt,
        **start,
    )
    joined = scene(mu=0.3, e=0.3)
    for k, x in enumerate((-R, R)):
        lever = turned(np.array(tilt)).apply([x, 0, 0])
        joined.sphere(f"ball{k}", radius=R, density=7800, material="steel", position=np.array([0, 0, 0.03]) + lever,
                      orientation=tilt, velocity=start["velocity"] + np.cross(start["angular_velocity"], lever),
                      angular_velocity=start["angular_velocity"])  # fmt: skip
    joined.joint("ball", between=["ball0", "ball1"], point=(0, 0, 0.03))
    joined.joint("lock", between=["ball0", "ball1"])
    ends = []
    for step in (2e-4, 1e-4):
        one, two = (carom.simulate(s, step=step, until=0.1, every=10) for s in (made, joined))
        ends.append(np.abs(one.position[-1] - two.position[-1]).max())
    assert ends[1] < 1e-5
    assert ends[1] < ends[0]


def test_a_heap_of_rods_gains_no_energy_and_comes_to_rest() -> None:
    made = scene(mu=0.5, e=0.2)
    made.box("box", low=(-0.09, -0.09, 0), high=(0.09, 0.09, 0.4), open=["high_z"], material="steel")
    draw = np.random.default_rng(4)
    for k in range(12):
        q = draw.normal(size=4)
        x = (0.06 * (k % 3) - 0.06, 0.06 * (k // 3 % 2) - 0.03, 0.05 + 0.06 * (k // 6))
        turn, spin = q / np.linalg.norm(q), draw.normal(size=3)
        made.clump(f"rod{k}-", spheres=[[-0.012, 0, 0, R], [0, 0, 0, R], [0.012, 0, 0, R]], material="steel",
                   density=2500, position=x, orientation=turn, angular_velocity=spin)  # fmt: skip
    result = carom.simulate(made, step=5e-4, until=1.5, every=10)
    steps = result.steps
    energy = np.asarray(steps["energy_kinetic"]) + np.asarray(steps["energy_potential"])
    assert np.diff(energy).max() < 1e-6 * (energy[0] - energy[-1])
    assert np.asarray(steps["unconverged"]).sum() == 0
    # rods may still roll, slowly
    assert max(np.abs(result.clumps[f"rod{k}-"].velocity[-1]).max() for k in range(12)) < 0.02
    assert np.asarray(steps["penetration"]).max() < 1e-6 * R


def test_a_lid_a_belt_and_a_period_know_clumps() -> None:
    """Clumps are bodies between balls and walls: numbers of walls come behind them."""
    made = scene(mu=0.5)
    made.world.periodic = (0.3, 0.0, 0.0)
    made.plane(
        "lid", point=(0, 0, 2 * R), normal=(0, 0, -1), material="steel", free={"mass": 0.2, "force": 3.0}
    )
    feet = [[x, y, 0, R] for x in (-0.02, 0.02) for y in (-0.02, 0.02)]
    made.clump("sledge", spheres=feet, material="steel", mass=0.1, position=(0.28, 0, R))
    made.clump("stool", spheres=feet, material="steel", mass=0.1, position=(0.1, 0, R))
    made.sphere("ball", radius=R, mass=0.01, material="steel", position=(0.18, 0, R))
    made.plane("wall", point=(0, 0.2, 0), normal=(0, -1, 0), material="steel")
    result = carom.simulate(made, step=1e-3, until=0.1, every=1)
    weight = 0.21 * G
    assert result.walls["lid"].force[-20:, 2] == pytest.approx(3.0 + 0.2 * G, rel=1e-8)
    assert result.walls["floor"].force[-20:, 2] == pytest.approx(-(3.0 + 0.2 * G + weight), rel=1e-8)
    assert result.walls["wall"].force[-20:] == pytest.approx(0.0)
    for name in ("sledge", "stool"):
        assert np.abs(result.clumps[name].velocity[-1]).max() < 1e-7


def test_a_belt_carries_a_clump() -> None:
    made = scene(floor=False, mu=0.4)
    made.plane(
        "belt", point=(0, 0, 0), normal=(0, 0, 1), material="steel", motion={"surface_velocity": (0.5, 0, 0)}
    )
    feet = [[x, y, 0, R] for x in (-0.04, 0.04) for y in (-0.03, 0.03)]
    made.clump("sledge", spheres=feet, material="steel", density=7800, position=(0, 0, R))
    sledge = carom.simulate(made, step=1e-3, until=0.5, every=1).clumps["sledge"]
    assert sledge.velocity[50] == pytest.approx([0.4 * G * 0.05, 0, 0], rel=0.02)
    assert sledge.velocity[-1] == pytest.approx([0.5, 0, 0], abs=1e-8)


def test_threads_and_a_mirror_change_nothing() -> None:
    def run(mirror: float, **keys: int) -> carom.Result:
        made = scene(mu=0.3, e=0.4)
        for k in range(4):
            q = np.array([0.7, 0.3 * mirror, 0.4, 0.5 * mirror])  # mirrored at the plane y = 0
            place = (0.01 * k, 0.003 * k * mirror, 0.06 + 0.05 * k)
            made.clump(f"rod{k}", spheres=ROD, material="steel", density=7800, orientation=q / np.linalg.norm(q),
                       position=place, angular_velocity=(mirror, 2, 0))  # fmt: skip
        return carom.simulate(made, step=5e-4, until=0.25, every=10, **keys)

    one, two, mirrored = run(1.0), run(1.0, threads=2), run(-1.0)
    assert np.array_equal(one.position, two.position)
    assert mirrored.position == pytest.approx(one.position * [1, -1, 1], abs=1e-7)


@pytest.mark.parametrize("law", ["one-shot", "poisson", "compliant", "binary"])
def test_other_impact_laws(law: str) -> None:
    made = scene(mu=0.3, e=0.5)
    made.clump(
        "body", spheres=ODD, material="steel", density=7800, position=(0, 0, 0.06), angular_velocity=(5, 9, 3)
    )
    result = carom.simulate(made, step=5e-4, until=0.4, every=10, impact=law)
    body = result.clumps["body"]
    assert body.kinetic_energy[-1] < 0.2 * body.kinetic_energy.max()
    assert np.asarray(result.steps["unconverged"]).sum() == 0
    assert result.position[..., 2].min() > 0.8 * R - 1e-9


def test_no_force_without_friction_spins_a_rod_about_its_axis() -> None:
    moments = np.array([1e-6, 1e-5, 1e-5])
    made = scene(e=1.0)
    tilt = (np.cos(0.3), 0.0, np.sin(0.3), 0.0)
    made.clump("rod", spheres=ROD, material="steel", mass=0.05, inertia=moments, orientation=tilt,
               position=(0, 0, 0.07), velocity=(0.3, 0.1, -1.0), angular_velocity=(5, 20, 9))  # fmt: skip
    result = carom.simulate(made, step=1e-3, until=0.4, every=1)
    rod = result.clumps["rod"]
    axis = turned(rod.orientation).apply([1.0, 0.0, 0.0])
    spin = (axis * rod.angular_velocity).sum(axis=1)
    assert len(np.asarray(result.impacts["step"])) > 3
    assert np.abs(spin - spin[0]).max() < 1e-10 * abs(spin[0])
    energy = np.asarray(result.steps["energy_kinetic"]) + np.asarray(result.steps["energy_potential"])
    assert np.diff(energy).max() < 1e-12 * energy[0]


@pytest.mark.parametrize("law", ["sequence", "one-shot", "poisson", "compliant", "binary"])
def test_laws_know_no_direction(law: str) -> None:
    """A rod lands on both ends, sliding across; the same scene turned about the vertical."""

    def run(angle: float) -> NDArray[np.float64]:
        about = Rotation.from_rotvec([0, 0, angle])
        made = scene(mu=0.3, e=0.4, gravity=0.0)
        made.clump("rod", spheres=ROD, material="steel", density=7800, orientation=np.roll(about.as_quat(), 1).copy(),
                   position=(0, 0, R + 1e-5), velocity=about.apply([0.3, 0.8, -1.0]),
                   angular_velocity=about.apply([3.0, 0.0, 2.0]))  # fmt: skip
        rod = carom.simulate(made, step=1e-4, until=0.002, every=1, impact=law).clumps["rod"]
        return np.concatenate(
            [
                about.inv().apply(np.array(rod.velocity[-1])),
                0.03 * about.inv().apply(np.array(rod.angular_velocity[-1])),
            ]
        )

    assert run(0.7) == pytest.approx(run(0.0), abs=2e-6)


def test_slender_bodies_turn_freely_and_fast() -> None:
    """Forty beads in a row: moments of 1 to 500."""
    made = scene(gravity=0.0, floor=False)
    made.clump("fibre", spheres=[[0.002 * k, 0, 0, 0.001] for k in range(40)], material="steel", density=1000,
               position=(0, 0, 0), angular_velocity=(3.0, 60.0, 80.0))  # fmt: skip
    result = carom.simulate(made, step=1e-3, until=0.2, every=1)
    fibre = result.clumps["fibre"]
    assert np.asarray(result.steps["halvings"]).sum() == 0
    assert (
        np.abs(fibre.angular_momentum - fibre.angular_momentum[0]).max()
        < 1e-12 * np.abs(fibre.angular_momentum).max()
    )
    assert np.ptp(fibre.kinetic_energy) < 1e-9 * fibre.kinetic_energy[0]


def test_what_turns_far_in_a_step_hits_all_the_same() -> None:
    made = scene(e=0.5, mu=0.1, gravity=0.0, floor=False)
    made.clump(
        "rod",
        spheres=ROD,
        material="steel",
        density=7800,
        position=(0, 0, 0),
        angular_velocity=(0, 0, 2000.0),
    )
    made.sphere("ball", radius=R, density=7800, material="steel", position=(0, ARM, 0))
    result = carom.simulate(made, step=1e-3, until=0.002, every=1)
    assert np.linalg.norm(result.velocity[-1, 0]) > 1.0  # the ball was hit
    assert np.asarray(result.steps["substeps"])[0] >= 2


def test_what_turns_too_far_for_any_part_of_a_step_is_told() -> None:
    made = scene(gravity=0.0, floor=False)
    made.clump(
        "rod", spheres=ROD, material="steel", density=7800, position=(0, 0, 0), angular_velocity=(0, 0, 9e4)
    )
    with pytest.raises(carom.CaromError, match=r"too fast at step 1, t = 0\.001 s at rod1 \(it turns at"):
        carom.simulate(made, step=1e-3, until=0.003)


def rods(mu: float, seed: int) -> carom.Scene:
    """Sixty rods of three balls, above a box that they fall into."""
    side, r = 0.016, 1e-3
    made = scene(e=0.3, mu=mu)
    across = {"x0": (1, 0, 0), "x1": (-1, 0, 0), "y0": (0, 1, 0), "y1": (0, -1, 0)}
    for name, normal in across.items():
        point = [side if component < 0 else 0.0 for component in normal]
        made.plane(name, point=point, normal=normal, material="steel")
    rod = [[x, 0, 0, r] for x in (-r, 0.0, r)]
    made.clump_packing("rod", spheres=rod, material="steel", density=2500, seed=seed, count=60,
                       low=(0, 0, 0), high=(side, side, 4 * side))  # fmt: skip
    return made


ALL = {"step": 5e-4, "pile_tolerance": 1e-4, "every": 1, "contacts": True, "impacts": True}


@pytest.mark.parametrize(("seed", "until"), [(2, 0.05), (1, 0.145)])
def test_rods_without_friction_are_clean(seed: int, until: float) -> None:
    """The third ball of a rod that two others lay on the floor comes to touch exactly, which is no overlap (seed 2): it
    joined a step later, and closed until then. Positions take back what loads have turned, without a record (seed 1).
    """
    report = audit.check(carom.simulate(rods(0.0, seed), until=until, **ALL))
    assert report.ok, repr(report)


def test_a_heap_of_rods_settles_by_sweeps() -> None:
    """By Newton's method, which goes round in circles in such islands, it took 77 fallbacks and thirty times as long."""
    run = carom.simulate(rods(0.5, 1), until=0.3, **ALL)
    steps = run.steps
    assert steps.largest_island.max() > 150
    assert steps.fallbacks.sum() <= 20
    assert not steps.unconverged.any()
    assert steps.energy_kinetic[-1] < 1e-3 * steps.energy_kinetic.max()
    assert audit.check(run).ok


def test_a_load_that_is_taken_back_turns_nothing() -> None:
    """A lid that a ball carries parts from a spinning dumbbell: without impulses its angular momentum keeps its direction.

    The lid presses at first, as a load. Positions took that back, and turned the angular velocity with it: by 6e-3 rad.
    """
    made = carom.Scene(gravity=(0, 0, 0))
    made.contact("g", "g", friction=0.0, restitution=0.2)
    made.plane("floor", material="g", point=(0, 0, 0), normal=(0, 0, 1))
    made.plane("lid", material="g", point=(0, 0, 0.01), normal=(0, 0, -1), free={"mass": "5 g", "force": 1.6})
    made.sphere("ball", material="g", radius=0.005, density=2500, at=(0, 0, 0.005))
    apart, angle = 0.002, 0.2
    made.clump(
        "dumbbell",
        material="g",
        spheres=[[-apart, 0, 0, 0.0025], [apart, 0, 0, 0.0025]],
        density=2500,
        position=(0, 0.03, 0.01 - 4e-6 - apart * np.sin(angle) - 0.0025),
        orientation=(np.cos(angle / 2), 0, np.sin(angle / 2), 0),
        angular_velocity=(3, 2, 17),
    )
    found = carom.simulate(made, step=5e-4, until=0.005, every=1)
    spins, velocity = found.clumps["dumbbell"].angular_momentum, found.clumps["dumbbell"].velocity
    still = np.flatnonzero((velocity[1:] == velocity[:-1]).all(axis=1))
    assert len(still) > 5
    size = np.linalg.norm(spins[0])
    assert np.linalg.norm(spins[still + 1] - spins[still], axis=1).max() < 1e-4 * size
    assert audit.check(found).ok


def test_what_sticks_between_floor_and_lid_does_not_slide() -> None:
    """A lid that hops on it: corrections of positions take back its load, and turned the clump's velocity unseen."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("b", "b", friction=0.5, restitution=0.8)
    free = {"mass": 0.1, "pressure": 100.0, "area": 0.01}
    scene.plane("lid", point=(0, 0, 0.06), normal=(0, 0, -1), material="b", free=free)
    scene.clump("r", spheres=[[0, 0, 0, 0.01], [0.02, 0, 0, 0.02]], material="b", density=3000,
                position=(0, 0, 0.03), angular_velocity=(3, 20, 5), velocity=(0, 1, 1))  # fmt: skip
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="b")
    run = carom.simulate(scene, step=1e-3, until=0.4, every=1)
    radius, sticks = run.bodies["radius"], 0
    for k in range(1, len(run.time)):
        rows = run.contacts.at(k)
        for status, (a, b), normal in zip(rows.status, rows.body, rows.normal, strict=True):
            if status == 1 and len(rows.status) == 2 and k > 300:
                foot = -radius[a] * np.asarray(normal)
                slip = run.velocity[k, a] + np.cross(run.angular_velocity[k, a], foot)
                assert np.linalg.norm(slip[:2]) < 1e-8, (k, b)
                sticks += 1
    assert sticks > 50
