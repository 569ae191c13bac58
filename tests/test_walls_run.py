"""Walls in real runs: closed forms of balls on walls that move, forces that add up, and what a result tells of both."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from carom import CaromError, Scene, audit
from carom.result.names import UnknownName
from carom.result.walls import Poses
from carom.scene.assembly.arrays import walls
from carom.scene.assembly.placing import motion_for_core

G = 9.8
R = 0.01


def scene(*, mu: float = 0.5, restitution: float = 0.0, until: float = 0.2, **law: Any) -> Scene:
    """Gravity, and the law between sand and steel."""
    made = Scene("walls", gravity=(0, 0, -G), run={"until": until, "step": 1e-3})
    made.contact("sand", "steel", friction=mu, restitution=restitution, **law)
    return made


def lift(**motion: Any) -> Scene:
    """A ball on a plane that goes up with 3 m/s^2."""
    made = scene()
    made.sphere("ball", radius=R, density=2500, at=(0, 0, R), material="sand")
    law = {"translation": [0, 0, {"polynomial": [0, 0, 1.5]}], **motion}
    made.plane("lift", point=(0, 0, 0), normal=(0, 0, 1), material="steel", motion=law)
    return made


@pytest.fixture(scope="module")
def lifted() -> carom.Result:
    return carom.simulate(lift(), every=10)


class TestClosedForms:
    def test_accelerating_plane(self, lifted: carom.Result) -> None:
        wall, ball = lifted.walls["lift"], lifted["ball"]
        time = np.asarray(lifted.time)
        assert wall.position == pytest.approx(np.outer(1.5 * time**2, [0, 0, 1]), abs=1e-15)
        assert ball.position[:, 2] - R == pytest.approx(wall.position[:, 2], abs=1e-14)
        weight = ball.mass * (G + 3)
        assert wall.force[1:, 2] == pytest.approx(np.full(len(time) - 1, -weight), rel=1e-9)
        assert np.isnan(wall.force[0]).all()
        assert wall.impulse[0].tolist() == [0, 0, 0]
        assert np.abs(wall.force[1:, :2]).max() < 1e-12 * weight

    @pytest.mark.parametrize("method", ["nsga", "moreau"])
    @pytest.mark.parametrize(("h", "rest"), [(1e-3, 0.03), (3e-4, 0.0015)])
    @pytest.mark.parametrize("form", ["table", "expression"])
    def test_piston_that_starts_at_once(
        self, form: str, h: float, rest: float, method: str, tmp_path: Path
    ) -> None:
        """A ball at rest on it is hit, whether that is at the start of the run or later; until then it is held."""
        assert h == 1e-3 or round(rest / h) * h < rest  # an ulp before the kink
        laws = {"table": [[rest, 0], [rest + 1, 0.5]], "expression": f"max(0, 0.5*(t - {rest}))"}
        thrown = []
        for motion, start in (({"polynomial": [0, 0.5]}, 0.0), ({form: laws[form]}, rest)):
            made = scene(restitution=0.5)
            made.sphere("ball", radius=R, density=2500, at=(0, 0, R), material="sand")
            moved = {"translation": [0, 0, motion]}
            made.plane("piston", point=(0, 0, 0), normal=(0, 0, 1), material="steel", motion=moved)
            options = {"method": method, "until": start + 60 * h, "step": h, "every": 1, "impacts": "every"}
            result = carom.simulate(made, out=tmp_path / str(start), **options)
            first = round(start / h)
            assert np.abs(result["ball"].velocity[: first + 1]).max() < 1e-15
            assert result["ball"].velocity[first + 1, 2] == pytest.approx(0.75, rel=1e-12)
            assert result.summary["energy"]["rises"] == 0
            assert audit.check(result).ok
            thrown.append(np.asarray(result["ball"].velocity[first:, 2]))
        np.testing.assert_allclose(*thrown, rtol=1e-12, atol=1e-15)

    def test_conveyor(self) -> None:
        """A ball put on a belt slips until it rolls there with 2/7 of the belt's speed."""
        made = scene(mu=0.3)
        made.sphere("ball", radius=R, density=2500, at=(0, 0, R), material="sand")
        belt = {"surface_velocity": (1, 0, 0)}
        made.plane("belt", point=(0, 0, 0), normal=(0, 0, 1), size=(2, 1), material="steel", motion=belt)
        result = carom.simulate(made, until=0.15, every=1)
        ball, wall, time = result["ball"], result.walls["belt"], np.asarray(result.time)
        slipping = time < 1 / (3.5 * 0.3 * G) - 2e-3
        assert ball.velocity[slipping, 0] == pytest.approx(0.3 * G * time[slipping], rel=1e-12)
        assert ball.velocity[-1, 0] == pytest.approx(2 / 7, rel=1e-9)
        assert ball.angular_velocity[-1] == pytest.approx([0, -5 / 7 / R, 0], rel=1e-9)
        assert wall.force[1 : slipping.sum(), 0] == pytest.approx(-0.3 * ball.mass * G, rel=1e-9)
        assert np.abs(wall.force[-10:, 0]).max() < 1e-9 * ball.mass * G
        assert (wall.position == 0).all()  # the shape stands
        # The torque about the middle of the belt: the weight half-way of the ball, with the friction at height 0.
        half_way = 0.5 * (ball.position[1:, 0] + ball.position[:-1, 0])
        assert wall.torque[1:, 1] == pytest.approx(half_way * ball.mass * G, rel=1e-9)

    def test_ball_that_stays_in_a_turning_drum(self) -> None:
        """Where the slope's tangent is rolling radius over radius; the drum bears the moment of the weight."""
        drum, rate, rolling = 0.1, 2.0, 0.002
        tilt = math.atan(rolling / R)
        made = scene(mu=0.8, rolling_radius=rolling)
        at = np.array([-(drum - R) * math.sin(tilt), 0, -(drum - R) * math.cos(tilt)])
        spin = (0, rate * drum / R, 0)
        made.sphere("ball", radius=R, density=2500, at=at, angular_velocity=spin, material="sand")
        turn = {"rotation": {"axis": (0, 1, 0), "rate": rate}}
        made.cylinder("drum", point=(0, 0, 0), axis=(0, 1, 0), radius=drum, material="steel", motion=turn)
        moved = []
        for step in (1e-3, 5e-4):
            result = carom.simulate(made, until=0.3, step=step, every=round(0.01 / step))
            ball, wall = result["ball"], result.walls["drum"]
            moved.append(np.abs(ball.position - at).max() / drum)
            weight = ball.mass * G
            moment = weight * (drum - R) * math.sin(tilt)
            assert wall.torque[1:, 1] == pytest.approx(-moment, rel=1e-4)
            assert wall.force[1:] == pytest.approx(np.tile([0, 0, -weight], (30, 1)), abs=1e-4 * weight)
            half = 0.5 * rate * np.asarray(result.time)
            turned = np.stack([np.cos(half), 0 * half, np.sin(half), 0 * half], axis=1)
            assert wall.orientation == pytest.approx(turned, abs=1e-14)
        assert moved[0] < 1e-5
        # The start is not free of the step: third order.
        assert moved[0] / moved[1] == pytest.approx(8.0, abs=0.2)


