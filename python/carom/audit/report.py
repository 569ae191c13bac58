"""What an audit says: for each kind of law how much was judged, the worst violation, and what could not be judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from carom.arrays import F64, Bool
from carom.audit.kinds import KINDS, Kind
from carom.errors import did_you_mean
from carom.result.names import UnknownName


@dataclass(frozen=True)
class Place:
    """Where and when: a frame (-1: none), the step after which it was taken, its time (s), the bodies or the table."""

    frame: int = -1
    step: int = -1
    time: float = float("nan")
    who: tuple[str, ...] = ()

    def __str__(self) -> str:
        parts = [" and ".join(self.who)] if self.who else []
        if self.step >= 0:
            parts.append(f"step {self.step}, t = {self.time:.6g} s")
        return ", ".join(parts)


@dataclass(frozen=True)
class Finding:
    """The worst of a kind: a value, the bound it must keep, and where it was found."""

    kind: str
    value: float
    bound: float
    unit: str
    place: Place

    @property
    def ratio(self) -> float:
        """Value over bound; above 1 the law is violated."""
        return float(_ratios(np.array([self.value]), np.array([self.bound]))[0])

    def __str__(self) -> str:
        return f"{self.kind}: {self.value:.3g} {self.unit} (bound {self.bound:.3g}) at {self.place}"


@dataclass(frozen=True)
class Unjudged:
    """Why something of a kind was not judged, how often, and what to do so that it can be."""

    why: str
    cure: str
    count: int


@dataclass
class Verdict:
    """All that was found of one kind."""

    kind: Kind
    judged: int = 0
    violations: int = 0
    worst: Finding | None = None
    unjudged: list[Unjudged] = field(default_factory=list)

    @property
    def word(self) -> str:
        """ "ok", "violated", "not judged", or "nothing to judge"."""
        if self.violations:
            return "violated"
        if self.judged:
            return "ok"
        return "not judged" if self.unjudged else "nothing to judge"


@dataclass(frozen=True)
class Report:
    """The verdict on a run; `report["momentum"]` is that on one kind, `report.ok` whether no law was violated."""

    path: str
    title: str
    method: str
    frames: int
    verdicts: Mapping[str, Verdict]
    warnings: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether nothing that could be judged is violated."""
        return not any(v.violations for v in self.verdicts.values())

    @property
    def findings(self) -> list[Finding]:
        """The worst violation of each kind that is violated, the worst first."""
        found = [v.worst for v in self.verdicts.values() if v.violations and v.worst is not None]
        return sorted(found, key=lambda f: -f.ratio)

    def __getitem__(self, kind: str) -> Verdict:
        if kind not in self.verdicts:
            raise UnknownName(f"no law is called {kind!r}; {did_you_mean(str(kind), list(self.verdicts))}")
        return self.verdicts[kind]

    def __repr__(self) -> str:
        words = [v.word for v in self.verdicts.values()]
        head = f"<audit of {self.title or self.path!r}: " + ("clean" if self.ok else "violated")
        tail = f"; {words.count('ok')} kinds ok, {words.count('not judged')} not judged>"
        return "\n  ".join([head + tail, *map(str, self.findings)])

    def to_dict(self) -> dict[str, Any]:
        """The report as plain values, as `carom check RUN --json` prints it."""
        return {
            "run": self.path,
            "title": self.title,
            "method": self.method,
            "frames": self.frames,
            "ok": self.ok,
            "warnings": list(self.warnings),
            "kinds": [_plain(v) for v in self.verdicts.values()],
        }


def _plain(verdict: Verdict) -> dict[str, Any]:
    kind, worst = verdict.kind, verdict.worst
    found: dict[str, Any] = {
        "kind": kind.name,
        "verdict": verdict.word,
        "law": kind.law,
        "bound_from": kind.bound,
        "unit": kind.unit,
        "judged": verdict.judged,
        "violations": verdict.violations,
        "worst": None,
        "not_judged": [{"why": u.why, "cure": u.cure, "count": u.count} for u in verdict.unjudged],
    }
    if worst is not None:
        p = worst.place
        found["worst"] = {"value": worst.value, "bound": worst.bound, "ratio": worst.ratio, "frame": p.frame,
                          "step": p.step, "time": p.time, "bodies": list(p.who)}  # fmt: skip
    return found


class Tally:
    """Collects measures of all kinds; of each it keeps the count and the worst in units of its bound."""

    def __init__(self, kinds: Mapping[str, Kind] = KINDS) -> None:
        self.verdicts = {name: Verdict(kind) for name, kind in kinds.items()}
        self._skipped: dict[tuple[str, str, str], int] = {}

    def measure(
        self, kind: str, value: Any, bound: Any, place: Callable[[int], Place], chosen: Bool | None = None
    ) -> None:
        """Values that must not exceed their bounds, of any one shape, all or those that are `chosen`; `place(i)` says where
        the `i`-th of them, counted flat, was found. A value that is not a number violates any bound, and a bound that is
        none is violated. What nothing bounds is not judged.
        """
        values = np.asarray(value, dtype=np.float64).ravel()
        bounds = np.broadcast_to(np.asarray(bound, dtype=np.float64), np.shape(value)).ravel()
        if chosen is not None:
            kept = np.flatnonzero(chosen)
            self.measure(kind, values[kept], bounds[kept], lambda i: place(int(kept[i])))
            return
        if not values.size:
            return
        bounded = ~np.isposinf(bounds)
        if not bounded.all():
            self.skip(kind, "nothing bounds it there", "a smaller step", int((~bounded).sum()))
            self.measure(kind, values, bounds, place, bounded)
            return
        values = np.where(np.isnan(values), np.inf, values) + 0.0  # no negative zeros
        verdict = self.verdicts[kind]
        verdict.judged += values.size
        ratio = _ratios(values, bounds)
        verdict.violations += int((ratio > 1.0).sum())
        at = int(np.argmax(ratio))
        if verdict.worst is None or ratio[at] > verdict.worst.ratio:
            verdict.worst = Finding(kind, float(values[at]), float(bounds[at]), verdict.kind.unit, place(at))

    def skip(self, kind: str, why: str, cure: str, count: int = 1) -> None:
        """Note that something of a kind could not be judged."""
        if count > 0:
            key = (kind, why, cure)
            self._skipped[key] = self._skipped.get(key, 0) + int(count)

    def doubt(self, strict: Tally, why: str, cure: str) -> None:
        """Note what is violated by narrower bounds and not by those that were judged: it does not count as kept."""
        for kind, verdict in strict.verdicts.items():
            self.skip(kind, why, cure, verdict.violations - self.verdicts[kind].violations)

    def close(self) -> dict[str, Verdict]:
        """The verdicts."""
        for (kind, why, cure), count in self._skipped.items():
            self.verdicts[kind].unjudged.append(Unjudged(why, cure, count))
        return self.verdicts


NOTHING = 1e-150
"""What is no value, in any unit of SI: impulses that die out from step to step, whose bounds round to 0."""


def _ratios(values: F64, bounds: F64) -> F64:
    """Values over bounds: infinite where a bound is 0 and the value is not, and where a bound is no number."""
    values = np.where(values < NOTHING, 0.0, values)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = np.where(np.isinf(bounds) & ~np.isinf(values), 0.0, values / bounds)
    return np.where(bounds > 0.0, ratio, np.where((values > 0.0) | np.isnan(bounds), np.inf, 0.0))
