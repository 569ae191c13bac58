"""Clumps leave by outlets: as whole bodies, by their centres of mass, with all that they have. Balls enter beside them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from audit_faults import planted
from carom import audit
from carom.export.frames import Selection
from carom.show.film.look import Look
from carom.show.film.playback import Playback
from carom.show.viewer import write_html
from clump_scenes import FAR, ROD, G, R, colliding, empty, hopper

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

ODD = [[0.02, 0, 0, 0.01], [-0.02, 0, 0, 0.01], [0.0, 0.03, 0, 0.008], [0.0, 0.01, 0.012, 0.01]]
"""Spheres of a body with three different moments."""
OPTIONS: dict[str, Any] = {"step": 1e-3, "until": 0.55, "pile_tolerance": 1e-4, "every": 1}


@pytest.fixture(scope="module")
def emptied() -> carom.Result:
    return carom.simulate(hopper(), walls=True, **OPTIONS)


def left_at(result: carom.Result) -> dict[str, int]:
    """The step after which each clump that left did so."""
    step, body = (np.asarray(result.events[name]).astype(int) for name in ("step", "body"))
    found = {}
    for name, clump in result.clumps.items():
        steps = step[np.isin(body, clump.numbers)]
        assert len(steps) in (0, len(clump.numbers))  # all balls or none
        assert len(set(steps.tolist())) <= 1  # together
        if len(steps):
            found[name] = int(steps[0])
    return found


def test_a_clump_leaves_by_its_centre_with_the_energy_of_its_tensor() -> None:
    scene, spin, h = empty(), np.array([3.0, 20.0, 5.0]), 1e-3
    moments = np.array([1e-5, 2e-5, 2.6e-5])
    scene.clump("body", spheres=ODD, material="grain", mass=0.1, inertia=moments.tolist(), centre=(0, 0, 0),
                position=(0, 0, 0.1), velocity=(0.3, 0, 0), angular_velocity=spin.tolist())  # fmt: skip
    scene.sphere("ball", radius=0.01, density=2500, material="grain", position=(1, 0, 0.5))
    scene.outlet(low=(-FAR, -FAR, -FAR), high=(FAR, FAR, 0.0))
    result = carom.simulate(scene, step=h, until=0.2, every=1)
    body, ball = result.clumps["body"], result["ball"]
    t = h * np.ceil(np.sqrt(2 * 0.1 / G) / h)  # the first step after which its centre is below 0
    assert left_at(result) == {"body": round(t / h)}
    last = round(t / h)
    assert body.present.tolist() == [k < last for k in range(len(result.time))]
    low = [result[name].position[:last, 2].min() for name in body.balls]
    assert min(low) < 0.0  # balls of it were in the outlet before
    lost = 0.05 * (0.3**2 + (G * t) ** 2) + 0.5 * spin @ (moments * spin)
    height = 0.1 - 0.5 * G * t * t
    steps = result.steps
    assert steps.energy_out[last - 1] == pytest.approx(lost + 0.1 * G * height, rel=1e-9)
    assert steps.removed.sum() == 4
    rest = steps.energy_kinetic + steps.energy_potential
    assert rest[last:] == pytest.approx(ball.mass * G * 0.5, rel=1e-12)  # the ball alone
    assert np.isnan(body.position[last:]).all()
    assert not body.velocity[last:].any()
    assert not body.angular_velocity[last:].any()
    assert (body.orientation[last:] == body.orientation[last]).all()
    assert result.momentum[last:] == pytest.approx(ball.mass * ball.velocity[last:], abs=1e-15)
    assert result.angular_momentum[last:, 1] == pytest.approx(-ball.mass * ball.velocity[last:, 2], abs=1e-15)
    assert not result.kinetic_energy[last:, body.numbers].any()
    assert not result.sel(time=0.19).kinetic_energy[:, body.numbers].any()
    assert audit.check(result).ok


def test_a_ball_of_a_clump_in_an_outlet_stays_and_what_has_left_is_met_by_nothing() -> None:
    scene = empty(friction=0.9, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="grain")
    scene.clump("near", spheres=ROD, material="grain", density=2500, position=(0.0, 0, R))
    scene.clump("over", spheres=ROD, material="grain", density=2500, position=(0.05 - 0.1 * R, 0, R))
    scene.clump("gone", spheres=ROD, material="grain", density=2500, position=(0.1, 0, R))
    scene.sphere("falls", radius=R, density=2500, material="grain", position=(0.1 + R, 0, 4 * R))
    scene.outlet(low=(0.05, -1, 0), high=(1, 1, 1.2 * R))
    result = carom.simulate(scene, step=1e-3, until=0.1, every=1)
    assert left_at(result) == {"gone": 0}
    assert not any(result.clumps["gone"].present)
    assert result.clumps["over"].position[-1] == pytest.approx(result.clumps["over"].position[0], abs=1e-9)
    falls = result["falls"]
    alone = 4 * R - 0.5 * G * result.time**2  # down to the outlet, where it leaves too
    there = np.asarray(falls.present)
    assert falls.position[there, 2] == pytest.approx(alone[there], abs=1e-12)
    assert not there[-1]
    assert audit.check(result).ok


def test_momentum_and_angular_momentum_leave_with_clumps() -> None:
    """Of rods in free space what is there and what has left keep both."""
    result = carom.simulate(colliding(), step=5e-4, until=0.4, every=1)
    left = left_at(result)
    assert len(left) > 6
    assert len(result.impacts) > 10
    momentum, turning = result.momentum.copy(), result.angular_momentum.copy()
    quiet = ~np.isin(
        result.step[1:], result.impacts.step
    )  # impacts correct places, which turns what moves on
    assert quiet[np.array([*left.values()]) - 1].sum() > 5
    for name, step in left.items():
        clump, at = result.clumps[name], step - 1  # nothing touched it in its last step
        assert not np.isin(result.impacts.body[result.impacts.step == step], clump.numbers).any()
        v, x = clump.velocity[at], clump.position[at]
        momentum[step:] += clump.mass * v
        turning[step:] += clump.angular_momentum[at] + clump.mass * np.cross(x, v)
    size = sum(clump.mass for clump in result.clumps.values())
    assert np.abs(momentum - momentum[0]).max() < 1e-13 * size
    assert np.abs(np.diff(turning, axis=0)[quiet]).max() < 1e-15 * size
    assert audit.check(result).ok


def test_other_numbers_of_the_clumps_change_nothing() -> None:
    scene, other = colliding(), colliding()
    other._tree.clump.reverse()
    one, two = (carom.simulate(made, step=5e-4, until=0.4, every=1) for made in (scene, other))
    assert left_at(one) == left_at(two)
    for name, clump in one.clumps.items():
        assert two.clumps[name].position == pytest.approx(clump.position, abs=1e-10, nan_ok=True)


def test_a_hopper_of_rods_empties(emptied: carom.Result) -> None:
    result, left = emptied, left_at(emptied)
    mass = np.array([clump.mass for clump in result.clumps.values()])
    there = np.array([clump.present for clump in result.clumps.values()])
    gone = np.array([left.get(name, 10**9) for name in result.clumps])
    assert result.steps.largest_island.max() > 80  # they lay on one another
    assert 10 < len(left) < 40
    assert min(left.values()) > 300
    for frame, step in enumerate(result.step):
        out = mass[gone <= step].sum()
        assert mass[there[:, frame]].sum() + out == pytest.approx(mass.sum(), rel=1e-14)
    assert result.steps.removed.sum() == 2 * len(left) == len(result.events)
    steps = result.steps
    total = np.concatenate(
        [[steps.energy_kinetic[0] + steps.energy_potential[0]], steps.energy_kinetic + steps.energy_potential]
    )
    exchanged = steps.energy_work + steps.energy_in - steps.energy_out
    assert (
        np.diff(total)[1:] - exchanged[1:] < 1e-6 * steps.energy_kinetic.max()
    ).all()  # no energy from nothing
    # The impulse of all walls, the weight, and what left: what is there has the rest.
    weight = np.array([0, 0, -G]) * result.steps.time[0] * np.cumsum(mass @ there[:, :-1])[:, None]
    walls = sum(-np.asarray(wall.impulse) for wall in result.walls.values())
    carried = np.zeros_like(result.momentum)
    for name, step in left.items():
        clump, last = result.clumps[name], result.contacts.at(step)
        carried[step:] += clump.mass * (clump.velocity[step - 1] + [0, 0, -G * 1e-3])
        own = np.isin(last["body"], clump.numbers).astype(float) @ [1, -1]
        carried[step:] += own @ np.asarray(last["impulse"])
    off = (result.momentum + carried)[1:] - weight - np.cumsum(walls[1:], axis=0)
    assert np.abs(off).max() < 1e-9 * mass.sum()
    report = audit.check(result)
    assert report.ok, repr(report)


def test_threads_change_nothing() -> None:
    one, two = (
        carom.simulate(
            colliding(350, 0.08), step=1e-3, until=0.3, every=5, pile_tolerance=1e-4, threads=threads
        )
        for threads in (1, 2)
    )
    assert len(left_at(one)) > 100
    assert one.steps.largest_island.max() > 100
    for name in ("position", "orientation", "velocity", "angular_velocity", "present"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    np.testing.assert_array_equal(one.steps.energy_out, two.steps.energy_out)


def test_a_resumed_run_is_the_same(emptied: carom.Result, tmp_path: Path) -> None:
    stopped = carom.simulate(hopper(), walls=True, out=tmp_path / "run", **(OPTIONS | {"until": 0.44}))
    assert 0 < len(left_at(stopped)) < len(left_at(emptied))
    resumed = carom.resume(tmp_path / "run", until=0.55)
    for name in ("position", "orientation", "velocity", "angular_velocity", "present"):
        np.testing.assert_array_equal(getattr(resumed, name), getattr(emptied, name))
    np.testing.assert_array_equal(resumed.steps.energy_out, emptied.steps.energy_out)
    for name, clump in emptied.clumps.items():
        np.testing.assert_array_equal(resumed.clumps[name].orientation, clump.orientation)
    assert audit.check(resumed).ok


def test_what_reads_a_result_leaves_out_clumps_that_have_left(emptied: carom.Result, tmp_path: Path) -> None:
    there = [name for name, clump in emptied.clumps.items() if clump.present[-1]]
    assert 0 < len(there) < 40
    scene = empty()
    taken = scene.spheres_from(emptied)
    assert [table.name for table in taken] == there
    assert scene.clumps[0].middle() == pytest.approx(emptied.clumps[there[0]].position[-1], abs=1e-15)
    moment = Playback(Selection.of(emptied), Look.of("png", {})).at(float(emptied.time[-1]))
    assert moment.body.tolist() == np.flatnonzero(emptied.present[-1]).tolist()
    emptied.export(tmp_path, "csv", every=550)
    rows = [line.split(",")[0] for line in (tmp_path / "frames.csv").read_text().splitlines()]
    assert rows.count("550") == 2 * len(there)
    assert write_html(emptied, tmp_path / "view.html").path.stat().st_size > 10_000


def test_a_run_that_is_watched_has_no_place_of_what_has_left() -> None:
    scene, seen = empty(), []
    scene.clump("rod", spheres=ROD, material="grain", density=2500, position=(0, 0, 0.01))
    scene.sphere("ball", radius=R, density=2500, material="grain", position=(1, 0, 1))
    scene.outlet(low=(-FAR, -FAR, -FAR), high=(FAR, FAR, 0.0))
    carom.simulate(
        scene, step=1e-3, until=0.06, callback=lambda now: seen.append((now.clumps[0, 0], now.kinetic_energy))
    )
    assert seen[0][0] == 0.0
    assert np.isnan(seen[-1][0])
    assert seen[-1][1] == pytest.approx(0.5 * scene.spheres[0].mass_kg() * (G * 0.06) ** 2, rel=0.05)


def test_balls_that_enter_meet_clumps(tmp_path: Path) -> None:
    """Balls rain on a rod that lies on a floor: none enters in it, and a resumed run is the same."""
    scene = empty(restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="grain")
    scene.clump("rod", spheres=[[-6 * R, 0, 0, R], [0, 0, 0, R], [6 * R, 0, 0, R]], material="grain", density=2500,
                position=(0, 0, R))  # fmt: skip
    scene.inflow("rain", count=30, radius=R, density=2500, material="grain", seed=3, rate=200.0,
                 region={"low": (-6 * R, -2 * R, R), "high": (6 * R, 2 * R, 8 * R)})  # fmt: skip
    scene.outlet(low=(-FAR, -FAR, -FAR), high=(FAR, FAR, FAR / 2), inside=False)
    options: dict[str, Any] = {"step": 1e-3, "every": 1}
    result = carom.simulate(scene, until=0.3, **options)
    assert result.steps.entered.sum() + sum(result.events.step == 0) == 30
    assert result.steps.penetration_relative.max() < 1e-3
    assert len(np.unique(result.impacts.body[np.isin(result.impacts.body[:, 0], [0, 1, 2])])) > 3
    assert audit.check(result).ok
    carom.simulate(scene, until=0.1, out=tmp_path / "run", **options)
    resumed = carom.resume(tmp_path / "run", until=0.3)
    np.testing.assert_array_equal(resumed.position, result.position)
    np.testing.assert_array_equal(resumed.clumps["rod"].orientation, result.clumps["rod"].orientation)


@pytest.fixture(scope="module")
def dropped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clump falls into an outlet, and another lies beside it."""
    scene, out = empty(), tmp_path_factory.mktemp("clumps") / "run"
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="grain")
    scene.clump(
        "falls", spheres=ODD, material="grain", density=2500, position=(0, 0, 0.2), angular_velocity=(3, 4, 5)
    )
    scene.clump("lies", spheres=ROD, material="grain", density=2500, position=(0.2, 0, R))
    scene.outlet(low=(-0.1, -1, -1), high=(0.1, 1, 0.1))
    carom.simulate(scene, step=1e-3, until=0.2, every=1, out=out)
    return out