@pytest.fixture(scope="module", params=[False, True], ids=["planes", "rectangles"])
def heap(request: pytest.FixtureRequest) -> carom.Result:
    made = scene(until=0.25)
    made.contact("sand", "sand", friction=0.5, restitution=0.3)
    made.lattice(
        "grain", counts=(2, 2, 2), origin=(0.012, 0.012, 0.012), spacing=0.023, radius=R, density=2500,
        jitter="1 mm", seed=1, material="sand",
    )  # fmt: skip
    made.box(
        "box",
        low=(0, 0, 0),
        high=(0.05, 0.05, 0.3),
        open=["high_z"],
        finite=request.param,
        material="steel",
    )
    return carom.simulate(made, every=10, walls=True)


class TestForces:
    def test_walls_take_what_the_balls_lose(self, heap: carom.Result) -> None:
        """Over each interval: impulse on the walls = that of gravity - change of momentum, to rounding."""
        mass = heap.bodies["mass"]
        momentum = (np.asarray(heap.velocity) * mass[:, None]).sum(axis=1)
        given = sum(wall.impulse for wall in heap.walls.values())[1:]
        gravity = np.outer(np.diff(np.asarray(heap.time)), mass.sum() * heap.gravity)
        assert np.abs(given - gravity + np.diff(momentum, axis=0)).max() < 1e-12 * np.abs(gravity).max()
        assert np.abs(given[:, 2]).max() > 0.5 * np.abs(gravity).max()  # there was something to add up

    def test_recorded_where_asked_for(self, heap: carom.Result) -> None:
        assert heap.wall_names == [f"box.{side}" for side in ("low_x", "high_x", "low_y", "high_y", "low_z")]
        assert len(heap.planes) + (len(heap.walls) - len(heap.planes)) == 5
        rows = heap.contacts.between("box.low_z")
        floor = heap.walls["box.low_z"].impulse.sum(axis=0)
        assert floor == pytest.approx(-np.asarray(rows["impulse"]).sum(axis=0), rel=1e-9, abs=1e-12)

    def test_force_of_what_rests_is_its_weight(self) -> None:
        """Three balls and a fourth on them, in a bowl that is too narrow for them to move."""
        made = scene(mu=1.0, until=0.1)
        made.contact("sand", "sand", friction=1.0, restitution=0.0)
        for k in range(3):
            angle = 2 * math.pi * k / 3
            place = (2 * R / math.sqrt(3) * np.array([math.cos(angle), math.sin(angle), 0])) + [0, 0, R]
            made.sphere(f"low{k}", radius=R, density=2500, at=place, material="sand")
        top = R + 2 * R * math.sqrt(2 / 3)
        made.sphere("top", radius=R, density=2500, at=(0, 0, top), material="sand")
        made.cylinder(
            "cup",
            point=(0, 0, 0),
            axis=(0, 0, 1),
            radius=2 * R / math.sqrt(3) + R,
            length=1,
            material="steel",
        )
        made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), radius=0.1, material="steel")
        result = carom.simulate(made, every=10, walls=True)
        weight = result.bodies["mass"].sum() * G
        assert np.abs(np.asarray(result.velocity)).max() < 1e-8
        total = sum(wall.force for wall in result.walls.values())[1:]
        assert total == pytest.approx(np.tile([0, 0, -weight], (len(total), 1)), abs=1e-8 * weight)


