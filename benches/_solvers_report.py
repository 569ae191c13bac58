"""What solvers.py found, as lines, as CSV and JSON, and in the documentation."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from _solvers_programs import Call, Problem, Solver
from carom.problem import GlobalProblem
from carom.text import seconds

#: Widths of the columns: problem, contacts, a solver.
NAME, COUNT, CELL = 42, 8, 18
FEW = 50
"""Contacts below which the cost of a call of Siconos, some 0.3 ms, is most of its time."""
#: Where the tables stand in a page of the documentation.
BEGIN, END = "<!-- printed by benches/solvers.py -->", "<!-- end of what is printed -->"


@dataclass(frozen=True)
class Entry:
    """One solver on one problem; `seconds` is NaN and `tolerance` None where it is not solved."""

    problem: str
    group: str
    form: str
    contacts: int
    rows_of_contact: int
    program: str
    solver: str
    options: str
    solved: bool
    seconds: float
    iterations: int
    err: float
    tolerance: float | None
    told: str
    stages: str

    @classmethod
    def of(
        cls, problem: Problem, solver: Solver, tolerance: float | None, best: float, call: Call, err: float
    ) -> Entry:
        """What `call`, and `best` (s) of the rounds, say."""
        p = problem.contact_problem
        stages = [f"{s['name']} {s['iterations']} ({s['err']:.0e})" for s in call.stages]
        return cls(
            problem=problem.name,
            group=problem.group,
            form="global" if isinstance(p.source, GlobalProblem) else "local",
            contacts=p.contacts,
            rows_of_contact=p.dimension,
            program=solver.program,
            solver=solver.name,
            options=solver.options,
            solved=tolerance is not None,
            seconds=best if tolerance is not None else math.nan,
            iterations=call.iterations,
            err=err,
            tolerance=tolerance,
            told=call.told,
            stages=" > ".join(stages),
        )

    @property
    def label(self) -> str:
        """Program and solver."""
        return f"{self.program} {self.solver}"

    @property
    def cell(self) -> str:
        """Time and iterations, or the err that was reached."""
        if self.solved:
            return f"{seconds(self.seconds)}/{self.iterations}"
        return f"({self.err:.0e})" if math.isfinite(self.err) else "(none)"


class Report:
    """All entries, and how they are shown."""

    def __init__(self, header: str, bound: float, limit: float, solvers: Sequence[Solver]) -> None:
        self.header, self.bound, self.limit = header, bound, limit
        self.labels = list(dict.fromkeys(f"{s.program} {s.name}" for s in solvers))
        self.entries: list[Entry] = []

    @property
    def compared(self) -> list[str]:
        """Columns of ratios, where both programs take part."""
        both = {label.split()[0] for label in self.labels} == {"Carom", "Siconos"}
        return ["auto/best S.", "auto/NSN_AC"] if both and "Carom auto" in self.labels else []

    def head(self, lines: bool) -> str:
        """The line above those of `lines`."""
        about = f"Solved: err <= {self.bound:g} within {self.limit:g} s; "
        if lines:
            return about + "time, iterations, err, and what the solver says."
        columns = [f"{label[0]}. {label.split(' ', 1)[1]}" for label in self.labels]
        head = "problem".ljust(NAME) + "contacts".rjust(COUNT)
        head += "".join(c.rjust(CELL) for c in [*columns, *self.compared])
        return f"{about}time/iterations, or in brackets the err where not. C.: Carom, S.: Siconos.\n{head}"

    def lines(self, problem: Problem, found: Sequence[Entry], one_each: bool) -> list[str]:
        """What there is to say of one problem."""
        start = problem.name[: NAME - 1].ljust(NAME) + str(problem.contact_problem.contacts).rjust(COUNT)
        if one_each:
            return [
                f"{start}  {e.label:<16}  {'solved' if e.solved else 'NOT solved':<10}"
                f"  {seconds(e.seconds) if e.solved else '':>8}  {e.iterations:>7} it.  err {e.err:8.2e}"
                f"  {'; '.join(filter(None, (e.told, e.stages)))}".rstrip()
                for e in found
            ]
        by = {e.label: e for e in found}
        cells = [by[label].cell if label in by else "" for label in self.labels]
        cells += [_ratio(x) for x in ratios(found)[: len(self.compared)]]
        return [start + "".join(c.rjust(CELL) for c in cells)]

    def of_problems(self) -> dict[str, list[Entry]]:
        """The entries of each problem."""
        found: dict[str, list[Entry]] = {}
        for e in self.entries:
            found.setdefault(e.problem, []).append(e)
        return found

    def standing(self) -> list[tuple[str, int, int, int]]:
        """Of each solver: problems, solved, and solved as the fastest."""
        found = []
        for label in self.labels:
            mine = [e for e in self.entries if e.label == label]
            best = sum(
                e.solved and e.seconds <= min(o.seconds for o in self.of_problems()[e.problem] if o.solved)
                for e in mine
            )
            found.append((label, len(mine), sum(e.solved for e in mine), best))
        return found

    def compare(self) -> list[str]:
        """Carom's `auto` against Siconos over all problems, in words."""
        text = []
        for name, k in (("the best of Siconos", 0), ("NSN_AC", 1)):
            of_each = [(v[0].contacts, ratios(v)[k]) for v in self.of_problems().values()]
            known = [(contacts, r) for contacts, r in of_each if math.isfinite(r) and r > 0]
            if not known:
                continue
            text.append(
                f"Carom auto over {name}: {_mean([r for _, r in known]):.2g} in the geometric mean of {len(known)}"
                f" problems that both solve, {max(r for _, r in known):.2g} at worst"
            )
            if name == "NSN_AC":
                for which, chosen in (
                    (f"{FEW} contacts and more", [r for contacts, r in known if contacts >= FEW]),
                    (
                        "fewer contacts, where the cost of a call counts",
                        [r for contacts, r in known if contacts < FEW],
                    ),
                ):
                    if chosen:
                        count = f"{len(chosen)} problem{'s' * (len(chosen) != 1)}"
                        text.append(
                            f"Carom auto over {name}, {which}: {_mean(chosen):.2g} in the geometric mean of {count}"
                        )
        return text

    def summary(self) -> list[str]:
        """What the table says in all."""
        rows = [
            f"{label + ':':<26} {solved} of {n} solved, {best} fastest"
            for label, n, solved, best in self.standing()
        ]
        return rows + self.compare()

    def write(self, path: Path) -> None:
        """CSV, and JSON beside it."""
        path.parent.mkdir(parents=True, exist_ok=True)
        names = [f.name for f in fields(Entry)]
        with path.open("w", newline="", encoding="utf-8") as file:
            file.write(f"# {self.header}\n")
            writer = csv.writer(file)
            writer.writerow(names)
            writer.writerows([getattr(e, name) for name in names] for e in self.entries)
        document = {"about": self.header, "bound": self.bound, "limit_s": self.limit}
        rows = [{k: _plain(v) for k, v in asdict(e).items()} for e in self.entries]
        text = json.dumps({**document, "entries": rows}, indent=1, allow_nan=False)
        path.with_suffix(".json").write_text(text + "\n", encoding="utf-8")

    def write_page(self, page: Path) -> None:
        """Tables and the performance profile into `page`, between the marks that are there."""
        before, rest = page.read_text(encoding="utf-8").split(BEGIN)
        after = rest.split(END)[1]
        text = "\n".join([BEGIN, "", *self._page(page.parent), END])
        page.write_text(before + text + after, encoding="utf-8")

    def _page(self, folder: Path) -> list[str]:
        out = [f"{self.header}. Solved: err <= {self.bound:g} within {self.limit:g} s.", ""]
        out += [f"- {line}." for line in self.compare()]
        options = {(e.label, e.rows_of_contact): e.options for e in self.entries if e.program == "Siconos"}
        out += ["", *_table(["solver", "problems", "solved", "fastest"], self.standing())]
        out += ["", *_table(["solver", "rows", "options"], [(*k, v) for k, v in options.items()])]
        drawn = self.draw(folder, "solvers_profile")
        if drawn:
            out += ["", f"![performance profile of the solvers on problems of three rows]({drawn})"]
        groups = dict.fromkeys((e.group, e.rows_of_contact) for e in self.entries)
        for group, rows in groups:
            mine = [
                v for v in self.of_problems().values() if (v[0].group, v[0].rows_of_contact) == (group, rows)
            ]
            labels = [label for label in self.labels if any(e.label == label for v in mine for e in v)]
            cells = []
            for found in mine:
                by = {e.label: e.cell for e in found}
                row = [found[0].problem, found[0].contacts, *(by.get(label, "") for label in labels)]
                cells.append((*row, *map(_ratio, ratios(found))))
            out += ["", f"### {group.capitalize()}, {rows} rows for each contact", ""]
            out += _table(["problem", "contacts", *labels, "auto / best Siconos", "auto / NSN_AC"], cells)
        return [*out, ""]

    def draw(self, folder: Path, name: str) -> str:
        """The profile of `auto` and of Siconos on problems of three rows; the name of the file, if there is one."""
        from carom.problem.profile import Profile
        from carom.show.plot.profile import performance
        from carom.show.plot.style import legend, save, styled

        mine = [v for v in self.of_problems().values() if v[0].rows_of_contact == 3]
        labels = [label for label in self.labels if all(any(e.label == label for e in v) for v in mine)]
        labels = [label for label in labels if label == "Carom auto" or not label.startswith("Carom")]
        if len(mine) < 2 or len(labels) < 2:
            return ""
        times = [[next(e.seconds for e in v if e.label == label) for label in labels] for v in mine]
        title = (
            f"Carom auto and solvers of Siconos, {len(mine)} problems of three rows, err <= {self.bound:g}"
        )
        chart = performance(Profile.of([label.removeprefix("Siconos ") for label in labels], times), title)
        chart.figure.legends[0].remove()  # one line is too long for so many names
        with styled():
            legend(chart.figure, chart.figure.axes[0], columns=4)
        return save(chart, folder, name, ["svg"])[0].name


