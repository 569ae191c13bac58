"""A stand-in for the compiled core and for `carom.Scene`: free flight over planes, in a page of NumPy.

It keeps the whole interface of `_core.pyi`, so that recording, resuming, reading and the command line can be
tested for what they do when a core is slow, fails or is killed, which the real one cannot be asked to do. No
physics is tested here.
"""

from __future__ import annotations

import sys
import time
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

__version__ = "fake"
COUNTS = (
    "iterations_smooth iterations_position iterations_velocity line_search_position line_search_velocity"
    " impact_problems contacts islands largest_island fallbacks truncated unconverged halvings missed_impacts"
    " relisted candidates entered handovers removed stepped substeps sweeps_position sweeps_velocity"
)
NUMBERS = (
    "residual_position residual_velocity residual_smooth penetration penetration_relative substep_min"
    " energy_in energy_out energy_work"
)


class ModelError(ValueError):
    pass


def defaults() -> dict[str, Any]:
    return {"step": 1e-3, "method": "nsga", "impact": "sequence", "threads": 1, "delay": 0.0, "fail_at": 0}


def impact_laws() -> dict[str, dict[str, Any]]:
    return {}


def choices() -> dict[str, list[str]]:
    return {"method": ["nsga"], "impact": ["sequence"]}


class Simulation:
    def __init__(self, model: dict[str, Any]) -> None:
        if any(model["radius"] <= 0):
            raise ModelError("radius must be positive")
        self.model, self.options = model, model["options"]
        self.step = 0
        self.x, self.v = np.array(model["position"], float), np.array(model["velocity"], float)
        self.q, self.w = np.array(model["orientation"], float), np.array(model["angular_velocity"], float)
        self.sums: dict[int, float] = {}
        self.rise = 0.0

    @property
    def time(self) -> float:
        return self.step * self.options["step"]

    def frame(self) -> dict[str, Any]:
        values = {"position": self.x, "orientation": self.q, "velocity": self.v, "angular_velocity": self.w}
        return {"time": self.time, **{k: v.copy() for k, v in values.items()}}

    def advance(self, steps: int, frame_every: int, contacts: bool, wall_limit: float) -> dict[str, Any]:
        h, end = self.options["step"], time.perf_counter() + wall_limit
        frames: list[dict[str, Any]] = []
        contact_rows, impacts, table, histories, outcome = [], [], [], [], None
        for _ in range(steps):
            if self.options.get("fail_at") == self.step + 1:
                outcome = {
                    "kind": "not_converged",
                    "step": self.step + 1,
                    "time": self.time + h,
                    "level": "position",
                }
                outcome |= {"bodies": [0, len(self.x)], "residual": 0.5, "advice": "halve the step"}
                break
            self.step += 1
            self.v = self.v + h * np.asarray(self.model["gravity"])
            self.x = self.x + h * self.v
            hits = 0
            for body in range(len(self.x)):
                gap = self.x[body, 2] - self.model["radius"][body]
                if gap <= 0 and self.v[body, 2] < 0:
                    hits += 1
                    impulse = -1.5 * self.model["mass"][body] * self.v[body, 2]
                    impacts.append((self.step, self.time, 0, body, impulse, -self.v[body, 2]))
                    self.v[body, 2] *= -0.5
                    self.x[body, 2] = self.model["radius"][body]
                    self.sums[body] = self.sums.get(body, 0.0) + impulse
                    histories.append((self.step, 1 + hits % 2, [10.0 ** -(2.0**k) for k in range(4)]))
            kinetic = 0.5 * float(np.sum(self.model["mass"][:, None] * self.v**2))
            potential = -float(
                np.sum(self.model["mass"][:, None] * self.x * np.asarray(self.model["gravity"]))
            )
            table.append((self.step, self.time, hits, kinetic, potential))
            if frame_every and self.step % frame_every == 0:
                if contacts:
                    contact_rows += sorted(self.sums.items())
                self.sums = {}
                frames.append({**self.frame(), "step": self.step, "contact_end": len(contact_rows)})
            time.sleep(self.options.get("delay", 0.0))
            if time.perf_counter() > end:
                break
        return {
            "frames": self._frames(frames),
            "contacts": self._contacts(contact_rows),
            "impacts": self._impacts(impacts),
            "steps": self._steps(table),
            "residuals": self._residuals(histories),
            "outcome": outcome,
        }

    def _frames(self, frames: list[dict[str, Any]]) -> dict[str, Any]:
        n = len(self.x)
        columns = {
            "position": (n, 3),
            "orientation": (n, 4),
            "velocity": (n, 3),
            "angular_velocity": (n, 3),
            "time": (),
        }
        found = {
            k: np.array([f[k] for f in frames], float).reshape(len(frames), *s) for k, s in columns.items()
        }
        return found | {k: np.array([f[k] for f in frames], np.uint64) for k in ("step", "contact_end")}

    def _contacts(self, rows: list[tuple[int, float]]) -> dict[str, Any]:
        c = len(rows)
        up = np.tile([0.0, 0.0, 1.0], (c, 1))
        impulse = np.array([r[1] for r in rows], float).reshape(c, 1) * up
        scalars = {
            k: np.zeros(c) for k in ("gap", "work_normal", "work_friction", "work_rolling", "work_spinning")
        }
        vectors = {k: np.zeros((c, 3)) for k in ("moment", "position_impulse", "position_moment")}
        body = np.array([(r[0], len(self.x)) for r in rows], np.int64).reshape(c, 2)
        return (
            {"body": body, "status": np.ones(c, np.uint8), "normal": up, "impulse": impulse}
            | scalars
            | vectors
        )

    def _impacts(self, rows: list[tuple[Any, ...]]) -> dict[str, Any]:
        i = len(rows)
        up = np.tile([0.0, 0.0, 1.0], (i, 1))
        column = [np.array([r[k] for r in rows]) for k in range(6)] if rows else [np.zeros(0)] * 6
        return {
            "step": column[0].astype(np.uint64),
            "time": column[1].astype(float),
            "problem": column[2].astype(np.uint32),
            "body": np.stack([column[3], np.full(i, len(self.x))], axis=1).astype(np.int64),
            "status": np.ones(i, np.uint8),
            "normal": up,
            "impulse": column[4].reshape(i, 1) * up,
            "moment": np.zeros((i, 3)),
            "approach": column[5].astype(float),
            "separation": 0.5 * column[5].astype(float),
            "restitution_scale": np.ones(i),
        }

    def _steps(self, rows: list[tuple[Any, ...]]) -> dict[str, Any]:
        s = len(rows)
        hits = np.array([r[2] for r in rows], np.uint32)
        found: dict[str, Any] = {name: np.zeros(s, np.uint32) for name in COUNTS.split()}
        found |= {
            "iterations_smooth": np.ones(s, np.uint32),
            "iterations_position": 1 + 2 * hits,
            "contacts": hits,
        }
        found |= {
            "step": np.array([r[0] for r in rows], np.uint64),
            "time": np.array([r[1] for r in rows], float),
        }
        found |= {name: np.zeros(s) for name in NUMBERS.split()}
        found["energy_kinetic"] = np.array([r[3] for r in rows], float)
        found["energy_potential"] = np.array([r[4] for r in rows], float)
        return found | {"restitution_scale": np.ones(s), "iterations_velocity": hits, "impact_problems": hits}

    def _residuals(self, rows: list[tuple[int, int, list[float]]]) -> dict[str, Any]:
        k = len(rows)
        return {
            "step": np.array([r[0] for r in rows], np.uint64),
            "level": np.array([r[1] for r in rows], np.uint8),
            "problem": np.zeros(k, np.uint32),
            "contacts": np.ones(k, np.uint32),
            "end": np.cumsum([len(r[2]) for r in rows]).astype(np.uint64),
            "value": np.array([v for r in rows for v in r[2]], float),
        }

    def state(self) -> dict[str, Any]:
        arrays = {"x": self.x.copy(), "v": self.v.copy()}
        sums = {"body": np.array(list(self.sums), np.int64), "sum": np.array(list(self.sums.values()), float)}
        return {"step": self.step, "arrays": arrays, "sums": sums, "rise": self.rise}

    def restore(self, state: dict[str, Any]) -> None:
        self.step, self.rise = state["step"], state["rise"]
        self.x, self.v = state["arrays"]["x"].copy(), state["arrays"]["v"].copy()
        self.sums = dict(zip(state["sums"]["body"].tolist(), state["sums"]["sum"].tolist(), strict=True))

    def monitors(self) -> dict[str, Any]:
        counts = {"max": 1, "mean": 1.0}
        return {
            "steps": self.step,
            "iterations": {"smooth": counts, "position": counts, "velocity": counts},
            "line_search": {"position": 0, "velocity": 0},
            "impact_problems": counts,
            **dict.fromkeys(
                ("unconverged", "fallbacks", "truncated_sequences", "halvings", "missed_impacts"), 0
            ),
            "energy": {"initial": 1.0, "final": 1.0, "max_rise": 0.0},
            "penetration_max": 0.0,
            "restitution_scale_min": 1.0,
        }

    def phases(self) -> dict[str, float]:
        return {"broad": 0.0, "position": 0.001}

    def failing_problem(self) -> dict[str, Any] | None:
        """One ball of 1 kg on the bed that comes down at 1 m/s."""
        gradient = np.zeros((6, 2, 6))
        gradient[[0, 1, 2], 0, [2, 0, 1]] = 1.0
        gradient[[3, 4, 5], 0, [3, 4, 5]] = 1.0
        none = np.zeros(0, dtype=np.int64)
        return {
            "level": "position",
            "step": self.step + 1,
            "time": 0.1,
            "part": 0,
            "island": 0,
            "index": 0,
            "iterations": 3,
            "residual": 0.5,
            "converged": False,
            "attempts": "newton: residual 5.0e-01",
            "joints": 0,
            "worst": 0,
            "spheres": np.array([0]),
            "mass": np.ones(1),
            "inertia": np.ones(1),
            "bodies": np.array([[0, 2]]),
            "bounds": np.array([[0.2, 0.0, 0.0]]),
            "node": np.tile([0, -1], (6, 1)),
            "gradient": gradient,
            "q": np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            "r": np.zeros(6),
            **{name: np.zeros((1, 6)) for name in ("motion", "correction", "load")},
            **{f"load_tangent_{name}": none for name in ("row", "column")},
            "load_tangent_value": np.zeros(0),
        }


