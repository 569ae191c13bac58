"""The auditor follows periodic boxes that deform: honest runs are clean, and what the box does otherwise is found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import audit_deforming
import carom
import h5py
import numpy as np
import pytest
from audit_faults import Fault, kinds, planted, rows_of
from audit_scenes import run
from carom import audit
from numpy.typing import NDArray

F64 = NDArray[np.float64]

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

R = 0.01
STEADY = {"shear": "4*t", "flow": "x", "gradient": "z"}
SQUEEZED = {"stretch": ["1 - 0.5*t", "exp(-t)", "1 - 0.5*t"]}
OSCILLATING = {
    "shear": "0.1*sin(60*t)",
    "flow": "y",
    "gradient": "x",
    "stretch": [1, "1 + 0.02*sin(80*t)", 1],
}
#: With kinks on steps and between them.
KINKS = {
    "shear": {"table": [[0.0, 0.0], [0.02, 0.1], [0.0403, -0.1], [1.0, -0.1]]},
    "flow": "z",
    "gradient": "y",
    "stretch": [{"table": [[0.0, 1.0], [0.03, 0.99], [1.0, 0.99]]}, 1, 1],
}


def gas(deform: dict[str, Any], *, side: int = 3, pitch: float = 2.4, speed: float = 0.5, gravity: float = 0.0,
        **law: float) -> carom.Scene:  # fmt: skip
    """Balls on a lattice that fills a periodic box, with random velocities."""
    scene = carom.Scene(
        gravity=(0, 0, -gravity), periodic=(side * pitch * R,) * 3, origin=(0.01, -0.02, 0.03)
    )
    scene.contact("ball", "ball", **law)
    scene.deform(**deform)
    rng = np.random.default_rng(side)
    for k in range(side**3):
        cell = np.array([k % side, k // side % side, k // side**2])
        place = np.array([0.01, -0.02, 0.03]) + (cell + 0.5) * pitch * R
        place += 0.2 * (pitch - 2.0) * R * rng.uniform(-1, 1, 3)
        spin = speed / R * rng.uniform(-1, 1, 3)
        scene.sphere(f"b{k}", radius=R, density=2500, material="ball", position=place.tolist(),
                     velocity=(speed * rng.uniform(-1, 1, 3)).tolist(), angular_velocity=spin.tolist())  # fmt: skip
    return scene


def clumps(deform: dict[str, Any]) -> carom.Scene:
    """Two clumps that turn, in a small box: they meet images of each other."""
    scene = carom.Scene(gravity=(0, 0, 0), periodic=(0.045, 0.045, 0.045))
    scene.contact("grain", "grain", friction=0.3, restitution=0.6)
    scene.deform(**deform)
    spheres = [[-0.005, 0, 0, R], [0.006, 0, 0, 0.8 * R]]
    for name, place, sign in (("one", (0.012, 0.011, 0.011), 1.0), ("two", (0.034, 0.033, 0.031), -1.0)):
        scene.clump(name, material="grain", spheres=spheres, density=2500, position=place,
                    velocity=(0.6 * sign, 0.5 * sign, 0.6 * sign), angular_velocity=(5, 40 * sign, 3))  # fmt: skip
    return scene


ROUGH = {"friction": 0.4, "restitution": 0.6}
SMOOTH = {"friction": 0.0, "restitution": 1.0}
COHESIVE = {"friction": 0.3, "restitution": 0.3, "cohesion": 0.02, "rupture_distance": 5e-4}

HONEST: dict[str, tuple[Callable[[], carom.Scene], dict[str, Any]]] = {
    **{
        f"{name}, {how}": (lambda deform=deform, law=law: gas(deform, **law), {})
        for name, law in (("smooth", SMOOTH), ("rough", ROUGH))
        for how, deform in (
            ("sheared", STEADY),
            ("squeezed", SQUEEZED),
            ("oscillating", OSCILLATING),
            ("with kinks", KINKS),
        )
    },
    "resisted": (lambda: gas(OSCILLATING, **ROUGH, rolling_radius=1e-4, spinning_radius=2e-4), {}),
    "restored slip": (lambda: gas(STEADY, **ROUGH, tangential_restitution=0.5), {}),
    "falling": (lambda: gas(KINKS, gravity=9.8, **ROUGH), {}),
    "cohesive": (lambda: gas(STEADY, pitch=2.05, speed=0.05, **COHESIVE), {}),
    "cohesive, with kinks": (lambda: gas(KINKS, pitch=2.05, speed=0.05, **COHESIVE), {}),
    "clumps": (lambda: clumps(STEADY), {}),
    "clumps, with kinks": (lambda: clumps(KINKS), {}),
    "moreau": (lambda: gas(STEADY, **ROUGH), {"method": "moreau"}),
    "moreau, with kinks": (lambda: gas(KINKS, gravity=9.8, **ROUGH), {"method": "moreau"}),
    "poisson": (lambda: gas(SQUEEZED, **ROUGH), {"impact": "poisson"}),
}


@pytest.mark.parametrize("name", HONEST)
def test_honest_runs_are_clean(name: str, tmp_path: Path) -> None:
    scene, options = HONEST[name]
    for k, record in enumerate(({"every": 1}, {"every": 5}, {"every": 1, "contacts": False})):
        report = audit.check(run(scene(), tmp_path / f"run{k}", 0.06, **{"step": 5e-4, **options, **record}))
        assert report.ok, (record, report.findings)
        for kind in ("penetration", "scenario", "energy rise"):
            assert report[kind].judged > 0
        if record == {"every": 1}:
            assert report["impact"].judged > 0
            for kind in ("momentum", "spin", "position", "energy balance", "work"):
                assert not report[kind].unjudged


@pytest.mark.parametrize("impact", ["sequence", "one-shot"])
@pytest.mark.parametrize("deform", [{"shear": "20*t", "flow": "x", "gradient": "z"}, OSCILLATING])
def test_dense_flows_are_clean(impact: str, deform: dict[str, Any], tmp_path: Path) -> None:
    """Solid fractions from 0.51 on: of the squeezed ones up to 0.56."""
    squeezed = {**deform, "stretch": ["1 - 0.5*t"] * 3}
    scene = gas(squeezed, side=5, pitch=2.02, speed=0.1, **ROUGH)
    report = audit.check(run(scene, tmp_path / "run", 0.05, step=2e-4, impact=impact))
    assert report.ok, report.findings
    assert report["impact"].judged > 0


@pytest.mark.parametrize("seed", [40, 77, 125, *range(6)])
def test_random_scenes_are_clean(seed: int, tmp_path: Path) -> None:
    scene, options = audit_deforming.scene(seed)
    report = audit.check(run(scene, tmp_path / "run", audit_deforming.UNTIL, **options))
    assert report.ok, (options, report.findings)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Runs into which faults are planted."""
    path = tmp_path_factory.mktemp("runs")
    return {
        "sheared": run(gas(STEADY, **ROUGH), path / "sheared", 0.05, step=5e-4),
        "kinks": run(gas(KINKS, **ROUGH), path / "kinks", 0.05, step=5e-4),
        "dense": run(gas(STEADY, side=4, pitch=2.03, **ROUGH), path / "dense", 0.02, step=5e-4),
        "moreau": run(gas(STEADY, **ROUGH), path / "moreau", 0.05, step=5e-4, method="moreau"),
    }


