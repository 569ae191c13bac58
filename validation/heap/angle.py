"""The angle of a heap of 8000 grains, poured on a rough disc: steady at rest, between seeds, for any number of threads.

    python validation/heap/angle.py                     # three seeds, and the first one on two threads: some 20 minutes
    python validation/heap/angle.py --grains 500 --seeds 1

Prints the angle over the last second of every run and what the runs have counted; exit code 1 if it moves by more than a
degree within that second, if seeds differ by more than a degree from their mean, or if threads change a bit.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import carom
from carom import Result, granular
from common import table

SCENE = Path(__file__).parent / "poured.toml"
#: Largest change in the last second, and of a seed from the mean of the seeds, degrees.
STEADY, BETWEEN = 1.0, 1.0
LAST = 1.0  # s


@dataclass(frozen=True)
class Heap:
    """One run."""

    seed: int
    threads: int
    found: list[granular.HeapAngle]
    """Of every frame of the last second."""
    hash: str
    seconds: float
    result: Result

    @property
    def angles(self) -> list[float]:
        """Degrees."""
        return [f.degrees for f in self.found]

    def row(self) -> list[str]:
        m, low, high, last = self.result.summary, min(self.angles), max(self.angles), self.found[-1]
        stay = int(np.isfinite(self.result.position[-1, :, 0]).sum())
        counts = [str(m[key]) for key in ("unconverged", "fallbacks", "halvings", "truncated_sequences")]
        deepest = f"{m['penetration_max_relative']:.1e}"
        return [
            *(str(x) for x in (self.seed, self.threads, stay)),
            f"{last.degrees:.2f} +- {np.degrees(last.error):.2f}",
            f"{low:.2f} to {high:.2f}",
            f"{np.degrees(last.inner):.1f}, {np.degrees(last.outer):.1f}",
            *counts,
            deepest,
            f"{self.seconds:.0f}",
            self.hash,
        ]


def heap(seed: int, threads: int, grains: int) -> Heap:
    """Pour, and look at the last second. Small parts of the pile go to threads, so that threads do take part."""
    begin = time.process_time()
    result = carom.simulate(
        SCENE, parameters={"seed": seed, "N": grains}, threads=threads, contacts_per_thread=1000
    )
    seconds = time.process_time() - begin
    times, position = np.asarray(result.time), np.asarray(result.position)
    frames = np.flatnonzero(times >= times[-1] - LAST - 1e-9)
    found = [granular.heap_angle(result, int(k), centre=(0.0, 0.0, 0.0)) for k in frames]
    state = hashlib.sha256(position[-1].tobytes() + np.asarray(result.velocity[-1]).tobytes())
    return Heap(seed, threads, found, state.hexdigest()[:16], seconds, result)


HEAD = [
    "seed",
    "threads",
    "stay",
    "angle",
    "last second",
    "inner, outer",
    "unconv.",
    "fallb.",
    "halved",
    "cut",
    "deepest/r",
    "CPU s",
    "hash",
]


def main() -> int:
    """Run, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--grains", type=int, default=8000)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument(
        "--threads", type=int, nargs="+", default=[1, 2], help="of the first seed; others use the first"
    )
    given = parser.parse_args()
    asked = [(given.seeds[0], t) for t in given.threads] + [(s, given.threads[0]) for s in given.seeds[1:]]
    heaps = []
    for seed, threads in asked:
        heaps.append(heap(seed, threads, given.grains))
        print(*heaps[-1].row(), flush=True, file=sys.stderr)
    print(table(HEAD, [h.row() for h in heaps]))
    moved = max(max(h.angles) - min(h.angles) for h in heaps)
    seeds = [h.angles[-1] for h in heaps if h.threads == given.threads[0]]
    apart = max(abs(a - np.mean(seeds)) for a in seeds)
    same = len({h.hash for h in heaps if h.seed == given.seeds[0]}) == 1
    print(f"\nlargest change in the last second {moved:.2f} (bound {STEADY:g}) degrees")
    print(f"seeds from their mean {np.mean(seeds):.2f}: at most {apart:.2f} (bound {BETWEEN:g}) degrees")
    print(f"threads {', '.join(map(str, given.threads))}: {'the same bits' if same else 'OTHER BITS'}")
    return 0 if moved <= STEADY and apart <= BETWEEN and same else 1


if __name__ == "__main__":
    sys.exit(main())