def _parted(file: h5py.File) -> None:
    """A ball of the clump leaves a step before the others."""
    row = int(np.flatnonzero(file["events/body"][:] == 1)[0])
    file["events/step"][row] -= 1
    file["events/time"][row] -= 1e-3
    order = np.argsort(file["events/step"][:], kind="stable")
    for name in file["events"]:
        file[f"events/{name}"][:] = file[f"events/{name}"][:][order]
    step = int(file["events/step"][0])
    file["frames/present"][step, 1] = False


def _late(file: h5py.File) -> None:
    """The clump stays for ten steps more."""
    step = int(file["events/step"][0])
    file["events/step"][:] += 10
    file["events/time"][:] += 0.01
    file["frames/present"][step : step + 10, :4] = True
    for name in ("position", "velocity", "angular_velocity", "orientation"):
        file[f"frames/{name}"][step : step + 10, :4] = file[f"frames/{name}"][step - 1, :4]
    file["frames/clumps"][step : step + 10, 0] = file["frames/clumps"][step - 1, 0]
    file["frames/position"][step : step + 10, :4] -= [0, 0, 0.01]
    file["frames/clumps"][step : step + 10, 0, 2] -= 0.01


def _heavier(file: h5py.File) -> None:
    """More energy leaves than the clump had."""
    out = file["steps/energy_out"]
    row = int(np.flatnonzero(out[:])[0])
    out[row] = out[row] * (1 + 1e-9)


