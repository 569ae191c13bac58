"""Law `poisson` where impulses have self-stress: of many solutions one, which goes on where the motion does."""

from __future__ import annotations

import carom
import numpy as np
import pytest
from carom import billiards


def shot(side: int = 1, shift: float = 0.0) -> carom.Scene:
    """A ball that slides into a rail without spin: bed and nose hold it along the line between both."""
    table = billiards.table("9ft")
    scene = table.scene("rail", until=0.4, impact="poisson")
    ball = table.cue_ball(scene, (0.8, 0.1 if side > 0 else table.spec.width - 0.1))
    ball.velocity = (0.2 + shift, -3.0 * side, 0.0)
    return scene


def test_neighbouring_rail_hits_end_beside_one_another() -> None:
    start = 0.2 + 1e-6 * np.arange(200)
    batch = carom.simulate_batch(shot(), {"cue.velocity.x": start})
    ways = np.diff(np.asarray(batch["cue"].position)[:, 0])
    assert np.abs(ways - np.median(ways)).max() < 0.05 * np.median(ways)


def test_a_rail_hit_and_its_mirror_image() -> None:
    ends = [carom.simulate(shot(side))["cue"].velocity[-1] for side in (1, -1)]
    assert ends[0] == pytest.approx(ends[1] * (1, -1, 1), abs=1e-8)


def test_a_step_ends_where_the_exact_method_does() -> None:
    exact = carom.simulate(shot())["cue"].velocity[-1]
    stepped = [carom.simulate(shot(), method="nsga", step=h)["cue"].velocity[-1] for h in (2e-5, 1e-5)]
    off = [np.abs(v - exact).max() for v in stepped]
    assert off[1] < 0.7 * off[0] < 1e-3


ARMS = {
    "fix": [{"type": "fix"}],
    "lines": [{"type": "line", "direction": (1, 0, 0.5)}, {"type": "plane", "normal": (1, 0, 0.5)}],
    "planes": [{"type": "plane", "normal": n} for n in ((1, 1, 0), (1, -1, 0), (0, 0, 1))],
    "others": [{"type": "plane", "normal": n} for n in ((1, 0, 0.5), (0, 1, 0), (0, 0, 1))],
}


@pytest.mark.parametrize("joints", ARMS)
@pytest.mark.parametrize("friction", [0.2, 0.3, 0.5, 1.0])
def test_a_ball_on_an_arm_rebounds_alike_in_all_frames_and_by_all_joints_that_hold_it(
    friction: float, joints: str
) -> None:
    """One contact has many solutions beside joints: normal impulse and friction hold one another."""

    def after(turn: float, arm: str) -> float:
        def flat(x: float, y: float, z: float) -> tuple[float, float, float]:
            c, s = np.cos(turn), np.sin(turn)
            return c * x - s * y, s * x + c * y, z

        scene = carom.Scene("arm", gravity=(0, 0, 0), run={"step": 1e-6, "until": 2e-6, "tolerance": 1e-12})
        scene.contact("m", "floor", friction=friction, restitution=1.0)
        motion = {"velocity": flat(-0.15, 0, -0.5), "angular_velocity": flat(0, 5, 0)}
        scene.sphere("b", radius=0.05, mass=0.2, at=(0, 0, 0.05), material="m", **motion)
        scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
        for joint in ARMS[arm]:
            ways = {key: flat(*way) for key, way in joint.items() if key != "type"}
            scene.joint(str(joint["type"]), body="b", point=flat(-0.1, 0, 0.08), **ways)
        result = carom.simulate(scene, impact="poisson")
        return float(np.asarray(result.angular_velocity[-1, 0]) @ flat(0, 1, 0))

    expected = after(0.0, "fix")
    if friction == 0.2:  # friction at its bound holds all that it can: there is one solution
        assert expected == pytest.approx(-5 * (0.1 - 0.08 * friction) / (0.1 + 0.08 * friction), rel=1e-8)
    for turn in (0.0, 0.3, 0.8):
        assert after(turn, joints) == pytest.approx(expected, abs=1e-8)


def rack(rows: int, restitution: float, friction: float) -> carom.Scene:
    """A triangle on a floor, hit head-on."""
    r = 0.01
    scene = carom.Scene("rack", gravity=(0, 0, 0))
    scene.contact("ball", "ball", friction=friction, restitution=restitution)
    scene.contact("ball", "floor", friction=friction, restitution=restitution)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    scene.rack("q", apex=(0, 0, r), direction=(1, 0, 0), radius=r, mass=0.03, material="ball", rows=rows)
    scene.sphere("cue", radius=r, mass=0.03, at=(-2 * r, 0, r), velocity=(2, 0, 0), material="ball")
    return scene


@pytest.mark.parametrize("method", ["nsga", "moreau"])
@pytest.mark.parametrize("tolerance", [1e-8, 1e-11])
@pytest.mark.parametrize("friction", [0.3, 1.0])
def test_the_auditor_finds_the_same_in_racks(method: str, tolerance: float, friction: float) -> None:
    """Racks have mirror images of solutions, too: it begins at the recorded one."""
    options = {"method": method, "tolerance": tolerance, "step": 1e-5, "until": 1e-5, "impact": "poisson"}
    result = carom.simulate(rack(3, 0.5, friction), **options)
    report = carom.audit.check(result)
    assert report.ok, report
    assert report["impact"].judged > 0