def ratios(found: Sequence[Entry]) -> tuple[float, float]:
    """Carom's `auto` over the best of Siconos and over its NSN_AC; NaN without both, 0 where only Carom solves it."""
    auto = [e for e in found if (e.program, e.solver) == ("Carom", "auto")]
    peers = [e for e in found if e.program == "Siconos"]

    def over(theirs: list[Entry]) -> float:
        if not auto or not theirs or not any(e.solved for e in [*auto, *theirs]):
            return math.nan
        times = [e.seconds for e in theirs if e.solved]
        if not auto[0].solved:
            return math.inf
        return auto[0].seconds / min(times) if times else 0.0

    return over(peers), over([e for e in peers if e.solver == "NSN_AC"])


def _table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> list[str]:
    """A table of Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return ["| " + " | ".join(map(str, line)) + " |" for line in lines]


def _ratio(x: float) -> str:
    if math.isnan(x):
        return ""
    return {0.0: "Carom alone", math.inf: "Siconos alone"}.get(x, f"{x:.2g}")


def _plain(x: Any) -> Any:
    return None if isinstance(x, float) and not math.isfinite(x) else x


def _mean(ratios: Sequence[float]) -> float:
    """The geometric mean."""
    return math.exp(sum(map(math.log, ratios)) / len(ratios))
