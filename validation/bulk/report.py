"""What a run shows, as numbers, files and the tables of the page docs/validation/bulk.md."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import carom
import figures
import measure
import numpy as np
import targets
from carom import Result
from scenes import PART, SCALE, SETTLING, SMALL, WHOLE, Case, Drum, Silo
from targets import Check

#: Where on the page the tables of each size are put.
MARKS = {
    size: (f"<!-- printed by bulk.py --{size} -->", f"<!-- end of {size} -->") for size in ("whole", "small")
}
#: Counts of steps in a run: column of the steps, and what the table calls them.
COUNTS = {
    "unconverged": "unconverged",
    "fallbacks": "fallbacks",
    "truncated": "cut",
    "halvings": "halved",
    "missed_impacts": "missed",
}  # fmt: skip


#: Times of the parts of a run that the command made, one JSON object a line; it lies in the run's directory.
TIMES = "times.jsonl"


@dataclass
class Found:
    """A case and what its run shows so far."""

    name: str
    case: Case
    whole: bool
    result: Result | None
    """None: known by the page alone."""
    ours: measure.Curves
    others: dict[str, measure.Curves]
    """Published curves, scaled to this size."""
    numbers: dict[str, Any]
    checks: list[Check] = field(default_factory=list)
    pairs: list[measure.Pair] = field(default_factory=list)

    @property
    def size(self) -> str:
        """`whole` or `small`."""
        return "whole" if self.whole else "small"

    @property
    def missed(self) -> bool:
        """Whether a target is."""
        return not all(check.ok for check in self.checks)

    @property
    def ended(self) -> bool:
        """Whether the run has come to its end."""
        return bool(self.numbers["time_s"] >= self.case.duration - 1e-9)

    @classmethod
    def of(cls, name: str, case: Case, place: Path, *, whole: bool, audit: bool) -> Found:
        """Measure a run, which may not have come to its end."""
        result = carom.load(place)
        ours = measure.silo(case, result) if isinstance(case, Silo) else measure.drum(case, result)
        found = cls(name, case, whole, result, ours, {}, accounts(case, result, place))
        found.numbers = {"case": name, "size": found.size} | found.numbers
        if isinstance(case, Silo):
            found.others = measure.published(name) if whole else {}
            found._silo(case)
        else:
            found._drum(case)
        found._time()
        if audit:
            found._audit(place)
        found.numbers["checks"] = [vars(check) for check in found.checks]
        return found

    @classmethod
    def kept(cls, name: str, case: Case, stem: Path, *, whole: bool) -> Found:
        """What [`Found.write`] has kept of an earlier run."""
        curves, numbers = (stem.with_name(stem.name + end) for end in (".csv", ".json"))
        found = cls(
            name, case, whole, None, measure.Curves.of_csv(curves), {}, json.loads(numbers.read_text("utf-8"))
        )
        if isinstance(case, Drum):
            found._drum(case)
        found.checks = [Check(**check) for check in found.numbers["checks"]]
        return found

    def _silo(self, case: Silo) -> None:
        """The rate, beside what is expected and beside the published curves in the same time."""
        line, asked = measure.rate(self.ours, case.grains), targets.expected_rate(self.name, case)
        if line is None:
            return
        off = line.rate / asked - 1
        times = self.ours.time[self.ours.time <= line.last + 1e-9]
        beside = {key: measure.rate(measure.at(c, times), case.grains) for key, c in self.others.items()}
        rates = {key: other.rate for key, other in beside.items() if other}
        self.numbers |= {
            "rate": line.rate, "rate_expected": asked, "rate_off": off, "line_off": line.off,
            "line_from_s": line.first, "line_to_s": line.last, "rates_of_others": rates,
        }  # fmt: skip
        # A part of a run is held against the same part of the others: their rates fall by some per cent in 5 s.
        if self.whole and not self.ended and rates:
            asked = float(np.mean([*rates.values()]))
        most = targets.RATE_OFF if self.whole else targets.SMALL_RATE_OFF
        self.checks = [
            Check(
                "rate, grains/s", f"{line.rate:.0f}", f"{asked:.0f} +- {100 * most:.0f} %",
                abs(line.rate / asked - 1) <= most,
            ),
            Check(
                "largest distance from a line, of all grains", f"{100 * line.off:.2f} %",
                f"at most {100 * targets.STRAIGHT:.1f} %", line.off <= targets.STRAIGHT,
            ),
        ]  # fmt: skip

    def _drum(self, case: Drum) -> None:
        """Peaks and troughs, beside those of the mean of the published curves."""
        self.others = {key: scaled(c, self.whole) for key, c in measure.published(self.name).items()}
        if len(self.ours.time) < 3:
            return
        self.pairs = measure.pairs(self.ours, measure.mean(list(self.others.values())))
        self.numbers["turns"] = [
            {
                "curve": p.curve, "peak": p.expected.peak, "time_s": p.expected.time, "count": p.expected.count,
                "late_s": p.late if p.found else None, "off": p.off if p.found else None, "ok": self.held(p),
            }
            for p in self.pairs
        ]  # fmt: skip
        # A drum of few large grains does not follow the whole one so closely: its turns are shown and not judged.
        if self.whole and self.pairs:
            held = sum(map(self.held, self.pairs))
            self.checks = [
                Check("peaks and troughs", f"{held} of {len(self.pairs)}", "all", held == len(self.pairs))
            ]

    def held(self, pair: measure.Pair) -> bool:
        """Whether a peak or trough is where it should be."""
        assert isinstance(self.case, Drum)
        grains = self.case.small if pair.curve.endswith("M1") else self.case.large
        most = max(targets.TURN_OFF * pair.expected.count, targets.TURN_LEAST * grains)
        return abs(pair.late) <= targets.TURN_LATE + 1e-9 and abs(pair.off) <= most

    def _time(self) -> None:
        """The wall time, beside that of LIGGGHTS: of a whole run that has come to its end."""
        limit = targets.LIGGGHTS_S.get(self.name)
        wall = self.numbers["flow_wall_s"]
        if self.whole and limit and wall and self.ended:
            self.checks.append(Check("wall time, s", f"{wall:.0f}", f"below {limit:.0f}", wall < limit))

    def _audit(self, place: Path) -> None:
        """The verdict of `carom check`."""
        report = carom.audit.check(place)
        self.numbers["audit"] = {"ok": report.ok, "findings": [str(f) for f in report.findings]}
        worst = "; ".join(str(f) for f in report.findings) or "clean"
        self.checks.append(Check("carom check", worst, "clean", report.ok))

    def write(self, stem: Path) -> list[Path]:
        """Curves, figure and numbers, beside the run."""
        paths = [stem.with_name(stem.name + end) for end in (".csv", ".json", ".png")]
        self.ours.to_csv(paths[0])
        paths[1].write_text(json.dumps(self.numbers, indent=2) + "\n", "utf-8")
        figures.draw(self, paths[2])
        return paths


def scaled(curves: measure.Curves, whole: bool) -> measure.Curves:
    """Curves of the whole drum as they are expected of the small one, which turns faster and has fewer grains."""
    if whole:
        return curves
    counts = {name: PART * n for name, n in curves.counts.items()}
    return measure.Curves(SCALE**0.5 * curves.time, counts)


def accounts(case: Case, result: Result, place: Path) -> dict[str, Any]:
    """What the run was asked and what it cost: from the table of its steps, which a run that goes on has as well."""
    steps, options = result.steps, result.scene.run
    reached = float(steps["time"][-1])
    return {
        "grains": case.grains, "step_s": options.step, "pile_tolerance": options.pile_tolerance,
        "method": options.method, "threads": options.threads, "time_s": reached - SETTLING, "of_s": case.duration,
        **times(place, reached, options.step),
        "residual_position": float(np.max(steps["residual_position"])),
        "residual_velocity": float(np.max(steps["residual_velocity"])),
        "penetration_relative": float(np.max(steps["penetration_relative"])),
        "steps": len(steps), "build": result.versions["build"][:8],
        **{column: int(np.sum(steps[column])) for column in COUNTS},
    }  # fmt: skip


def times(place: Path, reached: float, step: float) -> dict[str, float | None]:
    """CPU and wall time of the bed and of the flow; None where something was not timed, as in a run that goes on."""
    path = place / TIMES
    parts = [json.loads(line) for line in path.read_text("utf-8").splitlines()] if path.is_file() else []
    # Parts that `carom resume` made, or that were killed, have no line.
    known = bool(parts) and parts[-1]["until"] >= reached - 1e-9
    segments = json.loads((place / "run.json").read_text("utf-8"))["segments"]
    found: dict[str, float | None] = {}
    for name, of_bed in (("bed", True), ("flow", False)):
        cpu = [part["cpu_s"] for part in parts if (part["until"] <= SETTLING + 1e-9) == of_bed]
        wall = [s.get("wall_s") for s in segments if (s["from_step"] * step < SETTLING - 1e-9) == of_bed]
        found[f"{name}_cpu_s"] = sum(cpu) if known or of_bed else None
        # The segment that is being written has no time yet.
        found[f"{name}_wall_s"] = sum(wall) if wall and all(wall) else None
    return found


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [list(head), ["---"] * len(head), *map(list, rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def text(found: Sequence[Found]) -> str:
    """All tables."""
    parts = [rates(found), turns(found), solved(found), cost(found), checks(found)]
    return "\n".join(part for part in parts if part)


def rates(found: Sequence[Found]) -> str:
    """A row for each silo that has flowed long enough."""
    rows = []
    for f in found:
        n = f.numbers
        if "rate" in n:
            others = ", ".join(f"{key} {value:.0f}" for key, value in n["rates_of_others"].items())
            rows.append([
                f.name, str(n["grains"]), f"{n['line_from_s']:.2f} to {n['line_to_s']:.2f} s", f"{n['rate']:.0f}",
                f"{n['rate_expected']:.0f}", f"{100 * n['rate_off']:+.1f} %", f"{100 * n['line_off']:.2f} %", others or "-",
            ])  # fmt: skip
    head = ["silo", "grains", "fitted", "grains/s", "expected", "off", "from the line", "others, same time"]
    return table(head, rows) if rows else ""


def turns(found: Sequence[Found]) -> str:
    """A row for each peak and trough of the whole drum."""
    rows = []
    for f in (one for one in found if one.whole):
        for p in f.pairs:
            what = "peak" if p.expected.peak else "trough"
            at = f"{p.found.time:.2f} s, {p.found.count:.0f}" if p.found else "none"
            expected = f"{p.expected.time:.2f} s, {p.expected.count:.0f}"
            rows.append([p.curve.replace("_", ", "), what, expected, at, "yes" if f.held(p) else "no"])
    head = ["zone, grains", "", "LIGGGHTS and MUSEN", "Carom", "within 15 % and 0.15 s"]
    return table(head, rows) if rows else ""


def solved(found: Sequence[Found]) -> str:
    """A row for each run: residuals, overlaps, counts."""
    rows = []
    for f in found:
        n = f.numbers
        rows.append([
            f.name, n["build"], f"{n['step_s']:g} s", f"{n['pile_tolerance']:g}", str(n["steps"]),
            f"{n['residual_position']:.1e}", f"{n['residual_velocity']:.1e}", f"{n['penetration_relative']:.1e}",
            *(str(n[key]) for key in COUNTS),
        ])  # fmt: skip
    head = [
        "case",
        "build",
        "step",
        "`pile_tolerance`",
        "steps",
        "residual, positions",
        "velocities",
        "overlap/r",
    ]
    return table([*head, *COUNTS.values()], rows)


def cost(found: Sequence[Found]) -> str:
    """A row for each run: times."""
    rows = []
    for f in found:
        n = f.numbers
        limit = targets.LIGGGHTS_S.get(f.name) if f.whole else None
        spent = [n[key] for key in ("bed_cpu_s", "bed_wall_s", "flow_cpu_s", "flow_wall_s")]
        rows.append([
            f.name, f"{n['time_s']:.2f} of {n['of_s']:g} s", str(n["threads"]),
            *(whole_number(value) for value in (*spent, pace(n), limit)),
        ])  # fmt: skip
    head = [
        "case",
        "simulated",
        "threads",
        "bed: CPU s",
        "wall s",
        "flow: CPU s",
        "wall s",
        "all, at this pace: wall s",
        "LIGGGHTS, 24 ranks: wall s",
    ]
    return table(head, rows)


def pace(numbers: dict[str, Any]) -> float | None:
    """Wall time of all of the flow if it went on as so far, s."""
    wall, time = numbers["flow_wall_s"], numbers["time_s"]
    return wall * numbers["of_s"] / time if wall and time > 0 else None


def whole_number(value: float | None) -> str:
    """For a table."""
    return "-" if value is None else f"{value:.0f}"


def checks(found: Sequence[Found]) -> str:
    """Every target that is judged."""
    rows = [[f.name, c.name, c.value, c.asked, "met" if c.ok else "MISSED"] for f in found for c in f.checks]
    rows += ratio(found)
    return table(["case", "", "found", "asked", ""], rows) if rows else ""


def ratio(found: Sequence[Found]) -> list[list[str]]:
    """The two rates over each other."""
    rates = {f.name: f.numbers["rate"] for f in found if f.whole and "rate" in f.numbers}
    if len(rates) < 2:
        return []
    value = rates["silo-large"] / rates["silo-small"]
    ok = abs(value - targets.RATIO) <= targets.RATIO_OFF
    asked = f"{targets.RATIO:.2f} +- {targets.RATIO_OFF:g}"
    return [["both silos", "ratio of rates", f"{value:.2f}", asked, "met" if ok else "MISSED"]]


def write_page(found: Sequence[Found], page: Path) -> None:
    """The tables between their marks, and curves and figures in a folder of the page's name; other cases keep their rows."""
    folder = page.parent / page.stem
    folder.mkdir(exist_ok=True)
    for f in found:
        f.write(folder / f"{f.size}-{f.name}")
    for size in dict.fromkeys(f.size for f in found):
        begin, end = MARKS[size]
        before, rest = page.read_text("utf-8").split(begin)
        _, after = rest.split(end)
        new = {f.name: f for f in found if f.size == size}
        rows = []
        for name, case in (WHOLE if size == "whole" else SMALL).items():
            stem = folder / f"{size}-{name}"
            if name in new:
                rows.append(new[name])
            elif stem.with_name(stem.name + ".json").is_file():
                rows.append(Found.kept(name, case, stem, whole=size == "whole"))
        page.write_text(f"{before}{begin}\n\n{text(rows)}\n{end}{after}", "utf-8")
