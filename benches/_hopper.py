"""The cone hopper of `flow.py` as all programs are judged by it: overlaps, bulk density, discharge and the law of Beverloo.

NumPy alone, so that the interpreter of each program can call it. The opening is the ring of radius `opening`/2 around the
origin; the cone widens upwards to the tube of radius `tube`, whose lower end is at `height`. Lengths in m.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from _memory import peak_memory
from scale_overlap import F64, near_pairs

#: Shares of the grains above the opening between which the rate is measured: not at its start, and not of the last grains.
START, STOP = 0.9, 0.4
#: Centres in the part of the tube whose solid fraction is taken: of fewer it scatters by more than some per cent.
FEWEST = 100


@dataclass(frozen=True)
class Hopper:
    """A hopper of equal grains of radius `r`; `angle` (rad) of the cone from the vertical."""

    r: float
    opening: float
    tube: float
    angle: float

    @property
    def height(self) -> float:
        return float((self.tube - self.opening / 2) / np.tan(self.angle))

    def deepest(self, position: F64, shut: bool) -> float:
        """Deepest overlap over r: of grains with each other, with cone and tube, and with the shutter while it is shut.

        `position` (N, 3). A grain that touches the ring of the opening itself is judged by its overlaps with grains alone.
        """
        if not len(position):
            return 0.0
        a, b = near_pairs(position, 2 * self.r)
        between = 2 * self.r - np.linalg.norm(position[a] - position[b], axis=1)
        off, z = np.hypot(position[:, 0], position[:, 1]), position[:, 2]
        along = (self.opening / 2 + z * np.tan(self.angle) - off) * np.cos(self.angle)
        cone = (self.r - along)[z > along * np.sin(self.angle)]  # those that touch it above its lower ring
        tube = (self.r - (self.tube - off))[z > self.height]
        floor = self.r - z if shut else z[:0]
        return float(np.concatenate([[0.0], between, cone, tube, floor]).max() / self.r)

    def solid(self, position: F64) -> float:
        """Solid fraction of what has settled in the tube, away from its wall and its surface; NaN of too few grains."""
        off, z = np.hypot(position[:, 0], position[:, 1]), position[:, 2]
        low, high, wide = self.height, float(np.quantile(z, 0.85)), 0.8 * self.tube
        inside = (off < wide) & (z > low) & (z < high)
        if inside.sum() < FEWEST:
            return float("nan")
        return float(inside.sum() * 4 / 3 * self.r**3 / (wide**2 * (high - low)))

    def law(self, solid: float, gravity: float) -> float:
        """Grains per second by Beverloo et al. (1961) with k = 1.4, in a cone by Rose and Tanaka (1959).

        The sources stand in `scenarios/hopper_cone.toml`.
        """
        free = self.opening - 1.4 * 2 * self.r
        flat = 0.58 * solid * np.sqrt(gravity) * free**2.5 / (4 / 3 * np.pi * self.r**3)
        return float(flat * np.tan(self.angle) ** -0.35)


def rate(times: Sequence[float], above: Sequence[int], grains: int) -> float:
    """Grains per second through the opening, by least squares while `above` falls from START to STOP of all; NaN without."""
    t, n = np.asarray(times), np.asarray(above)
    between = (n < START * grains) & (n > STOP * grains)
    return -float(np.polyfit(t[between], n[between], 1)[0]) if between.sum() > 2 else float("nan")


def run(
    ask: dict[str, Any], advance: Callable[[int], None], look: Callable[[], F64], more: dict[str, Any]
) -> None:
    """Advance sample by sample, judge what is there, and write down what came of it.

    `advance` makes the steps of the sample of that number, and is timed; `look` gives the places (N, 3) of the grains that
    have not left.
    """
    hopper = Hopper(**ask["hopper"])
    wall = cpu = deepest = 0.0
    times, above, solid = [0.0], [len(look())], float("nan")
    begin_all = time.monotonic()
    for k in range(round(ask["until"] / ask["sample"])):
        if time.monotonic() - begin_all > ask["limit"]:
            break
        begin, begin_cpu = time.perf_counter(), time.process_time()
        advance(k)
        wall += time.perf_counter() - begin
        cpu += time.process_time() - begin_cpu
        position = look()
        shut = (k + 1) * ask["sample"] < ask["opens"] + 1e-9
        deepest = max(deepest, hopper.deepest(position, shut))
        if shut:
            solid = hopper.solid(position)
        times.append((k + 1) * ask["sample"])
        above.append(int((position[:, 2] > 0).sum()))
    told = {
        "time": times[-1],
        "phases": [wall],
        "cpu": cpu,
        "memory": peak_memory(),
        "deepest": deepest,
        "solid": solid,
        "times": times,
        "above": above,
        "rate": rate(times, above, ask["grains"]),
        "law": hopper.law(solid, ask["gravity"]),
        **more,
    }
    beside = Path(ask["told"] + ".part")
    beside.write_text(json.dumps(told))
    beside.replace(ask["told"])
