"""Starting positions and advice: the search for overlaps is right and fast, warnings come when they should and only then."""

from __future__ import annotations

import contextlib
import math
import warnings

import numpy as np
import pytest
from carom import CaromError, CaromWarning, ScenarioError, Scene, simulate
from carom.scene.checks.moving_walls import first_jump
from carom.scene.checks.overlap import overlaps
from carom.scene.tables.laws import LawValue
from hypothesis import given, settings
from hypothesis import strategies as st


def brute(position: np.ndarray, radius: np.ndarray) -> list[tuple[int, int]]:
    found = []
    for a in range(len(radius)):
        for b in range(a + 1, len(radius)):
            gap = np.linalg.norm(position[a] - position[b]) - radius[a] - radius[b]
            if gap < -1e-9 * min(radius[a], radius[b]):
                found.append((a, b))
    return found


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32), st.integers(2, 60), st.sampled_from([1.0, 1.5, 10.0, 1000.0]), st.floats(0.5, 30)
)
def test_overlaps_are_those_of_the_double_loop(seed: int, n: int, ratio: float, box: float) -> None:
    random = np.random.default_rng(seed)
    radius = np.exp(random.uniform(0, np.log(ratio), n))
    position = random.uniform(-box, box, (n, 3)) * ratio**0.5
    position[n // 2] = position[0]
    found = overlaps(position, radius, most=10**6)
    assert [(a, b) for a, b, _ in found] == brute(position, radius)
    for a, b, gap in found:
        assert gap == pytest.approx(
            np.linalg.norm(position[a] - position[b]) - radius[a] - radius[b], abs=1e-12 * ratio
        )


def test_touching_spheres_do_not_overlap() -> None:
    x = np.arange(100) * 0.1
    position = np.stack([x, 0 * x, 0 * x], axis=1)
    radius = np.full(100, 0.05)
    assert overlaps(position, radius) == []
    position[50, 0] += 1e-9
    assert [(a, b) for a, b, _ in overlaps(position, radius)] == [(50, 51)]


@pytest.mark.parametrize("spread", [0.0, 0.8])
def test_a_hundred_thousand_spheres_are_searched_without_all_pairs(spread: float) -> None:
    scene = Scene()
    scene.lattice("s", kind="hcp", counts=(50, 50, 40), origin=(0, 0, 0), radius=1, mass=1, material="m")
    model = scene.to_model()
    radius = model["radius"] * (1 - spread * np.random.default_rng(0).random(100_000))
    # All pairs would be 5e9: this test would not end. It takes about 1 s.
    assert overlaps(model["position"], radius) == []
    model["position"][77_777] += 1e-3
    assert overlaps(model["position"], model["radius"])


def billiards(**run: object) -> Scene:
    scene = Scene("advice", run={"until": 1.0, "step": 1e-4, **run})
    scene.contact("ball", "ball", friction=0.06, restitution=0.9)
    scene.contact("ball", "cloth", friction=0.2, restitution=0)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="cloth")
    scene.sphere("cue", radius=0.03, mass=0.17, at=(0, 0, 0.03), velocity=(3, 0, 0), material="ball")
    scene.sphere("eight", radius=0.03, mass=0.17, at=(1, 0, 0.03), material="ball")
    return scene


def advice(scene: Scene) -> list[str]:
    return [str(warning) for warning in scene.validate()]


def test_no_advice_without_need() -> None:
    assert advice(billiards()) == []


def test_step_too_long_for_the_speed() -> None:
    (line,) = advice(billiards(step=1e-3))
    assert line.startswith('scene: run.step: a step of 0.001 s moves "cue" by 0.1 radii')
    assert line.endswith("step = 0.0005 is safe, 0.0002 accurate")
    assert advice(billiards(step=5e-4)) == []


