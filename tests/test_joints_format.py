"""The table [[joint]]: what it means in rows, how it is written, and what the core does with it."""

from __future__ import annotations

import re
from typing import Any

import jsonschema
import numpy as np
import pytest
from carom import ScenarioError, Scene
from carom.scene.toml.schema import json_schema
from hypothesis import given
from hypothesis import strategies as st
from joint_format_scenes import TURNED, R, X, Y, Z, all_types, balls, unit_quaternion

ANY_POINT = (0.3, -0.2, 1.1)
CONSTANT = ("constant", 0.0)


def joint_of(scene: Scene, **keys: Any) -> dict[str, Any]:
    """The first joint as the core gets it."""
    kind = keys.pop("type")
    scene.joint(kind, **keys)
    assert scene.validate() == []
    return scene.to_model()["joints"][0]


def matrix(q: Any) -> np.ndarray:
    """Rotation of a quaternion, w first, by its definition q (0, v) q*."""
    w, x, y, z = np.array(q) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class TestRows:
    @pytest.mark.parametrize(
        ("keys", "expected"),
        [
            ({"type": "fix"}, [("point", X), ("point", Y), ("point", Z)]),
            ({"type": "plane", "normal": (0, 0, 3)}, [("point", Z)]),
            ({"type": "lock"}, [("rotation", X), ("rotation", Y), ("rotation", Z)]),
            ({"type": "lock", "axes": [(0, 2, 0)]}, [("rotation", Y)]),
            ({"type": "motion", "direction": (5, 0, 0), "displacement": 0.0}, [("point", X)]),
            ({"type": "motion", "axis": (0, 0, 5), "angle": 0.0}, [("rotation", Z)]),
        ],
        ids=lambda x: x["type"] if isinstance(x, dict) else "",
    )
    def test_of_a_body_and_the_ground(self, keys: dict[str, Any], expected: list[tuple[str, Any]]) -> None:
        joint = joint_of(balls(), body="a", **keys)
        assert (joint["a"], joint["b"]) == (0, -1)
        assert [(kind, direction) for kind, direction, *_ in joint["rows"]] == expected
        for kind, _, arm_a, arm_b, law in joint["rows"]:
            assert arm_a == [0, 0, 0]
            assert arm_b == ([0, 0, 1] if kind == "point" else [0, 0, 0])
            assert law == CONSTANT

    @given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 1e-3))
    def test_a_line_leaves_its_direction_free(self, direction: tuple[float, float, float]) -> None:
        joint = joint_of(balls(), type="line", body="a", direction=direction)
        frame = np.array([direction / np.linalg.norm(direction), *(row[1] for row in joint["rows"])])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
        assert {row[0] for row in joint["rows"]} == {"point"}

    @pytest.mark.parametrize("kind", ["fix", "line", "plane", "motion"])
    def test_arms_are_those_of_the_turned_body(self, kind: str) -> None:
        more: dict[str, Any] = {
            "line": {"direction": X},
            "plane": {"normal": X},
            "motion": {"direction": X, "displacement": 0},
        }.get(kind, {})
        joint = joint_of(
            balls(orientation=unit_quaternion(TURNED)), type=kind, body="a", point=ANY_POINT, **more
        )
        for _, _, arm_a, arm_b, _ in joint["rows"]:
            np.testing.assert_allclose(matrix(TURNED) @ arm_a + [0, 0, 1], ANY_POINT, atol=1e-15)
            assert arm_b == list(ANY_POINT)

    def test_of_a_ball_joint(self) -> None:
        scene = balls(orientation=unit_quaternion(TURNED))
        joint = joint_of(scene, type="ball", between=("b", "a"), point=ANY_POINT)
        assert (joint["a"], joint["b"]) == (1, 0)
        assert [row[:2] for row in joint["rows"]] == [("point", X), ("point", Y), ("point", Z)]
        for _, _, arm_b, arm_a, law in joint["rows"]:
            np.testing.assert_allclose(matrix(TURNED) @ arm_a + [0, 0, 1], ANY_POINT, atol=1e-15)
            np.testing.assert_allclose(arm_b, np.subtract(ANY_POINT, [0, 0, 2]), atol=1e-15)
            assert law == CONSTANT

    def test_of_a_rod(self) -> None:
        joint = joint_of(balls(), type="rod", between=("a", "b"))
        assert joint == {
            "a": 0,
            "b": 1,
            "rows": [("distance", [0, 0, -1], [0, 0, 0], [0, 0, 0], ("constant", 1.0))],
        }

    def test_the_ground_is_always_second(self) -> None:
        ends = [(3.0, 0, 0.5), (0, 0, 1.1)]
        first = joint_of(balls(), type="rod", between=("ground", "a"), points=ends)
        second = joint_of(balls(), type="rod", between=("a", "ground"), points=ends[::-1])
        assert first == second
        assert (first["a"], first["b"]) == (0, -1)
        ((_, _, arm_a, arm_b, (_, length)),) = first["rows"]
        np.testing.assert_allclose(arm_a, [0, 0, 0.1], atol=1e-15)
        assert arm_b == [3, 0, 0.5]
        assert length == pytest.approx(np.hypot(3, 0.6), rel=1e-15)
        locked = joint_of(balls(), type="lock", between=("ground", "a"), axes=[Z])
        assert (locked["a"], locked["b"]) == (0, -1)

    def test_laws_go_with_the_rows(self) -> None:
        law = {"expression": "1 + 0.1*sin(t)"}
        joint = joint_of(balls(velocity=(0, 0, -0.1)), type="rod", between=("a", "b"), length=law)
        assert joint["rows"][0][-1] == ("expression", law["expression"])
        joint = joint_of(balls(), type="motion", body="a", axis=Z, angle={"polynomial": [0, 0, 3]})
        assert joint["rows"][0][-1] == ("polynomial", [0, 0, 3])
        joint = joint_of(
            balls(velocity=(2, 0, 0)),
            type="motion",
            body="a",
            direction=X,
            displacement={"table": [[0, 0], [0.5, 1]]},
        )
        assert joint["rows"][0][-1] == ("table", [[0, 0], [0.5, 1]])

    def test_balls_of_generators_can_be_joined(self) -> None:
        scene = balls()
        scene.lattice("l", counts=(2, 2, 1), origin=(5, 0, 0), spacing=1, radius=R, mass=1, material="m")
        scene.joint("rod", between=("l2", "b"))
        scene.joint("fix", body="l4")
        scene.validate()
        joints = scene.to_model()["joints"]
        assert [(j["a"], j["b"]) for j in joints] == [(3, 1), (5, -1)]
        resolved = Scene.from_toml(scene.to_toml(resolved=True))
        assert resolved.to_model()["joints"] == joints
        assert "lattice" not in resolved.to_toml()

    def test_no_joints_no_key(self) -> None:
        assert not {"joints", "loads", "friction_law"} & set(balls().to_model())


