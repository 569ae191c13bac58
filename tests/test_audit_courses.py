"""The auditor on method `events`: courses between two rows of /transitions, impacts at their times, and steps within."""

from __future__ import annotations

from pathlib import Path

import audit_faults as fault
import audit_scenes as scenes
import carom
import h5py
import numpy as np
import pytest
from carom import audit

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

#: Values of a column, the factor by which one is off, and the laws that say so.
FAULTS = {
    "impulse of an impact": ("impacts/impulse", 1.5, {"impact sum", "impact speeds"}),
    "a little of it": ("impacts/impulse", 1.0 + 1e-6, {"impact sum", "impact speeds"}),
    "its direction": ("impacts/impulse", -1.0, {"impact sum", "impact speeds"}),
    "its approach": ("impacts/approach", 1.001, {"impact speeds", "impact"}),
    "its separation": ("impacts/separation", 1.001, {"impact speeds", "impact"}),
    "its time": ("impacts/time", 1.0 - 1e-9, {"clock"}),
    "place of an event": ("transitions/position", 1.0 + 1e-9, {"position"}),
    "velocity after it": ("transitions/velocity", 1.0 + 1e-6, {"position", "momentum"}),
    "time of it": ("transitions/time", 1.0 - 1e-6, {"clock", "position"}),
    "mode around it": ("transitions/mode", 0.0, {"counts", "position"}),
}


def off(column: str, by: float) -> fault.Fault:
    """The largest value of a column is off by a factor: of the rows but the last, which nothing may follow."""

    def edit(file: h5py.File) -> None:
        values = file[column][...]
        size = np.abs(values[: max(1, len(values) - 2)].astype(float))
        at = np.unravel_index(int(size.argmax()), size.shape)
        values[at] = values[at] * by
        file[column][...] = values

    return edit


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A break without rolling resistance."""
    out = tmp_path_factory.mktemp("courses") / "run"
    return scenes.run(scenes.break_(), out, 0.25, method="events")


def test_a_right_run_is_clean_and_all_of_it_is_judged(shot: Path) -> None:
    report = audit.check(shot)
    assert report.ok, report
    for kind in ("impact sum", "impact speeds"):
        assert report[kind].judged > 5
        assert not report[kind].unjudged


@pytest.mark.parametrize("name", FAULTS)
def test_what_is_off_is_found(name: str, shot: Path, tmp_path: Path) -> None:
    column, by, laws = FAULTS[name]
    report = audit.check(fault.planted(shot, tmp_path / "copy", off(column, by)))
    assert fault.kinds(report) & laws, (name, report)


def test_rows_follow_one_another_within_a_step(shot: Path, tmp_path: Path) -> None:
    out = scenes.run(scenes.break_(), tmp_path / "long", 0.25, method="events", step=0.25)
    assert audit.check(out).ok

    def swapped(file: h5py.File) -> None:
        time = file["transitions/time"][...]
        later = int(np.flatnonzero(np.diff(time) > 1e-6)[0])
        time[[later, later + 1]] = time[[later + 1, later]]
        file["transitions/time"][...] = time

    assert "clock" in fault.kinds(audit.check(fault.planted(out, tmp_path / "copy", swapped)))


def bowl(seed: int) -> carom.Scene:
    """Six balls, some heavy, in a hollow ball: they press it, and are stepped."""
    rng = np.random.default_rng(seed)
    scene = carom.Scene(gravity=(0, 0, -9.81))
    for other in ("ball", "bowl"):
        scene.contact("ball", other, friction=0.1, restitution=0.0)
    scene.ball_wall("bowl", point=(0, 0, 0), radius=0.1, material="bowl", inside=True)
    for i in range(6):
        angle = 2 * np.pi * i / 6
        at = (0.06 * np.cos(angle), 0.06 * np.sin(angle), rng.uniform(-0.02, 0.02))
        velocity, spin = rng.normal(size=3).tolist(), (rng.normal(size=3) * 10).tolist()
        scene.sphere(f"s{i}", radius=0.015, mass=[0.05, 5.0][i % 2], at=at, velocity=velocity,
                     angular_velocity=spin, material="ball")  # fmt: skip
    return scene


@pytest.mark.parametrize("seed", [14, 26, 38])
def test_loads_of_steps_within_events_act_half_way(seed: int) -> None:
    """Their works and speeds are those along the mean of two normals, as of `nsga`: they were taken for those along one."""
    result = carom.simulate(bowl(seed), step=1e-3, until=0.25, every=1, method="events", impacts="every")
    report = audit.check(result)
    assert report.ok, report
    for kind in ("position", "momentum", "impact sum", "impact speeds"):
        assert any("pressed" in one.why for one in report[kind].unjudged), kind
    # A smaller step is no way out there.
    cures = {one.cure for verdict in report.verdicts.values() for one in verdict.unjudged}
    assert not any("smaller step" in cure or "every = 1" in cure for cure in cures), cures


def test_laws_that_solve_one_problem_may_gain_what_their_solver_leaves(tmp_path: Path) -> None:
    """`docs/reference/determinism.md`: 2e-10 of the total in a step, where `sequence` has 1e-12."""
    for law, share, found in (
        ("sequence", 5e-12, True),
        ("binary", 5e-12, False),
        ("one-shot", 1e-10, False),
        ("binary", 1e-9, True),
    ):
        scene = carom.Scene(gravity=(0, 0, 0))
        scene.contact("wall", "ball", friction=0.0, restitution=0.5)
        scene.plane("wall", point=(0, 0, 0), normal=(0, 0, 1), material="wall")
        scene.sphere(
            "ball", radius=0.03, mass=0.2, material="ball", position=(0, 0, 0.2), velocity=(1, 0, -1)
        )
        run = scenes.run(scene, tmp_path / f"{law}{share}", 0.1, impact=law)

        def gained(file: h5py.File, share: float = share) -> None:
            file["steps/energy_kinetic"][-1] *= 1.0 + share

        copy = fault.planted(run, tmp_path / f"{law}{share}-copy", gained)
        assert ("energy rise" in fault.kinds(audit.check(copy))) == found, (law, share)
