"""What the step of the runs does to a fit: how far best values move with a smaller one, and where results jump."""

from __future__ import annotations

import json
import re
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


START = {**BOTH, "v": (0.8, 1.2)}
SPEED = {"a.velocity.x": "= v"}


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


class TestJumps:
    """Where the start moves, the impact falls into another step, and places jump by the speed times the step."""

    @pytest.mark.parametrize("method", ["nsga", "moreau"])
    def test_intervals_are_those_of_wider_differences(self, method: str, seen: Any, tmp_path: Path) -> None:
        exact = collided(tmp_path / "exact", seen, START, set=SPEED)
        assert exact.remarks == []
        assert exact.summary["interval_by"] == "central differences over 0.005 of the ranges"
        found = collided(tmp_path / "fit", seen, START, set=SPEED, method=method, step=1e-4)
        for name, ends in exact.interval.items():
            assert np.diff(found.interval[name]) == pytest.approx(np.diff(ends), rel=0.05)  # type: ignore[arg-type]
        assert found.remarks[0].startswith(
            "results jump with v: differences over 0.005 of the range are no slopes; intervals are by those over 0.0"
        )
        assert not [remark for remark in found.remarks if "the data do not" in remark]
        assert re.match(
            r"central differences over 0\.005, 0\.005, 0\.0[248] of", found.summary["interval_by"]
        )

    def test_what_jumps_hide_is_no_fault_of_the_data(self, seen: Any, tmp_path: Path) -> None:
        """Radius, restitution and friction are told apart by method events, though correlated by 0.99."""
        parameters, radius = {**BOTH, "R": (0.01, 0.05)}, {"a.radius": "= R"}
        exact = collided(tmp_path / "exact", seen, parameters, set=radius)
        assert None not in exact.interval.values()
        found = collided(tmp_path / "fit", seen, parameters, set=radius, method="nsga", step=1e-3)
        [remark] = [remark for remark in found.remarks if "R" in remark]
        assert remark.startswith(
            "results jump with R: differences over 0.005 of the range are no slopes; intervals of "
        )
        assert remark.endswith('use method = "events" or a smaller run.step or a larger search.difference')
        assert not [remark for remark in found.remarks if "the data do not" in remark]
