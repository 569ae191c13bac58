"""How often a thing was tried that a test tries many times, and how often it held: figures that a run of pytest ends with.

A test takes the fixture `trials` and wraps each trial: `with trials("kills survived"): ...`. Counts go with the reports of
the tests, so that they also arrive from processes of pytest-xdist. `docs/validation/trust.md` quotes them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from hypothesis.errors import UnsatisfiedAssumption

#: The name under which a report carries counts: (TRIALS, (what, tried, held)).
TRIALS = "trials"


class Trials:
    """Trials of one test."""

    def __init__(self) -> None:
        self.tried: Counter[str] = Counter()
        self.held: Counter[str] = Counter()

    @contextmanager
    def __call__(self, what: str) -> Iterator[None]:
        """One trial: it held unless an exception leaves the block. A scene that hypothesis drops was not tried."""
        try:
            yield
        except UnsatisfiedAssumption:
            raise
        except BaseException:
            self.tried[what] += 1
            raise
        self.tried[what] += 1
        self.held[what] += 1

    def properties(self) -> list[tuple[str, tuple[str, int, int]]]:
        """What the reports of the test are to carry."""
        return [(TRIALS, (what, count, self.held[what])) for what, count in self.tried.items()]

    def add(self, properties: Iterable[tuple[str, Any]]) -> None:
        """The counts of another test."""
        for name, value in properties:
            if name == TRIALS:
                what, tried, held = value
                self.tried[what] += tried
                self.held[what] += held

    def lines(self) -> list[str]:
        """One line for each kind of trial."""
        return [f"{what}: {self.held[what]} of {count}" for what, count in sorted(self.tried.items())]
