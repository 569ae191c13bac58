"""Random scenes for the auditor: balls in crates and on lumps of triangles that rest, shake and turn.

python tests/audit_meshes.py 200         # simulates and judges 200 scenes, and says which were found at fault
python tests/audit_meshes.py 1 37        # the scene of seed 37 alone, and the report on it
"""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
from audit_random import main
from meshes import box, floor, globe
from numpy.typing import NDArray

F64 = NDArray[np.float64]
UNTIL = 0.2
"""Duration, s."""
R = 0.01


def scene(seed: int) -> tuple[carom.Scene, dict[str, Any]]:
    """The scene of a number, and options of its run: `run` of `audit_scenes` takes both."""
    rng = np.random.default_rng([seed, 31])
    made = carom.Scene(gravity=(0, 0, -9.8))
    for other in ("ball", "wall"):
        law = {
            "friction": float(rng.choice([0.0, 0.3, 0.6])),
            "restitution": float(rng.choice([0.0, 0.5, 0.9])),
        }
        if rng.random() < 0.3:
            law["rolling_radius"] = 2e-4
        made.contact("ball", other, **law)
    kind = str(rng.choice(["crate", "crate", "floor"]))
    if kind == "crate":
        points, triangles = box((-0.1, -0.1, 0.0), (0.1, 0.1, 0.2))
    else:
        points, triangles = floor(int(rng.integers(1, 9)), seed=seed)
        points = 0.4 * points - [0.2, 0.2, 0.0]
    made.mesh(kind, vertices=points, triangles=triangles, material="wall", motion=_motion(rng))
    if rng.random() < 0.7:
        points, triangles = globe(
            int(rng.integers(3, 7)), int(rng.integers(4, 9)), float(rng.uniform(0, 0.6)), seed
        )
        turn = rng.normal(size=4)
        made.mesh(
            "lump", vertices=points, triangles=triangles, scale=0.03, point=(0.0, 0.0, 0.06), material="wall",
            orientation=tuple((turn / np.linalg.norm(turn)).tolist()), motion=_motion(rng),
        )  # fmt: skip
    places: list[F64] = []
    for _ in range(200):
        at = rng.uniform((-0.08, -0.08, 0.02), (0.08, 0.08, 0.18))
        apart = all(np.linalg.norm(at - other) > 2.1 * R for other in places)
        if apart and np.linalg.norm(at - [0.0, 0.0, 0.06]) > 0.055 and len(places) < 1 + seed % 7:
            places.append(at)
    for k, at in enumerate(places):
        velocity = tuple(rng.uniform(-1.0, 1.0, 3).tolist())
        made.sphere(
            f"b{k}", radius=R, density=2500, position=tuple(at.tolist()), velocity=velocity, material="ball"
        )
    options: dict[str, Any] = {
        "method": str(rng.choice(["nsga", "nsga", "moreau"])),
        "every": int(rng.choice([1, 1, 4])),
        "step": float(rng.choice([1e-3, 5e-4])),
        "walls": True,
    }
    return made, options


def _motion(rng: np.random.Generator) -> dict[str, Any] | None:
    which = rng.random()
    if which < 0.3:
        axis = rng.normal(size=3).tolist()
        return {"rotation": {"axis": axis, "point": [0.0, 0.0, 0.1], "rate": float(rng.uniform(-3.0, 3.0))}}
    if which < 0.5:
        return {"translation": [0.0, {"expression": "0.004*sin(60*t)"}, 0.0]}
    return None


if __name__ == "__main__":
    main(scene, UNTIL)