EVERY = ["sheared", "kinks", "dense", "moreau"]


def _images(file: h5py.File, body: F64, frame: int) -> F64:
    """Which of some pairs (K, 2) are met across the border along the gradient or flow of the box at a frame."""
    x = file["frames/position"][frame]
    apart = np.abs(x[body[:, 0]] - x[body[:, 1]])
    return np.asarray((apart > 0.5 * file["frames/box"][frame, :3]).any(axis=1))


def _across(file: h5py.File) -> tuple[int, int]:
    """Frame and row of a contact with an image that was pushed, the only one of both its balls."""
    for frame in range(1, len(file["frames/step"])):
        rows = rows_of(file, frame)
        body = file["contacts/body"][rows].astype(int)
        if not len(body):
            continue
        alone = np.bincount(body.ravel())[body].max(axis=1) == 1
        pushed = np.linalg.norm(file["contacts/impulse"][rows], axis=1) > 0
        found = np.flatnonzero(_images(file, body, frame) & alone & pushed)
        if found.size:
            return frame, rows.start + int(found[0])
    raise AssertionError("no contact across the border")


def box(share: float) -> Fault:
    """The box of one frame is longer by a share."""

    def edit(file: h5py.File) -> None:
        file["frames/box"][20] = file["frames/box"][20] * (1.0 + share)

    return edit


