"""Random small scenes for the comparison of the core with the oracle, and the judge applied to the core's steps."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from carom import _core
from carom.scene.tables.options import MOST_PROBLEMS
from joint_scenes import drag, held, locked, polynomial, push, rod, spring
from oracle import Reference, judge_step
from oracle.conditions import split_impulse
from oracle.contact import Impulse, gap_and_normal
from oracle.joint import JointsAt, rates, read_joints
from oracle.model import Model, State
from oracle.pose import Pose, rotation_increment, rotation_matrices

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
            # The oracle has joints, loads and the safeguard for this law; test_loads_once.py compares the other one.
            "position_friction": "paper",
        },
    }


# ---------------------------------------------------------------------------------------------- joints and loads


def unit(rng: np.random.Generator) -> np.ndarray:
    d = rng.normal(size=3)
    return d / np.linalg.norm(d)


def some_law(rng: np.random.Generator, size: float) -> tuple[str, Any]:
    """A law of t that is 0 at 0, with a rate of about `size` per second."""
    a, b = rng.normal(size=2) * size
    kind = rng.integers(3)
    if kind == 0:
        return polynomial(0.0, a, 10.0 * b)
    if kind == 1:  # the knots lie beside the steps
        return ("table", [[-1.0, -a], [0.00225, 0.00225 * a], [1.0, 0.00225 * a + b]])
    return ("expression", f"{a:.17g}*sin(20*t)/20 + {b:.17g}*t^2")


def some_joint(
    rng: np.random.Generator, x: np.ndarray, radius: np.ndarray, free: list[int]
) -> dict[str, Any]:
    """Any type; joints to the ground take a body of `free`."""
    n = len(x)
    if n > 1 and (not free or rng.random() < 0.5):
        kind = rng.choice(["ball", "rod", "lock", "spin"])
        a, b = (int(i) for i in rng.choice(n, 2, replace=False))
    else:
        kind = rng.choice(["fix", "line", "plane", "motion", "motion", "spin", "rod", "lock"])
        a, b = int(rng.choice(free)) if free else 0, -1

    def on(body: int) -> np.ndarray:
        return x[body] + unit(rng) * radius[body] * rng.choice([0.0, 0.5, 1.0, 3.0])

    if kind == "rod":
        ends = on(a), on(b) if b >= 0 else x[a] + unit(rng) * rng.uniform(0.1, 0.4)
        length, rate = float(np.linalg.norm(ends[0] - ends[1])), rng.normal() * rng.choice([0.0, 0.0, 0.5])
        return rod(x, a, b, *ends, polynomial(length, rate))
    if kind == "lock":
        return locked(a, b, np.linalg.qr(rng.normal(size=(3, 3)))[0][: rng.integers(1, 4)])
    if kind == "spin":
        return locked(a, b, [unit(rng)], some_law(rng, 5.0))
    if kind == "motion":
        return held(x, a, b, on(a), [unit(rng)], some_law(rng, 0.5))
    count = {"fix": 3, "ball": 3, "line": 2, "plane": 1}[kind]
    return held(x, a, b, on(a), np.linalg.qr(rng.normal(size=(3, 3)))[0][:count])


def some_load(rng: np.random.Generator, scene: Mapping[str, Any]) -> dict[str, Any]:
    x, mass, radius = scene["position"], scene["mass"], scene["radius"]
    n = len(x)
    a, m, omega = int(rng.integers(n)), float(mass.mean()), rng.choice([10.0, 100.0])
    kind = rng.integers(5)
    if kind <= 1:
        b = int(rng.choice([i for i in range(n) if i != a])) if n > 1 and kind == 0 else -1
        points = [x[i] + unit(rng) * radius[i] * rng.choice([0.0, 1.0]) for i in (a, b)]
        if b < 0:
            points[1] = x[a] + unit(rng) * rng.uniform(0.1, 0.3)
        rest = np.linalg.norm(points[0] - points[1]) * rng.uniform(0.7, 1.3)
        k, c = m * omega**2 * (rng.random() < 0.9), m * omega * rng.choice([0.0, 0.2])
        return spring(x, a, b, *points, k=k + (c == 0.0), c=c, rest=rest)
    if kind == 2:
        return drag(a, m * rng.uniform(0, 20), m * radius[a] ** 2 * rng.uniform(0, 20))
    if kind == 3:
        laws = [some_law(rng, 100.0 * m) for _ in range(6)]
        return push(a, laws[:3], [(kind, _scaled(data, radius[a])) for kind, data in laws[3:]])
    wind = rng.normal(size=(3, 6)) * m * np.repeat([10.0, 10.0 * radius[a]], 3)

    def blow(t: float, x: Any, v: Any, w: Any) -> Any:
        return np.sin(3.0 * x) @ wind + np.tanh(v + 10.0 * t) @ wind

    return {"kind": "callable", "function": blow}


def _scaled(data: Any, factor: float) -> Any:
    if isinstance(data, str):
        return f"{factor:.17g}*({data})"
    return (np.array(data) * ([1.0, factor] if np.ndim(data) == 2 else factor)).tolist()


def independent(model: dict[str, Any], near: float = 0.01) -> bool:
    """Whether the rows of the joints and the normals of contacts that may come soon are clearly independent."""
    reference = Model.from_dict(model)
    x = reference.position
    rows = list(at_start(reference).gradient)
    for pair in reference.pairs:
        gap, normal, _ = gap_and_normal(reference, pair, x)
        if gap < near:
            row = np.zeros(6 * reference.bodies)
            row[6 * pair.a : 6 * pair.a + 3] = normal
            if pair.plane < 0:
                row[6 * pair.b : 6 * pair.b + 3] = -normal
            rows.append(row)
    matrix = np.array(rows).reshape(-1, 6 * reference.bodies) / np.sqrt(reference.mass_diagonal)
    if not len(matrix):
        return True
    matrix = matrix / np.linalg.norm(matrix, axis=1, keepdims=True)
    if len(matrix) > matrix.shape[1]:
        return False
    return float(np.linalg.svd(matrix, compute_uv=False)[-1]) > 0.05


def at_start(model: Model) -> JointsAt:
    x = model.position
    return JointsAt(model.joints, Pose(x, np.zeros_like(x), rotation_matrices(model.orientation)))


def random_linked_scene(seed: int) -> dict[str, Any]:
    """`random_scene` with joints, loads and friction laws by chance; its velocities fit the joints."""
    rng = np.random.default_rng([seed, 7])
    model = random_scene(seed, 5)
    x, radius, floor = model["position"], model["radius"], len(model["plane_point"])
    model |= {"joints": [], "loads": [], "friction_law": [None] * len(model["law_a"])}
    # what lies on a plane is not nailed down as well: its contact would have nothing to say
    free = [i for i in range(len(x)) if not floor or x[i, 2] > radius[i] + 1e-3]
    for _ in range(rng.integers(1, 4)):
        joint = some_joint(rng, x, radius, free)
        a, b = joint["a"], joint["b"]
        # two balls that touch and hang in one point: friction has more rows than the pair has freedom
        touch = b >= 0 and np.linalg.norm(x[a] - x[b]) < radius[a] + radius[b] + 1e-3
        if touch and len(joint["rows"]) == 3 and joint["rows"][0][0] == "point":
            continue
        model["joints"].append(joint)
        if not independent(model):
            model["joints"].pop()
        elif rng.random() < 0.1:
            model["joints"].append(joint)  # said twice: multipliers are not unique, the motion is
    model["loads"] = [some_load(rng, model) for _ in range(rng.integers(0, 4))]
    for i in range(len(model["friction_law"])):
        if rng.random() < 0.3:
            a, b = rng.uniform(0, 0.4, 2)
            laws = [
                polynomial(a, 0.1 * b),
                ("table", [[0.0, a + b], [1.0, a]]),
                ("expression", f"{a} + {b}*exp(-2*v)"),
            ]
            model["friction_law"][i] = laws[rng.integers(3)]
            model["friction"][i] = 0.0
    free_motion = np.concatenate([model["velocity"], model["angular_velocity"]], axis=1).reshape(-1)
    while True:
        reference = Model.from_dict(model)
        joints, root = at_start(reference), 1.0 / np.sqrt(reference.mass_diagonal)
        miss = rates(joints.rows, 0.0) - joints.gradient @ free_motion
        u = free_motion + root * np.linalg.lstsq(joints.gradient * root, miss, rcond=1e-10)[0]
        model["velocity"], model["angular_velocity"] = (
            u.reshape(-1, 6)[:, :3].copy(),
            u.reshape(-1, 6)[:, 3:].copy(),
        )
        spin = radius * np.linalg.norm(model["angular_velocity"], axis=1)
        # a short lever near its dead point would have to turn too fast: without the last joint
        if not model["joints"] or float(np.max(spin)) < 4.0:
            return model
        model["joints"].pop()


# ---------------------------------------------------------------------------------------------- comparison


def nullity(core: _core.Simulation, model: Mapping[str, Any], block: Mapping[str, Any]) -> int:
    """Rows of the step's loaded contacts (normal, sliding, rolling, spinning; of t_{n+1}) minus their rank.

    With joints the rank is that of what the joints leave free: friction on a pinned body may have several answers.
    """
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
        if model["friction"][law] > 0 or model.get("friction_law", [None, None])[law] is not None:
            rows += [row(t1, -r * t2, zero), row(t2, r * t1, zero)]
        if model["rolling_radius"][law] > 0:
            rows += [row(zero, zero, t1), row(zero, zero, t2)]
        if model["spinning_radius"][law] > 0:
            rows.append(row(zero, zero, normal))
    matrix = np.array(rows).reshape(-1, 6 * n)
    joints = joints_of(model, core.frame())
    if len(joints):
        matrix = matrix - matrix @ np.linalg.pinv(joints, rcond=1e-10) @ joints
    return len(rows) - (int(np.linalg.matrix_rank(matrix, tol=1e-6 * 0.03)) if rows else 0)


def joints_of(model: Mapping[str, Any], frame: Mapping[str, Any]) -> np.ndarray:
    """Gradients of the joints (m, 6N) in a frame of the core."""
    x = frame["position"]
    return JointsAt(
        read_joints(model), Pose(x, np.zeros_like(x), rotation_matrices(frame["orientation"]))
    ).gradient


def core_state(core: _core.Simulation) -> State:
    """The state of the core as the oracle holds it: a step of the one can start where the other stands."""
    s = core.state()
    u = np.concatenate([s["velocity"], s["angular_velocity"]], axis=1).reshape(-1)
    a, acc = (s[name].reshape(-1).copy() for name in ("pseudo", "acceleration"))
    reactions = (s[name].copy() for name in ("joint_reaction", "joint_pseudo"))
    return State(s["position"].copy(), s["orientation"].copy(), u, a, acc, int(s["step"][0]), *reactions)


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
        stage = "one-shot" if law == "one-shot" else "truncated" if number > MOST_PROBLEMS else str(number)
        stages.setdefault(stage, {})[key] = split(key, impacts["impulse"][i], impacts["moment"][i])
    # Islands without an impact are not in that table: their only problem is the whole impulse.
    first = {"sequence-paper": "1", "one-shot": "one-shot"}.get(law, "0")
    for key, impulse in whole.items():
        if not hit & set(key):
            stages.setdefault(first, {})[key] = impulse
    order = sorted(stages, key=lambda stage: 99 if stage in ("truncated", "one-shot") else int(stage))
    scales = [1.0] * len(order)
    return judge_step(
        model, state, frame["position"], u_new, psi, at_position, [(s, stages[s]) for s in order], scales
    )
