"""Runs of boxes that deform, by the core: what is recorded, resumed and taken over, and the power that shear puts in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import granular
from deformed_runs import deformed, scene
from fake_runs import everything, interrupted

DEFORMATIONS: dict[str, dict[str, Any]] = {
    "shear": {"shear": "7*t", "flow": "x", "gradient": "z"},
    "backwards": {"shear": "-3*t - t^2", "flow": "z", "gradient": "x"},
    "stretch": {"stretch": ("1 - 0.3*t", "exp(-0.5*t)", {"table": [[0.0, 1.0], [5.0, 2.0]]})},
    "both": {"shear": "7*t", "flow": "y", "gradient": "z", "stretch": (1, "exp(-0.5*t)", "1 + 0.2*t")},
}


@pytest.mark.parametrize("name", DEFORMATIONS)
@pytest.mark.parametrize("method", ["nsga", "moreau"])
def test_the_core_and_the_laws_say_the_same_of_box_and_flow(name: str, method: str) -> None:
    made = scene(**DEFORMATIONS[name])
    made.run.method = method
    found, expected = carom.simulate(made, every=5), deformed(scene(**DEFORMATIONS[name]))
    assert found.boxes.rows == pytest.approx(expected.boxes.rows, abs=1e-14)
    assert np.asarray(found.velocity[0]) == pytest.approx(np.asarray(expected.velocity[0]), abs=1e-9)
    assert (found._segments.attributes["box_flow"], found._segments.attributes["box_gradient"]) == (
        made.world.deformation.axes()
    )


@pytest.fixture(scope="module")
def flow(tmp_path_factory: pytest.TempPathFactory) -> carom.Result:
    """Grains in steady shear at a constant volume."""
    return carom.simulate(grains(), out=tmp_path_factory.mktemp("flow") / "run")


def grains() -> carom.Scene:
    d, count = 0.005, 100
    side = float((count * np.pi / 6 * d**3 / 0.55) ** (1 / 3))
    made = carom.Scene(
        "simple shear",
        gravity=(0, 0, 0),
        periodic=(side, side, side),
        run={"until": 0.6, "step": 5e-4, "pile_tolerance": 1e-6},
        record={"every": 20, "impacts": False},
    )
    made.packing(
        "grain", material="m", density=2500, seed=1, count=count, sizes="equal", diameter=d,
        region="box", low=(0, 0, 0), high=(side, side, side), periodic="xyz",
    )  # fmt: skip
    made.contact("m", "m", friction=0.3, restitution=0.5)
    made.deform(shear={"polynomial": [0.0, 5.0]}, flow="x", gradient="z")
    return made


def test_what_shear_puts_in_is_what_contacts_lose(flow: carom.Result) -> None:
    """In steady flow the power of the stress, -sigma_zx rate V, is that of contacts: the kinetic energy stays."""
    box = flow.box()
    stress = granular.over_frames(flow, granular.stress, granular.whole_box, start=0.1).mean("tensor")
    power = -stress[2, 0] * 5.0 * float(np.prod(box.lengths))
    time = np.asarray(flow.time)
    begin = int(np.searchsorted(time, 0.1 - 1e-9)) - 1
    frames = range(begin + 1, len(time))
    work = sum(
        float(np.sum(np.asarray(flow.contacts.at(k)["work_normal"])))
        + float(np.sum(np.asarray(flow.contacts.at(k)["work_friction"])))
        for k in frames
    )
    mass, inertia = np.asarray(flow.bodies["mass"]), np.asarray(flow.bodies["inertia"])

    def energy(k: int) -> float:
        s = granular.snapshot(flow, k)
        return 0.5 * float(
            mass @ (s.against_flow**2).sum(axis=1) + inertia @ (s.angular_velocity**2).sum(axis=1)
        )

    gained = energy(-1) - energy(begin)
    given = power * (time[-1] - time[begin])
    assert given > 0
    assert given + work == pytest.approx(gained, abs=2e-3 * given)


def test_a_run_that_is_resumed_has_the_bits_of_one_that_was_not(tmp_path: Path) -> None:
    made = scene(**DEFORMATIONS["both"])
    made.record.checkpoint_steps = 4
    carom.simulate(made, out=tmp_path / "whole", every=2)
    interrupted(made, tmp_path / "parts", 9, every=2)
    carom.resume(tmp_path / "parts")
    whole, parts = (everything(tmp_path / name) for name in ("whole", "parts"))
    assert whole == parts
    assert "frames/box" in whole


def test_a_run_goes_on_after_a_whole_number_of_lengths() -> None:
    """Balls taken over there meet the same images: the second half is that of the whole run."""
    rate = 10.0 / 1.2  # in 0.1 s by one length along x

    def dilute() -> carom.Scene:
        made = scene(shear={"polynomial": [0.0, rate]}, flow="x", gradient="z")
        made.run.step = 1e-3
        return made

    whole = carom.simulate(dilute(), every=100)
    assert whole.box(1).offset == pytest.approx(1.0)
    assert whole.box(1).tilt == pytest.approx(0.0, abs=1e-12)
    made = scene(balls=0, shear={"polynomial": [0.0, rate]}, flow="x", gradient="z")
    made.run.step, made.run.until = 1e-3, 0.1
    made.spheres_from(whole, 1)
    second = carom.simulate(made, every=100)
    assert np.asarray(second.velocity[-1]) == pytest.approx(np.asarray(whole.velocity[2]), abs=1e-9)
    assert np.asarray(second.position[-1]) == pytest.approx(np.asarray(whole.position[2]), abs=1e-9)


def test_contacts_across_a_sheared_face_are_closed_where_the_balls_touch(flow: carom.Result) -> None:
    """A contact that is said to be closed is one of images that touch; some of them are across the faces."""
    s = granular.snapshot(flow)
    c = s.touching
    pushing = c.closed & (c.push > 0)
    delta = s.box.nearest(s.position[c.first] - s.position[c.second])
    gap = np.linalg.norm(delta, axis=1) - s.radius[c.first] - s.radius[c.second]
    assert pushing.sum() > 20
    assert np.abs(gap[pushing]).max() < 1e-3 * s.radius[0]
    folded = s.folded
    across = np.linalg.norm(folded[c.first] - folded[c.second], axis=1) > 3 * s.radius[0]
    assert (across & pushing).any()
    assert s.branch[pushing] == pytest.approx(delta[pushing], abs=0.05 * s.radius[0])
    z = granular.coordination(flow, region=granular.whole_box(flow))
    assert z.mean == pytest.approx(2 * pushing.sum() / len(s.radius))


@pytest.mark.parametrize("law", [{"table": [[0.0, 0.0], [0.1, 1.0], [0.3, 1.0]]}, "min(10*t, 1)"])
def test_where_the_rate_jumps_the_flow_of_a_frame_is_the_one_after_it(law: Any) -> None:
    made = scene(balls=6, shear=law, flow="x", gradient="z")
    for ball in made.spheres:
        ball.velocity = (0.0, 0.0, 0.0)
    run = carom.simulate(made, every=1)
    for k in range(len(run.time)):
        box, v = run.box(k), np.asarray(run.velocity[k])
        assert box.velocity_gradient[0, 2] == pytest.approx(10.0 if k < 10 else 0.0, abs=1e-8)
        assert v == pytest.approx(box.flow_velocity(np.asarray(run.position[k])), abs=1e-8)


def test_a_law_need_not_go_on_behind_the_end_of_the_run(tmp_path: Path) -> None:
    made = scene(shear="t + 0*sqrt(0.2000001 - t)", flow="x", gradient="z")
    result = carom.simulate(made, every=1, out=tmp_path / "run")
    assert result.status == "done"
    assert np.isfinite(np.asarray(result.velocity)).all()
    assert result.box(-1).velocity_gradient[0, 2] == pytest.approx(1.0)
    assert carom.audit.check(tmp_path / "run").ok
