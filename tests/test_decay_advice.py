"""Drag and dampers that are stiff for the step: what is told before a run is what the run does, and the cures work."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromWarning, Scene

MASS, STEP = 0.1, 1e-3


def slowed(kind: str, z: float, **run: Any) -> Scene:
    """A ball at 1 m/s that a coefficient `z m/h` stops."""
    scene = Scene(gravity=(0, 0, 0), run={"until": 0.2, "step": STEP, **run})
    scene.sphere("x", radius=0.01, mass=MASS, at=(0, 0, 0), velocity=(1, 0, 0), material="m")
    if kind == "drag":
        scene.drag(on="all", translation=z * MASS / STEP)
    else:
        scene.spring("x", "ground", points=[(0, 0, 0), (-10, 0, 0)], damping=z * MASS / STEP)
    return scene


@pytest.mark.filterwarnings("ignore::carom.errors.CaromWarning")
@pytest.mark.parametrize("kind", ["drag", "damper"])
@pytest.mark.parametrize(("rho", "z"), [(0.8, 1.5), (0.8, 2.5), (0.8, 1e3), (0.0, 0.15), (0.0, 5.0)])
def test_the_way_is_too_long_by_what_the_advice_says(kind: str, rho: float, z: float) -> None:
    scene = slowed(kind, z, spectral_radius=rho)
    times = carom.simulate(scene)["x"].position[-1][0] / (STEP / z)
    assert times == pytest.approx(1 + (0.5 * (1 - rho) / (1 + rho) * z) ** 2, rel=1e-3)
    advice = [a for a in scene.validate() if "decays" in a.cause]
    assert len(advice) == (times > 1.01)
    for one in advice:
        assert f"goes {times:.3g} times as far" in one.cause
        (longest,) = re.findall(r"a step below (\S+) s", one.cure)
        assert (
            slowed(
                kind, z, spectral_radius=rho, step=0.99 * float(longest), until=99 * float(longest)
            ).validate()
            == []
        )


@pytest.mark.filterwarnings("ignore::carom.errors.CaromWarning")
@pytest.mark.parametrize(("theta", "z"), [(0.5, 1.9), (0.5, 2.1), (0.75, 3.9), (0.75, 4.1), (1.0, 1e6)])
def test_velocities_of_method_moreau_change_sign_where_the_advice_says(theta: float, z: float) -> None:
    scene = slowed("drag", z, method="moreau", theta=theta)
    flips = carom.simulate(scene)["x"].velocity[1][0] < 0
    assert flips == (z * (1 - theta) > 1) == bool(scene.validate())


@pytest.mark.filterwarnings("ignore::carom.errors.CaromWarning")
@pytest.mark.parametrize("z", [5.0, 1e3, 1e6])
def test_method_moreau_with_theta_1_stops_where_the_body_should(z: float) -> None:
    scene = slowed("drag", z)
    assert 'so does method = "moreau" with theta = 1' in scene.validate()[0].cure
    scene = scene.with_options(method="moreau", theta=1.0)
    assert scene.validate() == []
    ball = carom.simulate(scene)["x"]
    assert ball.position[-1][0] == pytest.approx(STEP / z, rel=1e-9)
    assert np.all(np.diff(ball.velocity[:, 0]) <= 0)


def decay_time(scene: Scene) -> float:
    (advice,) = (a for a in scene.validate() if "decays" in a.cause)
    (time,) = re.findall(r"decays in (\S+) s", advice.cause)
    return float(time)


def test_decay_times_are_those_of_the_bodies_that_move() -> None:
    def scene() -> Scene:
        made = Scene(gravity=(0, 0, 0), run={"until": 0.1, "step": STEP})
        made.contact("m", "m", friction=0, restitution=1)
        return made

    turned = scene()
    turned.sphere("x", radius=0.01, mass=MASS, at=(0, 0, 0), material="m")
    turned.drag(on="x", rotation=0.04)
    assert decay_time(turned) == pytest.approx(0.4 * MASS * 0.01**2 / 0.04)
    two = scene()
    for name, x, mass in (("x", 0.0, 0.1), ("y", 1.0, 0.3)):
        two.sphere(name, radius=0.01, mass=mass, at=(x, 0, 0), material="m")
    two.spring("x", "y", damping=1e3)
    assert decay_time(two) == pytest.approx(0.075 / 1e3)
    clump = scene()
    clump.clump(
        "k", spheres=[[0.02 * i, 0, 0, 0.01] for i in range(5)], mass=MASS, position=(0, 0, 0), material="m"
    )
    clump.drag(on="all", translation=200.0)  # each of five balls
    assert decay_time(clump) == pytest.approx(MASS / 1e3)
    assert "moreau" not in clump.validate()[0].cure  # which has no clumps


@pytest.mark.filterwarnings("ignore::carom.errors.CaromWarning")
@pytest.mark.parametrize("rho", [0.9, 0.95])
@pytest.mark.parametrize("z", [1.9, 2.1, 3.0])
def test_velocities_of_nsga_overshoot_0_where_the_advice_says(rho: float, z: float) -> None:
    scene = slowed("drag", z, spectral_radius=rho)
    velocity = carom.simulate(scene)["x"].velocity[:, 0]
    advice = scene.validate()
    assert (velocity[1] < 0) == bool(advice)
    assert abs(velocity[20]) < 0.01
    for one in advice:
        assert "velocities overshoot 0" in one.cause
        assert "follows its way to 1 %" in one.cure


@pytest.mark.filterwarnings("ignore::carom.errors.CaromWarning")
def test_a_body_is_slowed_by_all_that_acts_on_it() -> None:
    """In four equal parts a drag or a damper is the whole; dampers across one another do not add up."""
    told = {kind: slowed(kind, 6.0).validate()[0].cause for kind in ("drag", "damper")}
    drags, dampers, across = (slowed("drag", 1e-3) for _ in range(3))
    for k in range(4):
        drags.drag(on="x", translation=1.5 * MASS / STEP)
        dampers.spring("x", "ground", points=[(0, 0, 0), (-10 - k, 0, 0)], damping=1.5 * MASS / STEP)
    for axis in np.eye(3).tolist():
        across.spring("x", "ground", points=[(0, 0, 0), axis], damping=1.5 * MASS / STEP)
    for scene, kind in ((drags, "drag"), (dampers, "damper")):
        (advice,) = scene.validate()
        assert advice.cause == told[kind]
        assert advice.key == {"drag": "translation", "damper": "damping"}[kind]
    assert across.validate() == []


@pytest.mark.filterwarnings("ignore::carom.errors.CaromWarning")
def test_drag_on_the_balls_of_a_clump_slows_its_turning() -> None:
    """With the moment J and arms r it turns by `w T`, `T = J/(c sum r^2)`, and by what the scheme adds."""
    inertia, drag = 1e-5, 10.0
    arms = [(0, 0.1), (0, -0.1), (0.1, 0), (-0.1, 0)]
    scene = Scene(gravity=(0, 0, 0), run={"step": STEP, "until": 0.05})
    scene.contact("m", "m", friction=0, restitution=1)
    spheres = [[0, 0, 0, 0.02], *([x, y, 0, 0.02] for x, y in arms)]
    scene.clump(
        "k",
        spheres=spheres,
        mass=0.1,
        inertia=(inertia,) * 3,
        position=(0, 0, 0),
        angular_velocity=(0, 0, 0.1),
        material="m",
    )
    scene.drag(on="all", translation=drag)
    (advice,) = scene.validate()
    time = inertia / (drag * sum(x * x + y * y for x, y in arms))
    assert decay_time(scene) == pytest.approx(time, rel=1e-2)
    w, *_, z = carom.simulate(scene).clumps["k"].orientation[-1]
    assert f"goes {2 * np.arctan2(z, w) / (0.1 * time):.3g} times as far" in advice.cause


@pytest.mark.parametrize("options", [{}, {"method": "moreau"}, {"method": "moreau", "theta": 1.0}])
def test_a_run_whose_energy_rises_by_drag_names_the_drag(options: dict[str, Any]) -> None:
    with pytest.warns(
        CaromWarning, match=r"energy rose.*\"all\"\) translation: motion decays in 0\.0005 s"
    ) as told:
        carom.simulate(slowed("drag", 2.0, **options))
    (energy,) = (str(one.message) for one in told if "energy rose" in str(one.message))
    (longest,) = re.findall(r"a step below (\S+) s", energy)
    cured = slowed("drag", 2.0, **options)
    cured.run.step = float(longest)
    result = carom.simulate(cured)
    assert result.summary["energy"]["max_rise_relative"] < 1e-3


@pytest.mark.parametrize(("step", "stops"), [(1e-3, False), (5e-4, True)])
def test_a_law_without_a_value_stops_the_run_or_is_stepped_over(step: float, stops: bool) -> None:
    scene = Scene(gravity=(0, 0, 0), run={"until": 0.05, "step": step})
    scene.sphere("x", radius=0.01, mass=MASS, at=(0, 0, 0), material="m")
    scene.load("x", force=({"expression": "1/(t - 0.0105)"}, 0, 0))
    (advice,) = scene.validate()
    assert "a run that evaluates it there stops, and one whose steps go over it means nothing" in advice.cure
    if stops:
        with pytest.raises(carom.CaromError, match="load failed at step 21"):
            carom.simulate(scene)
    else:
        carom.simulate(scene)


def test_a_sweep_tells_each_advice_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("pyarrow", "scipy"):
        pytest.importorskip(name, reason="the extra [cluster] is not installed")
    text = slowed("drag", 1.0, until=0.01).to_toml().replace("translation = 100.0", 'translation = "= c"')
    (tmp_path / "scene.toml").write_text(text + "\n[parameters]\nc = 1.0\n")
    study = carom.Study.of(tmp_path / "scene.toml", {"c": [1.0, 1e4, 1e5]})
    with pytest.warns(CaromWarning, match="case 2: .*motion decays in 1e-06 s") as told:
        carom.sweep(study, tmp_path / "out", workers=0)
    assert len(told) == 1
    monkeypatch.setattr(Scene, "validate", lambda _: pytest.fail("a scene was validated again"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = carom.sweep(study, tmp_path / "out", workers=0)  # which has nothing to compute
    scene = found.scene(1)
    scene.spheres[0].radius = 1.0
    assert found.scene(1).spheres[0].radius == study.targeting.base.spheres[0].radius == 0.01
