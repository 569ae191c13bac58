"""What is said of a run when it ends: one dictionary, in `run.json`, printed by `carom run` and given by `--json`."""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

import carom
from carom import _core
from carom.errors import quoted
from carom.result.kinematics import QUANTITIES
from carom.run import checkpoint

if TYPE_CHECKING:
    from carom._core import Simulation
    from carom.scene.plan import Plan
    from carom.scene.scene import Scene

#: Final states are listed by name up to this many bodies.
LISTED_BODIES = 100


@cache
def versions() -> dict[str, Any]:
    """What computed the run, without naming the machine: versions, build of the core if it is known, kind of processor."""
    build = checkpoint.build()
    return {
        "carom": carom.__version__,
        "core": _core.__version__,
        **({"build": build} if build else {}),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "h5py": h5py.__version__,
        "hdf5": h5py.version.hdf5_version,
        "system": platform.system(),
        "architecture": platform.machine(),
    }


def summary(scene: Scene, simulation: Simulation, plan: Plan, about: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of a run, over all its segments. Keys are those of `carom run --json`; all values are plain Python."""
    totals, names = plain(simulation.monitors()), scene.names
    segments = about["segments"]
    found: dict[str, Any] = {
        "scenario": about["scenario"].get("file") or about["scenario"].get("title"),
        "title": scene.title,
        **{key: about["scenario"][key] for key in ("case", "parameters") if key in about["scenario"]},
        "method": scene.run.method,
        "step": plan.step,
        "steps": simulation.step,
        "time": simulation.time,
        "outcome": about["outcome"]["kind"],
        "failure": None if about["status"] in ("done", "stopped", "interrupted") else about["outcome"],
        "wall_s": sum(s["wall_s"] for s in segments),
        "core_s": sum(s["core_s"] for s in segments),
        "phases": _phases(segments),
        "bodies_count": len(names),
    }
    found |= {key: value for key, value in totals.items() if key not in found}
    if len(names) <= LISTED_BODIES:
        frame = simulation.frame()
        there = frame.get("present")
        found["bodies"] = {
            name: {k: plain(frame[k][i]) for k in QUANTITIES}
            for i, name in enumerate(names)
            if there is None or there[i]
        }
    return found


def _phases(segments: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Seconds by phase, over all parts of a run but those that were killed."""
    spent: Counter[str] = Counter()
    for segment in segments:
        spent.update(segment.get("phases", {}))
    return dict(spent)


def named(
    outcome: Mapping[str, Any], bodies: Sequence[str], walls: Sequence[str], joints: Sequence[str]
) -> dict[str, Any]:
    """An outcome of the core with names instead of indices in `bodies`, that of its joint in the message, and only plain
    values.
    """
    found: dict[str, Any] = plain(outcome)
    if (joint := found.pop("joint", None)) is not None:
        found["message"] = f"joint {quoted(joints[joint])}: {found['message']}"
    names = [*bodies, *walls]
    if found.get("bodies") is not None:
        found["bodies"] = [names[i] if 0 <= i < len(names) else str(i) for i in found["bodies"]]
    return found


def plain(value: Any) -> Any:
    """The same tree with Python's own numbers, lists and dicts: what JSON can hold."""
    if value is None or (isinstance(value, (str, float, int)) and not isinstance(value, np.generic)):
        return value
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return value
