"""Random small scenes for the comparison of the core with the oracle, and the judge applied to the core's steps."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from carom import _core
from carom.reference import Reference, judge_step
from carom.reference.conditions import rotation_increment, split_impulse
from carom.reference.contact import Impulse

LAWS = ("sequence", "sequence", "sequence-paper", "one-shot")


def random_scene(seed: int, most: int = 6) -> dict[str, Any]:
    """One to `most` balls, many touching exactly; floor, wall, gravity and each friction law by chance."""
    rng = np.random.default_rng(seed)
    floor = rng.random() < 0.8
    wall = floor and rng.random() < 0.3
    count = int(rng.integers(1, most + 1))
    radius = np.full(count, 0.03) if rng.random() < 0.5 else rng.uniform(0.02, 0.04, count)
    centres: list[np.ndarray] = []
    for r in radius:
        for _ in range(1000):
            x = rng.uniform(-0.15, 0.15, 3)
            if centres and rng.random() < 0.6:
                other = int(rng.integers(len(centres)))
                direction = rng.normal(size=3) * [1, 1, rng.random() < 0.5]
                gap = 0.0 if rng.random() < 0.7 else rng.uniform(0, 0.001)
                x = centres[other] + direction / np.linalg.norm(direction) * (r + radius[other] + gap)
            if floor and (x[2] < r or rng.random() < 0.3):
                x[2] = r
            if wall and x[0] > 0.2 - r:
                continue
            gaps = [np.linalg.norm(x - c) - r - s for c, s in zip(centres, radius, strict=False)]
            if min(gaps, default=1.0) >= -1e-12:
                centres.append(x)
                break
    n = len(centres)
    radius, mass = radius[:n], rng.uniform(0.1, 0.3, n)

    def some(top: float) -> np.ndarray:
        return rng.uniform(0, top, 2) * (rng.random(2) < 0.7)

    return {
        "gravity": np.array([0.0, 0.0, -9.8]) * (rng.random() < 0.8),
        "radius": radius,
        "mass": mass,
        "inertia": mass * radius**2 * rng.uniform(0.3, 0.6, n),
        "position": np.array(centres),
        "orientation": np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
        "velocity": rng.normal(size=(n, 3)) * rng.choice([0, 0.1, 1, 3], size=(n, 1)),
        "angular_velocity": rng.normal(size=(n, 3)) * rng.choice([0, 1, 30], size=(n, 1)),
        "material": np.zeros(n, dtype=np.int64),
        "plane_point": np.array([[0.0, 0, 0]] * floor + [[0.2, 0, 0]] * wall).reshape(-1, 3),
        "plane_normal": np.array([[0.0, 0, 1]] * floor + [[-1.0, 0, 0]] * wall).reshape(-1, 3),
        "plane_material": np.ones(floor + wall, dtype=np.int64),
        "law_a": np.array([0, 0]),
        "law_b": np.array([0, 1]),
        "friction": some(0.6),
        "restitution": rng.choice([0, 0.5, 0.93, 1.0], 2),
        "tangential_restitution": rng.choice([0, 0, 0.4, -0.3], 2),
        "rolling_radius": some(0.004),
        "spinning_radius": some(0.003),
        # Far below what is compared: what differs is then not the stopping of the iterations.
        "options": {
            "step": 1e-3,
            "tolerance": 1e-13,
            "pile_tolerance": 1e-13,
            "tolerance_floor": 1e-15,
            "impact": str(rng.choice(LAWS)),
        },
    }


def nullity(core: _core.Simulation, model: Mapping[str, Any], block: Mapping[str, Any]) -> int:
    """Rows of the step's loaded contacts minus their rank (normal, sliding, rolling and spinning rows of t_{n+1})."""
    n, rows = len(model["radius"]), []
    for (a, b), normal in zip(block["contacts"]["body"], block["contacts"]["normal"], strict=True):
        law = int(b >= n)
        t1 = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        t1 /= np.linalg.norm(t1)
        t2 = np.cross(normal, t1)

        def row(linear: Any, lever: Any, spin: Any, a: int = a, b: int = b) -> np.ndarray:
            out = np.zeros((n, 6))
            out[a, :3], out[a, 3:] = linear, np.multiply(lever, 1.0) + spin
            if b < n:
                out[b, :3] = -np.asarray(linear)
                out[b, 3:] = np.multiply(lever, model["radius"][b] / model["radius"][a]) - spin
            return out.ravel()

        zero, r = np.zeros(3), model["radius"][a]
        rows.append(row(normal, zero, zero))
        if model["friction"][law] > 0:
            rows += [row(t1, -r * t2, zero), row(t2, r * t1, zero)]
        if model["rolling_radius"][law] > 0:
            rows += [row(zero, zero, t1), row(zero, zero, t2)]
        if model["spinning_radius"][law] > 0:
            rows.append(row(zero, zero, normal))
    matrix = np.array(rows).reshape(-1, 6 * n)
    return len(rows) - (int(np.linalg.matrix_rank(matrix, tol=1e-6 * 0.03)) if rows else 0)


def judge_core_step(oracle: Reference, core: _core.Simulation, block: Mapping[str, Any]) -> Any:
    """The oracle's judge on one step of the core; `oracle` holds the state before it, `block` the step's records."""
    model, state = oracle.model, oracle.state
    frame = core.frame()
    u_new = np.concatenate([frame["velocity"], frame["angular_velocity"]], axis=1).reshape(-1)
    psi = rotation_increment(state.q, frame["orientation"])
    contacts, impacts = block["contacts"], block["impacts"]

    def split(key: tuple[int, int], total: np.ndarray, moment: np.ndarray) -> Impulse:
        return split_impulse(model, state, frame["position"], key, total, moment)

    at_position, whole = {}, {}
    for i, pair in enumerate(contacts["body"]):
        key = (int(pair[0]), int(pair[1]))
        if np.any(contacts["position_impulse"][i]):
            at_position[key] = split(key, contacts["position_impulse"][i], contacts["position_moment"][i])
        if np.any(contacts["impulse"][i]):
            whole[key] = split(key, contacts["impulse"][i], contacts["moment"][i])
    law = model.options.impact
    stages: dict[str, dict[tuple[int, int], Impulse]] = {}
    hit: set[int] = set()
    for i, pair in enumerate(impacts["body"]):
        key = (int(pair[0]), int(pair[1]))
        hit |= {b for b in key if b < model.bodies}
        number = int(impacts["problem"][i])
        stage = "one-shot" if law == "one-shot" else "truncated" if number == 51 else str(number)
        stages.setdefault(stage, {})[key] = split(key, impacts["impulse"][i], impacts["moment"][i])
    # Islands without an impact are not in that table: their only problem is the whole impulse.
    first = {"sequence": "0", "sequence-paper": "1", "one-shot": "one-shot"}[law]
    for key, impulse in whole.items():
        if not hit & set(key):
            stages.setdefault(first, {})[key] = impulse
    order = sorted(stages, key=lambda stage: 99 if stage in ("truncated", "one-shot") else int(stage))
    scales = [1.0] * len(order)
    return judge_step(
        model, state, frame["position"], u_new, psi, at_position, [(s, stages[s]) for s in order], scales
    )
