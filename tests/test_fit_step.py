"""What the step of the runs does to a fit: how far best values move with a smaller one, and where results jump."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import Calibration
from test_fit import COLLISION, T, end, fitted, free

__all__ = ["free"]

TIMES = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
BOTH = {"e": (0.5, 1.0), "mu": (0.0, 0.3)}


@pytest.fixture(autouse=True)
def extras() -> None:
    for name in ("pyarrow", "scipy"):
        pytest.importorskip(name, reason="the extra [fit] is not installed")


@pytest.fixture(scope="module")
def seen() -> list[dict[str, Any]]:
    """The exact places of both balls of the collision, for an uncertainty of 0.5 mm."""
    result = carom.simulate(COLLISION)
    return [
        {
            "quantity": f"{ball}.position.{x}",
            "time": TIMES,
            "value": np.interp(TIMES, result.time, result[ball].position[:, "xyz".index(x)]).tolist(),
            "uncertainty": 5e-4,
        }
        for ball in "ab"
        for x in "xy"
    ]


def collided(folder: Path, targets: list[Any], parameters: dict[str, Any] = BOTH, **more: Any) -> carom.Fit:
    calibration = Calibration.of(COLLISION, parameters, targets, **more)
    return carom.fit(calibration, folder, workers=0)


class TestSmallerStep:
    def test_the_shift_is_what_a_fit_with_the_smaller_step_finds(self, seen: Any, tmp_path: Path) -> None:
        found = collided(tmp_path / "fit", seen, method="nsga", step=1e-3)
        assert found.step_shift is not None
        others = [
            collided(tmp_path / str(n), seen, method="nsga", step=0.6 / n).best
            for n in (round(600 * 3**0.5), round(600 * 5**0.5))
        ]
        for name, moved in found.step_shift.items():
            refitted = max((other[name] - found.best[name] for other in others), key=abs)
            assert moved == pytest.approx(refitted, rel=0.05)
        [remark] = found.remarks
        assert remark.startswith("with about half of run.step = 0.001 s e moves by ")
        assert remark.endswith('take a smaller run.step, or method = "events"')
        assert found.summary["runs"] == len(found.sweep) + 2
        assert json.loads((found.path / "fit.json").read_text())["step_shift"] == found.step_shift

    def test_a_step_without_error_is_no_remark(self, free: Path) -> None:
        """A ball flies freely: any step is exact, also one that set gives."""
        found = fitted(free, {"v": (0.5, 1.5)}, [end(0.021, 1e-4)], set={"run.step": "= 2e-3"})
        assert found.step_shift == pytest.approx({"v": 0.0}, abs=1e-9)
        assert found.remarks == []
        parquet = pytest.importorskip("pyarrow.parquet")
        steps = parquet.read_table(found.path / "smaller_step" / "sweep.parquet")["run.step"].to_pylist()
        assert steps == pytest.approx([T / 17, T / 22])

    def test_method_events_has_no_step(self, seen: Any, tmp_path: Path) -> None:
        found = collided(tmp_path / "fit", seen)
        assert found.step_shift is None
        assert found.summary["runs"] == len(found.sweep)
        assert found.best == pytest.approx({"e": 0.9, "mu": 0.1}, abs=1e-6)

    def test_the_noise_of_seeds_is_no_shift(self, free: Path) -> None:
        """Places scatter by the seed and by the step, as those of a pile do."""

        def place(result: carom.Result) -> dict[str, float]:
            v, steps = result["cue"].velocity[0, 0], result.summary["steps"]
            return {"place": T * (v + 0.05 * np.sin(54331 * v * steps))}

        found = fitted(
            free,
            {"p": (0.5, 2.0), "seed": {"seeds": 6}},
            [{"quantity": "place", "value": 0.02, "uncertainty": 1e-5}],
            set={"cue.velocity.x": "= p + 1e-3*sin(777*seed^2)"},
            measure=place,
        )
        assert found.summary["runs"] == len(found.sweep) + 12
        low, high = found.interval["p"]  # type: ignore[misc]
        assert abs(found.step_shift["p"]) > 0.5 * (high - low) / 2 / 1.96  # type: ignore[arg-type, index]
        assert not [remark for remark in found.remarks if "run.step" in remark]