class TestText:
    def test_nothing_is_lost(self) -> None:
        scene = all_types()
        text = scene.to_toml()
        again = Scene.from_toml(text)
        assert again == scene
        assert again.to_toml() == text
        assert again.to_model()["joints"] == scene.to_model()["joints"]
        assert len(scene.to_model()["joints"]) == 9

    def test_the_resolved_form_has_the_names(self) -> None:
        scene = all_types()
        resolved = Scene.from_toml(scene.to_toml(resolved=True))
        assert (
            resolved.joint_names
            == scene.joint_names
            == ["joint1", "axle", *(f"joint{k}" for k in range(3, 10))]
        )
        assert [*re.findall(r'\[\[joint\]\]\nname = "(.*)"', resolved.to_toml())] == scene.joint_names
        assert resolved.to_model()["joints"] == scene.to_model()["joints"]

    def test_satisfies_the_published_schema(self) -> None:
        import tomllib

        schema = jsonschema.Draft202012Validator(json_schema())
        raw = tomllib.loads(all_types().to_toml())
        schema.validate(raw)
        for wrong in (
            {"type": "fix"},
            {"type": "fix", "body": "a", "normal": Z},
            {"type": "lock", "body": "a", "between": ["a", "b"]},
            {"type": "motion", "body": "a", "direction": X},
            {"type": "hinge", "body": "a"},
            {"type": "rod", "between": ["a", "b"], "length": {"polynom": [1]}},
            {"type": "lock", "body": "a", "axes": []},
        ):
            assert not schema.is_valid({**raw, "joint": [wrong]}), wrong

    def test_a_joint_may_be_changed(self) -> None:
        scene = balls()
        rod = scene.joint("rod", between=("a", "b"))
        rod.length = "100 cm"
        assert rod.length == 1.0
        with pytest.raises(ScenarioError, match=r'scene.joint\("rod"\): length: must be positive, found -1'):
            rod.length = -1
        with pytest.raises(ScenarioError, match='a joint of type "rod" has no key axis'):
            rod.axis = Z


# --- runs: the core does with the rows what the words say ---------------------------------------------------------------


def moving(**joint: Any) -> tuple[np.ndarray, ...]:
    """Times (T,), and positions (T, 3) and rotations (T, 3, 3) of `a` and `b` that gravity, forces and torques move."""
    import carom

    scene = balls(orientation=unit_quaternion(TURNED))
    scene.gravity = (1.0, -2.0, -9.8)
    scene.load("a", force=(3, 1, {"expression": "20*sin(9*t)"}), torque=(0.01, -0.02, 0.03))
    scene.load("b", force=(-1, 0, 5), torque=(0.02, 0.01, -0.01))
    scene.joint(joint.pop("type"), **joint)
    result = carom.simulate(scene, until=0.2, every=10)
    a, b = (np.array([matrix(q) for q in result.orientation[:, k]]) for k in (0, 1))
    return result.time, result.position[:, 0], a, result.position[:, 1], b