RECORD: dict[str, Any] = {
    "every": None,
    "contacts": True,
    "walls": None,
    **dict.fromkeys(("checkpoint_steps", "checkpoint_time", "checkpoint_wall")),
}


@dataclass(frozen=True)
class Scene:
    """As much of `carom.Scene` as running needs: spheres above a plane, options in a table that any key may
    enter.
    """

    title: str = "fake"
    names: list[str] = field(default_factory=lambda: ["one", "two"])
    wall_names: list[str] = field(default_factory=lambda: ["bed"])
    clumps: tuple[()] = ()
    load_functions: tuple[Any, ...] = ()
    joint_names: tuple[str, ...] = ()
    case: str | None = None
    parameters: dict[str, float] = field(default_factory=dict)
    run: Any = field(default_factory=lambda: SimpleNamespace(until=1.0, **defaults()))
    record: Any = field(default_factory=lambda: SimpleNamespace(**RECORD))

    def with_options(self, **options: Any) -> Scene:
        run, record = dict(vars(self.run)), dict(vars(self.record))
        for key, value in options.items():
            (record if key in record else run)[key] = value
        return replace(self, run=SimpleNamespace(**run), record=SimpleNamespace(**record))

    def resolved(self) -> Scene:
        return self

    def validate(self) -> list[str]:
        return []

    def _walls(self) -> list[Any]:
        return []

    def to_model(self) -> dict[str, Any]:
        n = len(self.names)
        position = np.array([[0.2 * i, 0.0, 0.3 + 0.1 * i] for i in range(n)])
        return {
            "gravity": np.array([0.0, 0.0, -9.8]),
            "radius": np.full(n, 0.05),
            "mass": np.full(n, 0.2),
            "inertia": np.full(n, 2e-4),
            "material": np.zeros(n, np.int64),
            "position": position,
            "velocity": np.tile([0.1, 0.0, 0.0], (n, 1)),
            "angular_velocity": np.zeros((n, 3)),
            "orientation": np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
            "plane_point": np.zeros((1, 3)),
            "plane_normal": np.array([[0.0, 0.0, 1.0]]),
            "plane_material": np.zeros(1, np.int64),
            "options": {k: v for k, v in vars(self.run).items() if k != "until"},
        }

    def to_toml(self, *, resolved: bool = False) -> str:
        def lines(table: Any) -> str:
            kept = {k: v for k, v in vars(table).items() if v is not None}
            return "\n".join(
                f"{k} = {str(v).lower() if isinstance(v, bool) else repr(v)}" for k, v in kept.items()
            )

        return f'title = "{self.title}"\n[run]\n{lines(self.run)}\n[record]\n{lines(self.record)}\n'

    @classmethod
    def from_toml(cls, path: Path | str) -> Scene:
        tree = tomllib.loads(Path(path).read_text())
        scene = cls(title=tree.get("title", "fake"))
        return scene.with_options(**tree.get("run", {}), **tree.get("record", {}))


def install(patch: Any = None) -> None:
    """Take the place of the compiled core and of `carom.scene.scene`: for one test (`monkeypatch`), or for good."""
    import carom

    this = sys.modules[__name__]
    scene = ModuleType("carom.scene.scene")
    scene.Scene = Scene  # type: ignore[attr-defined]
    if patch is None:
        sys.modules.update({"carom.scene.scene": scene, "carom._core": this})
        carom._core = this  # type: ignore[attr-defined]
        return
    from carom.result import data
    from carom.run import checkpoint, loop, restart, simulate, sinks, summary

    for module in (data, checkpoint, loop, restart, simulate, sinks, summary):
        for name, fake in (("_core", this), ("Scene", Scene)):
            if hasattr(module, name):
                patch.setattr(module, name, fake)
    patch.setattr(summary, "versions", summary.versions.__wrapped__)  # they are asked once
