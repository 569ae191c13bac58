"""Method `penalty`: contacts begin where the resolution allows in every wall, and energy that leaves is told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import carom
import numpy as np
import pytest
from carom import audit

R = 0.02


def scene(restitution: Any = 1.0, **law: Any) -> carom.Scene:
    made = carom.Scene(gravity=(0, 0, 0))
    made.contact("m", "m", restitution=restitution, **{"friction": 0.0, **law})
    return made


def ball(made: carom.Scene, at: Any, velocity: Any, radius: float = R, **more: Any) -> carom.Scene:
    made.sphere("ball", radius=radius, mass=0.1, position=at, velocity=velocity, material="m", **more)
    return made


def tube() -> carom.Scene:
    made = scene()
    made.cylinder("w", point=(0, 0, 0), axis=(0, 0, 1), radius=0.2, material="m")
    return ball(made, (0, 0.178, 0), (5, 0, 1))


def hollow() -> carom.Scene:
    made = scene()
    made.ball_wall("w", point=(0, 0, 0), radius=0.2, material="m")
    return ball(made, (0, 0.178, 0), (5, 0, 0))


def cone() -> carom.Scene:
    made = scene()
    made.cone("w", point=(0, 0, 0), axis=(0, 0, 1), radius=0.05, radius_end=0.3, length=0.3, material="m")
    return ball(made, (0, 0.1, 0.15), (5, 0, -1), radius=0.01)


def hole() -> carom.Scene:
    made = scene()
    made.plane("w", point=(0, 0, 0), normal=(0, 0, 1), radius=0.4, hole=0.2, material="m")
    return ball(made, (0, 0.178, 0.0), (5, 0, 0))


def centre() -> carom.Scene:
    made = scene()
    made.ball_wall("w", point=(0, 0, 0), radius=1.5 * R, material="m")
    return ball(made, (0, 0, 0), (5, 0, 0))


def turning(made: carom.Scene, rate: float) -> dict[str, Any]:
    return {"rotation": {"axis": (0, 0, 1), "point": (0, 0, 0), "angle": {"expression": f"{rate}*t"}}}


def paddle() -> carom.Scene:
    made = scene()
    made.plane("w", point=(0, 0, 0), normal=(0, 1, 0), material="m", motion=turning(made, 20.0))
    return ball(made, (0.05, 0.0055, 0), (4, 1.1, 0), radius=0.005)


@pytest.mark.parametrize("walls", [tube, hollow, cone, hole, centre, paddle])
def test_a_contact_begins_as_deep_in_long_steps_as_in_short_ones(walls: Callable[[], carom.Scene]) -> None:
    def run(step: float) -> carom.Result:
        made = walls()
        made.record.walls = True
        return carom.simulate(made, method="penalty", step=step, until=0.04, penalty_young_modulus=7e10)

    long, short = run(5e-3), run(2e-5)
    deepest = [r.summary["penetration_max_relative"] for r in (long, short)]
    assert 1e-4 < deepest[1] == pytest.approx(deepest[0], rel=0.01)
    gained = [
        r.energy.total[-1] - r.summary["energy"]["initial"] - r.steps["energy_work"].sum()
        for r in (long, short)
    ]
    assert np.abs(gained).max() < 1e-3 * long.energy.total[0]


def test_tangential_springs_of_light_rims_are_resolved() -> None:
    """e_T = 1 and no sliding: normal and tangential energy come back, for any inertia."""
    for inertia in (1.6e-5, 1e-7):
        made = scene(friction=10.0, tangential_restitution=1.0)
        made.plane("f", point=(0, 0, 0), normal=(0, 0, 1), material="m")
        ball(made, (0, 0, 1.025 * R), (0.3, 0, -1), inertia=inertia)
        coarse, fine = (
            carom.simulate(
                made, method="penalty", penalty_friction="spring", step=1e-4, until=2e-3, penalty_resolution=n
            )
            for n in (50, 1000)
        )
        slip = [r["ball"].velocity[-1, 0] - R * r["ball"].angular_velocity[-1, 1] for r in (coarse, fine)]
        assert slip[0] == pytest.approx(slip[1], abs=0.03 * 0.3)


def between_steps(step: float = 1e-5) -> dict[str, Any]:
    return {"method": "penalty", "step": step, "until": 3e-3, "penalty_young_modulus": 2e7}


def test_springs_that_end_with_a_ball_give_their_energy_to_what_leaves(tmp_path: Any) -> None:
    made = scene()
    ball(made, (-1.005 * R, 0, 0), (1, 0, 0))
    made.sphere("other", radius=R, mass=0.1, position=(1.005 * R, 0, 0), velocity=(-1, 0, 0), material="m")
    made.outlet(low=(-0.0191, -1, -1), high=(0, 1, 1))
    result = carom.simulate(made, out=tmp_path / "run", **between_steps())
    total = result.energy.total
    assert result.steps["removed"].sum() == 1
    assert total[-1] < 0.1 * total[0]  # springs had most of it
    assert total[-1] + result.steps["energy_out"].sum() == pytest.approx(total[0], rel=1e-4)


def test_springs_that_end_with_a_wall_give_their_energy_to_what_leaves(tmp_path: Any) -> None:
    made = scene()
    made.plane("gate", point=(0, 0, 0), normal=(0, 0, 1), material="m", motion={"until": 5e-4})
    result = carom.simulate(ball(made, (0, 0, R + 1e-9), (0, 0, -1)), out=tmp_path / "run", **between_steps())
    total, out = result.energy.total, result.steps["energy_out"]
    assert np.flatnonzero(out).tolist() == [50]
    assert out.sum() > 0.05 * total[0]
    assert total[-1] + out.sum() == pytest.approx(total[0], rel=1e-4)
    assert audit.check(tmp_path / "run").ok


@pytest.mark.parametrize(
    ("law", "failed"),
    [
        ({"restitution": {"expression": "0.2+0.6*v"}}, "e_N = 1.4"),
        ({"restitution": 0.5, "friction": {"expression": "0.3-v"}}, "mu = -"),
    ],
)
def test_laws_that_give_no_coefficient_end_the_run(law: dict[str, Any], failed: str) -> None:
    made = scene(**law)
    made.plane("f", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    ball(made, (0, 0, R + 1e-4), (1, 0, -2))
    with pytest.raises(carom.RunFailed, match=failed):
        carom.simulate(made, method="penalty", step=1e-3, until=0.01)


def test_a_law_of_restitution_is_told_to_vary() -> None:
    made = scene(restitution={"expression": "0.9-0.1*v"})
    ball(made, (0, 0, 0), (0, 0, 0))
    told = carom.simulate(made, method="penalty", until=1e-3).summary["penalty"]["laws"][0]
    assert told["varies"]
    assert told["restitution"] == pytest.approx(0.9)


def test_a_run_begins_where_another_one_ended() -> None:
    def floor() -> carom.Scene:
        made = carom.Scene(gravity=(0, 0, -9.81))
        made.contact("m", "m", restitution=0.3, friction=0.5)
        made.plane("f", point=(0, 0, 0), normal=(0, 0, 1), material="m")
        return made

    made = floor()
    ball(made, (0, 0, R), (0, 0, 0))
    rested = carom.simulate(made, method="penalty", step=1e-3, until=0.3)
    again = floor()
    again.spheres_from(rested)
    after = carom.simulate(again, method="penalty", step=1e-3, until=0.1)
    assert after.position[-1, 0, 2] == pytest.approx(rested.position[-1, 0, 2], abs=1e-9)
    with pytest.raises(carom.ScenarioError, match="behind plane"):
        carom.simulate(again, method="nsga", step=1e-3, until=0.1)


def test_what_a_method_does_not_read_is_told() -> None:
    def told(method: str, **options: Any) -> list[str]:
        made = scene(stiffness_ratio=2.0)
        options = {"until": 0.01, "impact": "compliant", **options}
        found = ball(made, (0, 0, 0), (0, 0, 0)).with_options(method=method, **options).validate()
        return [str(p) for p in found if "does not read it" in p.cause]

    assert told("nsga", restitution_threshold=0.1, spectral_radius=0.3) == []
    assert len(told("moreau", restitution_threshold=0.1, spectral_radius=0.3)) == 1
    assert len(told("penalty", restitution_threshold=0.1, spectral_radius=0.3)) == 4