def impulse_across(share: float, *, moved: bool) -> Fault:
    """An impulse on an image is larger by a share; `moved`: both balls go on with the momentum that it would give."""

    def edit(file: h5py.File) -> None:
        frame, row = _across(file)
        a, b = file["contacts/body"][row].astype(int)
        impulse = file["contacts/impulse"][row]
        file["contacts/impulse"][row] = impulse * (1.0 + share)
        hit = (file["impacts/body"][:] == [a, b]).all(axis=1) & (
            file["impacts/step"][:] == file["frames/step"][frame]
        )
        for i in np.flatnonzero(hit):
            file["impacts/impulse"][i] = file["impacts/impulse"][i] * (1.0 + share)
        if moved:
            for body, sign in ((a, 1.0), (b, -1.0)):
                velocity = file["frames/velocity"][frame:, body]
                file["frames/velocity"][frame:, body] = (
                    velocity + sign * share * impulse / file["bodies/mass"][body]
                )

    return edit


def shifted(file: h5py.File) -> None:
    """A ball is elsewhere at one frame."""
    file["frames/position"][20, 3, 1] += 1e-6 * R


def without_the_box(file: h5py.File) -> None:
    """The work on record lacks that of the box."""
    file["steps/energy_work"][:] = 0.0


def less_work(file: h5py.File) -> None:
    """One step has less work, by as much as a millionth of the motion."""
    file["steps/energy_work"][30] -= 1e-6 * file["steps/energy_kinetic"][30]


def without_the_flow(file: h5py.File) -> None:
    """All velocities are those against the mean flow."""
    x, lengths = file["frames/position"][:], file["frames/box"][:]
    middle = np.array([0.01, -0.02, 0.03]) + 0.5 * lengths[0, :3]
    h = file.attrs["step"]
    flow, gradient = file.attrs["box_flow"], file.attrs["box_gradient"]
    rate = np.gradient(lengths[:, 3], h) / lengths[:, gradient]
    file["frames/velocity"][:, :, flow] -= rate[:, None] * (x - middle)[:, :, gradient]


def without_a_kink(file: h5py.File) -> None:
    """The velocities of one frame lack what a kink in the law has given: those of the frames before it have none."""
    frame = round(0.03 / float(file.attrs["step"]))
    velocity = file["frames/velocity"][frame]
    x = file["frames/position"][frame, :, 0] - (0.01 + 0.5 * file["frames/box"][0, 0])
    velocity[:, 0] -= 0.01 / 0.03 * x / file["frames/box"][frame, 0] * file["frames/box"][0, 0]
    file["frames/velocity"][frame] = velocity


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize(
    ("fault", "law"),
    [
        pytest.param(box(1e-6), "scenario", id="box"),
        pytest.param(impulse_across(1e-3, moved=False), "momentum", id="impulse"),
        pytest.param(impulse_across(1e-3, moved=True), "impact speeds", id="impulse and momentum"),
        pytest.param(shifted, "position", id="place"),
        pytest.param(without_the_box, "energy balance", id="work of the box"),
        pytest.param(less_work, "energy balance", id="less work"),
        pytest.param(without_the_flow, "scenario", id="flow"),
        pytest.param(without_the_flow, "position", id="flow and ways"),
    ],
)
def test_faults_are_found(name: str, fault: Fault, law: str, runs: dict[str, Path], tmp_path: Path) -> None:
    assert law in kinds(audit.check(planted(runs[name], tmp_path / "copy", fault)))


def test_a_kink_that_is_left_out_is_found(runs: dict[str, Path], tmp_path: Path) -> None:
    found = kinds(audit.check(planted(runs["kinks"], tmp_path / "copy", without_a_kink)))
    assert {"momentum", "energy record"} <= found


def test_the_box_and_its_axes_are_those_of_the_scene(runs: dict[str, Path], tmp_path: Path) -> None:
    def turned(file: h5py.File) -> None:
        file.attrs["box_flow"] = 1

    assert "scenario" in kinds(audit.check(planted(runs["sheared"], tmp_path / "copy", turned)))