def _back(column: str, part: tuple[Any, ...], value: float) -> Any:
    """A value of a frame in which the clump is absent."""

    def plant(file: h5py.File) -> None:
        file[f"frames/{column}"][(int(file["events/step"][0]) + 5, 0, *part)] = value

    return plant


@pytest.mark.parametrize(
    ("fault", "kind"),
    [
        (_parted, "flow"),
        (_late, "flow"),
        (_heavier, "energy balance"),
        (_back("clumps", (slice(0, 3),), 0.1), "numbers"),
        (_back("clumps", (3,), 0.1), "numbers"),
        (_back("clumps", (8,), 0.1), "numbers"),
        (_back("clumps", (12,), 0.1), "numbers"),
        (_back("position", (slice(0, 3),), 0.1), "numbers"),
        (_back("velocity", (0,), 0.1), "numbers"),
        (_back("orientation", (0,), 0.1), "numbers"),
    ],
)
def test_what_leaves_otherwise_is_found(dropped: Path, fault: Any, kind: str, tmp_path: Path) -> None:
    assert audit.check(dropped).ok
    report = audit.check(planted(dropped, tmp_path / "copy", fault))
    assert kind in {finding.kind for finding in report.findings}


def test_advice_takes_the_centre_of_a_clump() -> None:
    scene = empty().with_options(until=0.1)
    scene.clump("rod", spheres=ROD, material="grain", density=2500, position=(0, 0, 0.01))
    scene.sphere("ball", radius=R, density=2500, material="grain", position=(1, 0, 1))
    scene.outlet(low=(-0.01, -1, -1), high=(-0.9 * R, 1, 1))  # one ball of it lies there
    assert "leaves at once" not in said(scene)
    scene._tree.outlet[0].high = (0.01, 1, 1)
    assert '"rod" leaves at once: it starts where balls are removed' in said(scene)
    assert "like" not in said(scene)
    scene.clump("other", spheres=ROD, material="grain", density=2500, position=(0, 0.1, 0.01))
    assert '"rod" leaves at once: it starts where balls are removed, like 1 other' in said(scene)


def said(scene: carom.Scene) -> str:
    """What checks say of a scene."""
    return "\n".join(problem.cause for problem in scene.validate())