def pressed(sideways: float, clump: bool, rolling: float) -> carom.Scene:
    """A ball behind two others, or behind a clump of two, that hit a cushion on a floor."""
    r = 0.01
    scene = carom.Scene("pressed", gravity=(0, 0, -9.8))
    for other in ("a", "w"):
        law = {"rolling_radius": rolling, "spinning_radius": rolling if clump else 0.0}
        scene.contact("a", other, friction=1.5, restitution=0.6, **law)
    kind = {"material": "a", "density": 2500.0, "velocity": (sideways, -1.0, 0.0)}
    if clump:
        scene.clump("k", spheres=[[-r, 0, 0, r], [r, 0, 0, r]], position=(0, r, r), **kind)
    else:
        for k, x in enumerate((-r, r)):
            scene.sphere(f"k{k}", radius=r, at=(x, r, r), **kind)
    back = {**kind, "velocity": (0.0, -1.0, 0.0)}
    scene.sphere("back", radius=r, at=(0, r + 3**0.5 * r, r), **back)
    scene.plane("floor", material="w", point=(0, 0, 0), normal=(0, 0, 1))
    scene.plane("cushion", material="w", point=(0, 0, 0), normal=(0, 1, 0))
    return scene


@pytest.mark.parametrize(
    ("clump", "rolling", "speeds"),
    [
        (False, 1e-4, [0.3 + d for d in (-1e-3, -1e-4, 0.0, 1e-6, 4e-4, 6e-4, 8e-4)]),
        (True, 1e-3, [-1e-4, -1e-5, -1e-6, 0.0, 1e-6, 2e-6, 1e-5, 1e-4]),
    ],
)
def test_a_ball_behind_others_rebounds_alike_at_neighbouring_speeds(
    clump: bool, rolling: float, speeds: list[float]
) -> None:
    """From contacts that give way as they would alone on: one solution, which is followed."""
    results = [
        carom.simulate(pressed(x, clump, rolling), step=1e-4, until=1e-4, impact="poisson") for x in speeds
    ]
    back = [float(result["back"].velocity[-1][1]) for result in results]
    assert max(back) - min(back) < 1e-3
    assert min(back) > 0.59
    assert all(result.summary["fallbacks"] == 0 for result in results)


@pytest.mark.parametrize("friction", [0.9, 1.0, 1.5])
def test_a_ball_that_rolls_into_a_corner(friction: float) -> None:
    """Bounds of rolling follow the forces, of which self-stress is a part; spins 1e-4 rad/s apart tell nothing."""
    speeds = []
    for spin in np.linspace(-1e-3, 1e-3, 11):
        scene = carom.Scene("corner", gravity=(0, 0, 0))
        scene.contact("a", "w", friction=friction, restitution=0.3, rolling_radius=1e-3)
        scene.plane("floor", material="w", point=(0, 0, 0), normal=(0, 0, 1))
        scene.plane("wall", material="w", point=(0, 0, 0), normal=(1, 0, 0))
        motion = {"velocity": (-1.4159, 0.598, -1.307), "angular_velocity": (0, spin, 0)}
        scene.sphere("b", radius=0.01, mass=0.03, at=(0.01, 0, 0.01), material="a", **motion)
        result = carom.simulate(scene, step=1e-5, until=1e-5, impact="poisson")
        speeds.append(float(result["b"].velocity[-1][1]))
    assert max(speeds) - min(speeds) < 1e-5


@pytest.mark.parametrize("heavy", [(0.12, -0.03, 0.04), (0.127, -0.018, 0.0288)])
@pytest.mark.parametrize("velocity", [(-0.66, 0.74, -0.78), (-0.66, 0.4, -0.9)])
def test_what_jams_itself_expands(
    heavy: tuple[float, float, float], velocity: tuple[float, float, float]
) -> None:
    """A light ball hits a wall, and its rod turns friction into a push: the normal impulse is more than the law gives back,
    until nothing slips but for what slides back.
    """
    mass, e_n, e_t, friction = 0.023, 0.3, 1.0, 1.2
    scene = carom.Scene("jam", gravity=(0, 0, 0))
    scene.contact("b", "w", friction=friction, restitution=e_n, tangential_restitution=e_t)
    scene.contact("b", "b", friction=0.5, restitution=0.8)
    scene.plane("w", point=(-0.02, 0, 0), normal=(1, 0, 0), material="w")
    scene.sphere("light", radius=0.02, mass=mass, position=(0, 0, 0), velocity=velocity, material="b")
    scene.sphere("heavy", radius=0.02, mass=0.284, position=heavy, velocity=velocity, material="b")
    scene.joint("rod", between=["light", "heavy"])
    scene.joint("lock", between=["light", "heavy"])
    options = {"step": 1e-4, "until": 1e-4, "impact": "poisson"}
    with pytest.warns(carom.CaromWarning, match="can gain"):
        result = carom.simulate(scene, energy_safeguard=False, **options)
    back, forth = (
        np.asarray(result.impacts["impulse"])[np.asarray(result.impacts["problem"]) == k][0] for k in (1, 2)
    )
    v, w = result.velocity[-1][0], result.angular_velocity[-1][0]
    slip = (v + np.cross(w, (-0.02, 0, 0)))[1:]
    assert forth[0] > e_n * back[0]
    assert abs(v[0]) < 1e-8
    assert np.linalg.norm(forth[1:]) < friction * forth[0]
    # Both turn as one, and along the rod move as one; it turns a little in the step.
    way, both = np.array(heavy) / np.linalg.norm(heavy), mass + 0.284
    left = np.eye(3) / mass - np.outer(way, way) * (1 / mass - 1 / both) + np.diag([0, 2.5, 2.5]) / both
    assert slip == pytest.approx(e_t * (left @ (0, *back[1:]))[1:], rel=1e-3)
    kept = carom.simulate(scene, every=1, **options)
    assert kept.energy.total[-1] <= (1 + 1e-12) * kept.energy.total[0]
    assert 0.1 < kept.steps.restitution_scale[-1] < 1.0  # not lost, but for what it may not gain
    assert carom.audit.check(kept).ok
