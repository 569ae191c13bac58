"""Joints and loads as the arrays that go to the core, built from points in fixed axes; all bodies start unturned."""

from typing import Any

import numpy as np

G = 9.8
AXES = np.eye(3)


def constant(x: float) -> tuple[str, float]:
    return ("constant", float(x))


def polynomial(*coefficients: float) -> tuple[str, list[float]]:
    """Rising powers."""
    return ("polynomial", list(coefficients))


STILL = constant(0.0)


def scene(
    position: Any, velocity: Any = None, spin: Any = None, *, radius: float = 0.1, mass: Any = 1.0, g: Any = (0.0, 0.0, -G),
    joints: Any = (), loads: Any = (), planes: Any = (), law: Any = None, **options: Any,
) -> dict[str, Any]:  # fmt: skip
    """Homogeneous spheres of one radius; `law` holds for spheres and planes alike; `planes` are (point, normal)."""
    x = np.array(position, dtype=float)
    n = len(x)
    masses = np.broadcast_to(np.asarray(mass, dtype=float), n).copy()
    law = {"friction": 0.0, "restitution": 0.0} | (law or {})
    slip = law.pop("friction_law", None)
    names = ("friction", "restitution", "tangential_restitution", "rolling_radius", "spinning_radius")
    return {
        "gravity": np.array(g, dtype=float),
        "radius": np.full(n, radius),
        "mass": masses,
        "inertia": 0.4 * masses * radius**2,
        "position": x,
        "orientation": np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        "velocity": np.zeros((n, 3)) if velocity is None else np.array(velocity, dtype=float),
        "angular_velocity": np.zeros((n, 3)) if spin is None else np.array(spin, dtype=float),
        "material": np.zeros(n, dtype=np.int64),
        "plane_point": np.array([p for p, _ in planes], dtype=float).reshape(-1, 3),
        "plane_normal": np.array([d for _, d in planes], dtype=float).reshape(-1, 3),
        "plane_material": np.zeros(len(planes), dtype=np.int64),
        "law_a": np.array([0]),
        "law_b": np.array([0]),
        **{name: np.array([float(law.get(name, 0.0))]) for name in names},
        "friction_law": [slip],
        "joints": list(joints),
        "loads": list(loads),
        "options": {"step": 1e-3} | options,
    }


def arms(x: Any, a: int, b: int, point_a: Any, point_b: Any) -> tuple[np.ndarray, np.ndarray]:
    """Attachment points in the frames of their bodies; x (N,3) centres; None is the centre."""
    at_a = np.zeros(3) if point_a is None else np.subtract(point_a, x[a])
    if b < 0:
        return at_a, np.array(point_b, dtype=float)
    return at_a, np.zeros(3) if point_b is None else np.subtract(point_b, x[b])


def held(x: Any, a: int, b: int, point: Any, directions: Any = AXES, law: Any = STILL) -> dict[str, Any]:
    """A common point of A and B, or of A and the ground (b = -1), in some directions: fix, line, plane, ball, motion."""
    at_a, at_b = arms(x, a, b, point, point)
    rows = [("point", np.array(d, dtype=float), at_a, at_b, law) for d in directions]
    return {"a": a, "b": b, "rows": rows}


def rod(x: Any, a: int, b: int, point_a: Any = None, point_b: Any = None, law: Any = None) -> dict[str, Any]:
    """A distance between two points: as at the start, or by a law."""
    at_a, at_b = arms(x, a, b, point_a, point_b)
    start = x[a] + at_a - at_b - (x[b] if b >= 0 else 0.0)
    return {
        "a": a,
        "b": b,
        "rows": [("distance", np.zeros(3), at_a, at_b, law or constant(np.linalg.norm(start)))],
    }


def locked(a: int, b: int = -1, axes: Any = AXES, law: Any = STILL) -> dict[str, Any]:
    """No rotation, or a prescribed one, about axes."""
    return {
        "a": a,
        "b": b,
        "rows": [("rotation", np.array(e, dtype=float), np.zeros(3), np.zeros(3), law) for e in axes],
    }


def spring(
    x: Any, a: int, b: int, point_a: Any = None, point_b: Any = None, *, k: float = 0.0, c: float = 0.0, rest: float = 0.0
) -> dict[str, Any]:  # fmt: skip
    at_a, at_b = arms(x, a, b, point_a, point_b)
    return {"kind": "spring", "a": a, "b": b, "arm_a": at_a, "arm_b": at_b,
            "stiffness": k, "damping": c, "rest_length": rest}  # fmt: skip


def drag(body: int, translation: float = 0.0, rotation: float = 0.0) -> dict[str, Any]:
    return {"kind": "drag", "body": body, "translation": translation, "rotation": rotation}


def push(body: int, force: Any = (STILL,) * 3, torque: Any = (STILL,) * 3) -> dict[str, Any]:
    return {"kind": "force", "body": body, "force": list(force), "torque": list(torque)}