def test_step_too_long_for_a_plane() -> None:
    scene = Scene("one ball", run={"until": 1.0, "step": 1e-2})
    scene.contact("ball", "wall", friction=0.2, restitution=1)
    scene.plane("wall", point=(1, 0, 0), normal=(-1, 0, 0), material="wall")
    ball = scene.sphere("cue", radius=0.03, mass=0.17, at=(0, 0, 0), velocity=(3, 9, 0), material="ball")
    (line,) = advice(scene)
    assert 'a step of 0.01 s moves "cue" towards "wall" by 1 radii' in line
    assert line.endswith("step = 0.005 is safe")
    scene.run.step = 5e-3
    assert advice(scene) == []
    ball.velocity = (-30, 0, 0)  # away from it
    assert advice(scene) == []
    scene.gravity, scene.run.step = (9.8, 0, 0), 0.1  # what gravity adds counts too
    ball.velocity = (0, 0, 0)
    scene.run.until = 0.1  # it does not get there
    assert any(
        '"cue" towards "wall" by 3.3 radii' in line and "step = 0.03 " in line for line in advice(scene)
    )


def test_until_between_two_steps() -> None:
    (line,) = advice(billiards(until=0.12345))
    assert "not a whole number of steps; the run ends at 0.1234 s" in line or "0.1235 s" in line
    assert advice(billiards(until=0.3)) == []


def test_rolling_resistance_that_no_ball_overcomes() -> None:
    scene = billiards()
    law = scene.contact("ball", "rubber", friction=0.2, restitution=0, rolling_radius="6 mm")
    assert any("never starts to roll" in line for line in advice(scene))
    law.rolling_radius = 0.005
    assert advice(scene) == []


def test_bounces_without_loss() -> None:
    scene = billiards()
    scene.contact("ball", "steel", friction=0, restitution=1)
    assert advice(scene) == []
    wall = scene.plane("wall", point=(9, 0, 0), normal=(-1, 0, 0), material="steel")
    assert advice(scene) == []
    wall.point, wall.normal = (0, 0, -1), (0.1, 0, 1)
    assert any("each bounce loses energy" in line for line in advice(scene))


@pytest.mark.parametrize("side", ["floor", "slope", "ceiling", "wall"])
@pytest.mark.parametrize("method", ["nsga", "moreau"])
@pytest.mark.parametrize("law", ["sequence", "compliant", "sequence-paper"])
def test_bounces_are_warned_of_where_they_change_energy(side: str, method: str, law: str) -> None:
    """The advice says what a run does: a ball flies at a wall and back, without friction and with e_N = 1."""
    h, speed = 1e-3, 3.0
    normal = np.array(
        {"floor": (0, 0, 1), "slope": (0.6, 0, 0.8), "ceiling": (0, 0, -1), "wall": (1, 0, 0)}[side]
    )
    change = []
    for part in (0.2, 0.4, 0.6, 0.8):  # of a step, at which it hits
        scene = Scene(gravity=(0, 0, -9.8), run={"until": 0.01, "step": h, "method": method, "impact": law})
        scene.contact("m", "m", friction=0.0, restitution=1.0)
        scene.plane("wall", point=(0, 0, 0), normal=normal.tolist(), material="m")
        at = (0.015 + part * h * speed) * normal
        scene.sphere(
            "a", radius=0.01, mass=0.03, at=at.tolist(), velocity=(-speed * normal).tolist(), material="m"
        )
        told = [line for line in advice(scene) if "against gravity" in line]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CaromWarning)
            energy = simulate(scene).summary["energy"]
        change.append((energy["final"] - energy["initial"]) / (0.03 * 9.8 * h * speed))
    assert max(map(abs, change)) < 1
    does = "gains" if max(change) > 0.1 else "loses" if min(change) < -0.1 else ""
    assert [f"each bounce {does}" in line for line in told] == [True] * bool(does)


