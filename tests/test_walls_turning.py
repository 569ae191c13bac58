"""Round walls that turn about their own axis: without friction nobody feels it, and their work is moment times turn."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
import pytest

LAWS: list[dict[str, Any]] = [
    {"method": "nsga"},
    {"method": "nsga", "impact": "sequence-paper"},
    {"method": "nsga", "impact": "poisson"},
    {"method": "nsga", "impact": "one-shot"},
    {"method": "nsga", "impact": "binary"},
    {"method": "nsga", "position_friction": "paper"},
    {"method": "moreau"},
]


def scene(wall: str, mu: float, motion: dict[str, Any]) -> carom.Scene:
    """Three balls that fly about and settle in a drum or a bowl."""
    made = carom.Scene("round", gravity=(0, 0, -9.81))
    made.contact("m", "m", friction=mu, restitution=0.6)
    where = {"material": "m", "point": (0, 0, 0), "radius": 0.2, "motion": motion}
    if wall == "drum":
        made.cylinder("wall", axis=(0, 1, 0), **where)
    else:
        made.ball_wall("wall", inside=True, **where)
    for k in range(3):
        at, velocity = (0.05 - 0.045 * k, 0.01 * k, -0.05 + 0.01 * k), (1.0 - 0.7 * k, 0.1, -1.0)
        made.sphere(f"b{k}", radius=0.02, mass=0.1, material="m", at=at, velocity=velocity)
    return made


def turning(rate: float) -> dict[str, Any]:
    return {"rotation": {"axis": (0, 1, 0), "point": (0, 0, 0), "rate": rate}}


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
@pytest.mark.parametrize("wall", ["drum", "bowl"])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: "-".join(law.values()))
def test_smooth_walls_may_turn_as_they_like(law: dict[str, Any], wall: str) -> None:
    shift = {"translation": [{"polynomial": [0, 0.3]}, 0.0, 0.0]}
    still, turned = (
        carom.simulate(scene(wall, 0.0, {**shift, **motion}), step=1e-3, until=0.25, **law)
        for motion in ({}, turning(30.0))
    )
    assert len(still.impacts) > 5
    for name in ("position", "velocity"):
        both = np.asarray(getattr(still, name)), np.asarray(getattr(turned, name))
        assert np.abs(both[0] - both[1]).max() < 1e-12
    assert carom.audit.check(turned).ok
    if law.get("impact") != "sequence-paper" and law.get("position_friction") != "paper":
        # Nor do they take anything: no work by their turn, no moment about the axis.
        work = np.asarray(turned.steps.energy_work) - np.asarray(still.steps.energy_work)
        assert np.abs(work).max() < 1e-12
        assert np.abs(np.asarray(turned.walls["wall"].angular_impulse)[:, 1]).max() < 1e-14


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
@pytest.mark.parametrize("law", [{}, {"method": "moreau"}, {"method": "moreau", "theta": 0.7}])
def test_work_is_moment_times_turn(law: dict[str, Any]) -> None:
    rate = 6.0
    result = carom.simulate(scene("drum", 0.5, turning(rate)), step=1e-3, until=0.5, walls=True, **law)
    of_moment = -rate * np.asarray(result.walls["wall"].angular_impulse)[:, 1].sum()
    work = np.asarray(result.steps.energy_work).sum()
    assert work > 0.1
    assert of_moment == pytest.approx(work, rel=1e-12)
    assert carom.audit.check(result).ok


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
@pytest.mark.parametrize("law", [{}, {"method": "moreau"}])
@pytest.mark.parametrize("kind", ["rotation", "surface_rotation"])
def test_a_rough_cone_turns_balls_about(law: dict[str, Any], kind: str) -> None:
    """Where they go round its tip their normals turn far in a step, and what loads do is half-way."""
    made = carom.Scene("cone", gravity=(0, 0, -9.81))
    made.contact("m", "m", friction=0.3, restitution=0.0)
    made.cone("wall", material="m", point=(0, 0, 0.05), axis=(0, 0, 1), radius=0.001, radius_end=0.1, length=0.1,
              motion={kind: {"axis": (0, 0, 1), "point": (0, 0, 0), "rate": -20.0}})  # fmt: skip
    made.sphere(
        "b", radius=0.008, density=2500, at=(0.02, 0.01, 0.09), velocity=(0.2, 0.3, 0.0), material="m"
    )
    result = carom.simulate(made, step=1e-3, until=0.5, **law)
    assert len(result.contacts) > 300
    report = carom.audit.check(result)
    assert report["energy balance"].violations == report["work"].violations == 0
    assert report["passivity"].violations == 0


@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_a_ball_dropped_on_a_turntable(restitution: float) -> None:
    """A lone ball on a plane: its loads, in closed form, act half-way, too."""
    made = carom.Scene("table", gravity=(0, 0, -9.81))
    made.contact("m", "m", friction=0.3, restitution=restitution)
    motion = {"surface_rotation": {"axis": (0, 0, 1), "point": (0, 0, 0), "rate": 20.0}}
    made.plane("wall", material="m", point=(0, 0, 0), normal=(0, 0, 1), motion=motion)
    made.sphere("b", radius=0.01, density=2500, at=(0.1, 0.02, 0.03), velocity=(0.1, 0, 0), material="m")
    result = carom.simulate(made, step=1e-3, until=0.4)
    report = carom.audit.check(result)
    assert report.ok, report
    for kind in ("work", "wall moment", "energy balance"):
        assert report[kind].judged > 50