def carried(x: np.ndarray, turn: np.ndarray, point: Any) -> np.ndarray:
    """Where a point of a body, `point` at the start, is at each time, (T, 3)."""
    return x + turn @ turn[0].T @ (np.array(point) - x[0])


def turned_about(turn: np.ndarray, axis: Any) -> np.ndarray:
    """Sum of the angles about a fixed axis from frame to frame, (T,): for small steps the integral of w . axis."""
    steps = turn[1:] @ turn[:-1].transpose(0, 2, 1)
    skew = (steps - steps.transpose(0, 2, 1)) / 2
    angles = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1) @ axis
    return np.concatenate([[0.0], np.cumsum(angles)])


class TestRuns:
    POINT = (0.05, 0.02, 1.03)

    def test_fix(self) -> None:
        _, x, turn, *_ = moving(type="fix", body="a", point=self.POINT)
        np.testing.assert_allclose(carried(x, turn, self.POINT), [self.POINT] * len(x), atol=1e-12)
        assert np.ptp(x, axis=0).max() > 1e-3

    def test_line(self) -> None:
        direction = np.array([2, 1, -0.5]) / np.linalg.norm([2, 1, -0.5])
        _, x, turn, *_ = moving(type="line", body="a", point=self.POINT, direction=direction)
        way = carried(x, turn, self.POINT) - self.POINT
        np.testing.assert_allclose(way - np.outer(way @ direction, direction), 0, atol=1e-12)
        assert np.abs(way).max() > 5e-3

    def test_plane(self) -> None:
        normal = np.array([2, -1, 0.5]) / np.linalg.norm([2, -1, 0.5])
        _, x, turn, *_ = moving(type="plane", body="a", point=self.POINT, normal=normal)
        way = carried(x, turn, self.POINT) - self.POINT
        np.testing.assert_allclose(way @ normal, 0, atol=1e-12)
        assert np.linalg.matrix_rank(way, tol=1e-4) == 2

    def test_lock(self) -> None:
        _, x, turn, *_ = moving(type="lock", body="a")
        np.testing.assert_allclose(turn, [turn[0]] * len(turn), atol=1e-12)
        assert np.ptp(x, axis=0).max() > 0.02

    def test_lock_between(self) -> None:
        _, _, turn, _, other = moving(type="lock", between=("a", "b"))
        np.testing.assert_allclose(other.transpose(0, 2, 1) @ turn, [turn[0]] * len(turn), atol=1e-12)
        assert np.abs(other[-1] - np.eye(3)).max() > 1e-3

    def test_ball(self) -> None:
        point = (0.02, 0, 1.5)
        _, x, turn, y, other = moving(type="ball", between=("a", "b"), point=point)
        np.testing.assert_allclose(carried(x, turn, point), carried(y, other, point), atol=1e-12)
        assert np.abs(turn[-1] - turn[0]).max() > 1e-2

    def test_rod(self) -> None:
        law = {"polynomial": [0.8, 0, 2.0]}
        ends = [(0, 0, 1.1), (0, 0, 1.9)]
        t, x, turn, y, other = moving(type="rod", between=("a", "b"), points=ends, length=law)
        length = np.linalg.norm(carried(x, turn, ends[0]) - carried(y, other, ends[1]), axis=1)
        np.testing.assert_allclose(length, 0.8 + 2 * t**2, atol=1e-12)

    def test_motion_along_a_direction(self) -> None:
        law = {"expression": "0.05*(1 - cos(20*t))"}
        t, x, turn, *_ = moving(
            type="motion", body="a", point=self.POINT, direction=(0, 3, 0), displacement=law
        )
        way = carried(x, turn, self.POINT) - self.POINT
        np.testing.assert_allclose(way[:, 1], 0.05 * (1 - np.cos(20 * t)), atol=1e-12)
        assert np.abs(way[-1, 2]) > 0.02

    def test_motion_about_an_axis(self) -> None:
        """The angle is the integral of w . axis, which the frames give to the second order of their distance."""
        t, _, turn, *_ = moving(
            type="motion", body="a", axis=(0, 0, 2), angle={"table": [[0, 0], [0.1, 0], [0.2, 0.4]]}
        )
        np.testing.assert_allclose(turned_about(turn, Z), np.interp(t, [0.1, 0.2], [0, 0.4]), atol=2e-3)
        assert np.abs(turn[-1] - turn[0]).max() > 1e-2