@pytest.mark.parametrize("height", [0.1, 1.5])
@pytest.mark.parametrize(
    "law", ["1 - 0.05*v", "0.95 - 0.3*v", "v^2", "max(0, 0.95 - 0.3*v)", "min(1, 0.9 + v)", 1.0]
)
def test_laws_of_restitution_are_judged_at_the_speeds_of_falls(law: str | float, height: float) -> None:
    """They were looked at without speed: a law with e(0) = 1 was called one without loss, and none to leave 0 to 1."""
    scene = Scene(gravity=(0, 0, -9.8), run={"until": 0.6, "step": 1e-3})
    scene.contact("ball", "bed", friction=0.0, restitution=law)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed")
    scene.sphere("a", radius=0.02, mass=0.1, at=(0, 0, 0.02 + height), material="ball")
    v = math.sqrt(2 * 9.8 * height)
    e = {"0.95 - 0.3*v": 0.95 - 0.3 * v, "v^2": v * v}.get(str(law), 0.5)
    told = advice(scene)
    assert any("an approach of" in line for line in told) == (not 0 <= e <= 1)
    assert any("against gravity" in line for line in told) == (law in ("min(1, 0.9 + v)", 1.0))
    failed = pytest.raises(CaromError, match="a law of restitution")
    with warnings.catch_warnings(), contextlib.nullcontext() if 0 <= e <= 1 else failed:
        warnings.simplefilter("ignore", CaromWarning)
        simulate(scene)


def test_a_ceiling_that_no_ball_reaches_is_not_warned_of() -> None:
    scene = Scene(gravity=(0, 0, -9.8), run={"until": 1.0})
    scene.contact("ball", "lid", friction=0.0, restitution=1.0)
    scene.plane("lid", point=(0, 0, 1), normal=(0, 0, -1), material="lid")
    ball = scene.sphere("a", radius=0.01, mass=1, at=(0, 0, 0.5), velocity=(0, 0, 3.0), material="ball")
    assert advice(scene) == []  # 3.1 m/s get there
    ball.velocity = (0, 0, 3.2)
    assert any("each bounce loses" in line for line in advice(scene))


def test_how_far_balls_have_to_go_apart() -> None:
    scene = Scene(gravity=(0, 0, 0), run={"until": 1e-3, "method": "penalty"})
    scene.contact("m", "m", friction=0.0, restitution=0.5)
    for name, x in (("a", 0.0), ("b", 0.0189)):
        scene.sphere(name, radius=0.01, mass=1, at=(x, 0, 0), material="m")
    with pytest.raises(ScenarioError, match=r"gap -0\.0011 m; move them 0\.0001 m further apart"):
        scene.validate()
    scene.spheres[1].position = (0.019, 0, 0)
    scene.validate()


def test_inertia_above_that_of_a_shell() -> None:
    scene = billiards()
    scene.spheres[1].inertia = 5.5e-2
    (line,) = advice(scene)
    assert line.startswith(
        'scene.sphere["eight"]: inertia: 0.055 kg m^2 is more than that of a hollow sphere'
    )


def test_pairs_that_cannot_meet_need_no_law() -> None:
    scene = Scene(run={"until": 1})
    scene.sphere("only", radius=1, mass=1, at=(0, 0, 0), material="a")
    scene.material("b")
    scene.validate()
    scene.plane("p", point=(0, 0, -2), normal=(0, 0, 1), material="c")
    scene.plane("q", point=(0, 0, 2), normal=(0, 0, -1), material="d")
    with pytest.raises(ScenarioError) as caught:
        scene.validate()
    assert len(caught.value.problems) == 2  # a-c and a-d, not a-a or c-d
    assert 'add scene.contact("a", "c", friction=..., restitution=...)' in str(caught.value)