class TestResult:
    def test_not_recorded(self) -> None:
        made = scene(until=0.01)
        made.sphere("ball", radius=R, density=2500, at=(0, 0, R), material="sand")
        made.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="steel")
        result = carom.simulate(made)
        assert result.walls["bed"].position[-1].tolist() == [0, 0, 0]
        with pytest.raises(
            CaromError, match=r"the forces on wall \"bed\" were not recorded; run again with `walls = true`"
        ):
            _ = result.walls["bed"].force
        with pytest.raises(UnknownName, match="no wall is called 'bad'; did you mean bed"):
            result.walls["bad"]
        assert np.asarray(result.present).all()
        assert result.present.shape == (len(result.time), 1)
        with pytest.raises(CaromError):
            _ = carom.simulate(lift(), until=0.01, walls=False).walls["lift"].impulse

    def test_the_file_explains_itself(self, tmp_path: Path) -> None:
        made = lift(rotation={"axis": (0, 0, 1), "rate": 1})
        made.cone(
            "funnel",
            point=(0, 0, 1),
            axis=(0, 0, 1),
            radius=0.1,
            radius_end=0.4,
            length=0.5,
            material="steel",
        )
        carom.simulate(made, until=0.01, out=tmp_path / "run")
        with h5py.File(tmp_path / "run" / "results.h5") as file:
            assert file["frames/walls"].shape[1:] == (2, 6)
            assert file["frames/walls"].attrs["unit"] == "N s, N m s"
            assert file["walls/shape"].asstr()[:].tolist() == ["cone"]
            assert file["walls/radius_end"][:].tolist() == [0.4]
            assert np.isnan(file["walls/size"][:]).all()
            (motion,) = file["planes/motion"].asstr()[:]
        poses = Poses(motion)
        assert poses.moves
        assert poses.displacement(np.array([2.0])).tolist() == [[0, 0, 6]]

    def test_a_run_goes_on_with_its_walls(self, tmp_path: Path, lifted: carom.Result) -> None:
        carom.simulate(lift(), until=0.1, every=10, out=tmp_path / "run")
        whole = carom.resume(tmp_path / "run", until=0.2)
        for name in ("lift",):
            assert (whole.walls[name].impulse == lifted.walls[name].impulse).all()
        assert (np.asarray(whole.position) == np.asarray(lifted.position)).all()

    def test_turning_about_a_point_that_is_carried_along(self) -> None:
        """x = c + d + R (X - c), against a rotation matrix."""
        made = scene()
        about = {"axis": (0, 0, 2), "point": (1, 0, 0), "angle": {"expression": "sin(3*t)"}}
        shift = [{"table": [[0, 0], [1, 2]]}, {"polynomial": [0, 0, 3]}, 0]
        made.plane(
            "w",
            point=(2, 1, 5),
            normal=(0, 0, 1),
            material="steel",
            motion={"translation": shift, "rotation": about},
        )
        motion = motion_for_core(walls(made._tree)[0])
        time = np.linspace(0, 1, 7)
        angle = np.sin(3 * time)
        arm = np.stack([np.cos(angle) - np.sin(angle), np.sin(angle) + np.cos(angle), 5 + 0 * time], axis=1)
        expected = np.array([1, 0, 0]) + arm + np.stack([2 * time, 3 * time**2, 0 * time], axis=1)
        found = Poses(json.dumps(motion)).position(np.array([2.0, 1.0, 5.0]), time)
        assert found == pytest.approx(expected, abs=1e-14)