class TestFlow:
    """Inflows and outlets that meet, also by their images."""

    @staticmethod
    def world(low: float, high: float, *, inside: bool = True, at: float = 0.0, period: float = 0.0) -> Scene:
        scene = Scene("flow", gravity=(0, 0, 0), run={"until": 0.1}, periodic=(period, 0, 0))
        scene.sphere("a", radius=0.01, mass=1, at=(at, 0.5, 0), material="m")
        scene.contact("m", "m", friction=0, restitution=0)
        scene.inflow(
            "in", count=5, radius=0.005, density=2500, material="m", seed=1,
            region={"low": (low, -0.1, 0), "high": (high, 0.1, 0)},
        )  # fmt: skip
        scene.outlet(low=(0.1, -1, -1), high=(0.2, 1, 1), inside=inside)
        return scene

    @staticmethod
    def told(scene: Scene) -> str:
        try:
            found = " ".join(p.cause for p in scene.validate())
        except ScenarioError as error:
            return "all" if "where they enter" in str(error) else str(error)
        return "some" if "in a part of the region" in found else "none"

    @pytest.mark.parametrize(
        ("low", "high", "plain", "periodic"),
        [
            (0.11, 0.19, "all", "all"),
            (0.41, 0.49, "none", "all"),
            (-0.19, -0.11, "none", "all"),
            (0.15, 0.25, "some", "some"),
            (0.05, 0.15, "some", "some"),
            (0.05, 0.25, "some", "some"),
            (-0.15, -0.05, "none", "some"),
            (0.25, 0.35, "none", "none"),
            (0.2, 0.4, "none", "none"),
            (0.2, 0.2, "all", "all"),
            (-0.1, -0.1, "none", "all"),
            (0.21, 0.21, "none", "none"),
        ],
    )
    def test_where_an_inflow_meets_an_outlet(
        self, low: float, high: float, plain: str, periodic: str
    ) -> None:
        opposite = {"all": "none", "none": "all", "some": "some"}
        for period, expected in ((0.0, plain), (0.3, periodic)):
            assert self.told(self.world(low, high, period=period)) == expected
            assert self.told(self.world(low, high, inside=False, period=period)) == opposite[expected]

    def test_an_outlet_as_long_as_the_period_takes_all(self) -> None:
        assert self.told(self.world(0.22, 0.28, period=0.1)) == "all"

    @pytest.mark.parametrize(("at", "leaves"), [(0.15, True), (0.45, True), (-0.15, True), (0.25, False)])
    def test_balls_that_start_in_an_outlet(self, at: float, leaves: bool) -> None:
        scene = self.world(0.25, 0.25, at=at, period=0.3)
        assert any("all balls that are there" in p.cause for p in scene.validate()) == leaves
        scene.load("a", force=(0, 0, 1))
        assert not any("leave" in p.cause for p in scene.validate()), "a load of its own holds it there"


class TestJumps:
    """Laws of walls that change at once, however short the step."""

    @pytest.mark.parametrize("step", [1e-3, 1e-4])
    @pytest.mark.parametrize(
        ("law", "found"),
        [
            ({"expression": "0.004*floor(t/0.0199999)"}, (0.02, 0.004)),
            ({"expression": "0.002*(1+sign(t-0.02053))"}, (0.02053, 0.004)),
            ({"expression": "0.01*sin(t) - 1e-4*floor(t/0.3)"}, (0.3, -1e-4)),
            ({"table": [[0, 0], [0.02, 0], [0.02 + 1e-9, 0.01]]}, (0.02, 0.01)),
            ({"table": [[0, 0], [0.02, 0], [0.03, 0.01]]}, None),
            ({"expression": "0.002*sin(100*t)"}, None),
            ({"expression": "abs(sin(300*t))"}, None),
            ({"expression": "sqrt(t)"}, None),
            ({"expression": "1e300*t"}, None),
            ({"polynomial": [0, 1e5]}, None),
            (0.0, None),
        ],
    )
    def test_they_are_told_from_what_is_fast(
        self, law: LawValue, found: tuple[float, float], step: float
    ) -> None:
        told = first_jump(law, 1.0, step, 1e-5)
        if found is None or told is None:
            assert told is found
        else:
            assert told == pytest.approx(found, rel=1e-3, abs=2e-3 * step)

    def test_the_energy_that_they_bring_is_put_down_to_them(self) -> None:
        scene = Scene("jump", gravity=(0, 0, -9.8), run={"until": 0.05, "step": 1e-3})
        law = {"expression": "0.004*floor(t/0.0199999)"}
        scene.plane(
            "floor", point=(0, 0, 0), normal=(0, 0, 1), material="m", motion={"translation": [0, 0, law]}
        )
        scene.sphere("a", radius=0.01, mass=0.1, at=(0, 0, 0.01), material="m")
        scene.contact("m", "m", friction=0, restitution=0)
        (advice,) = scene.validate()
        assert "the law jumps by 0.004 m at t = 0.02 s" in advice.cause
        with pytest.warns(CaromWarning) as caught:
            simulate(scene)
        told = str(caught.list[-1].message)
        assert 'in a step: scene.plane["floor"] motion: the law jumps by 0.004 m at t = 0.02 s' in told
        assert "shorten step" not in told
