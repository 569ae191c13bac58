"""What `carom solve` prints and writes: one problem in full, several as a table, profiles of solvers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from carom.cli.output import seconds
from carom.errors import counted, one_line
from carom.files import csv_bytes, write_whole
from carom.text import columns, table

if TYPE_CHECKING:
    from carom.many.sheets import Sheet
    from carom.problem import Profile

#: A column is as wide as its longest cell: names of files that are longer than this are cut in the middle.
NAME_WIDTH = 48
#: A clock that did not tick: times of a profile are above 0.
TICK = 1e-9


@dataclass(frozen=True)
class Attempt:
    """One file by one solver: `facts` of the problem, then its `solution` (`Solution.to_dict()`) or an `error`."""

    path: Path
    facts: Mapping[str, Any] = field(default_factory=dict)
    solver: str = ""
    solution: Mapping[str, Any] | None = None
    error: str = ""

    @property
    def name(self) -> str:
        """The name of the file."""
        return self.path.name

    @property
    def err(self) -> float:
        """The residual; infinite without a solution."""
        return float(self.solution["err"]) if self.solution is not None else math.inf

    @property
    def verdict(self) -> str:
        """`solved`, `not solved`, or `refused` for what could not be read or begun."""
        if self.solution is None:
            return "refused"
        return "solved" if self.solution["converged"] else "not solved"

    @property
    def finished(self) -> str:
        """The stage that ended it."""
        stages = self.solution["stages"] if self.solution is not None else []
        return str(stages[-1]["name"]) if stages else "-"

    def to_dict(self) -> dict[str, Any]:
        """A row of `--json`."""
        row: dict[str, Any] = {"file": str(self.path), **self.facts, "verdict": self.verdict}
        row |= {"solver": self.solver} if self.solver else {}
        return row | dict(self.solution or {}) | ({"error": self.error} if self.error else {})


def show(done: Sequence[Attempt], document: Mapping[str, Any], *, explain: bool) -> None:
    """Print the report for a terminal."""
    if len(done) == 1 and done[0].solution is not None:
        print(_one(done[0]))
    elif len(done) > 1:
        _table(done, document).show()
        for a in done:
            if a.error:
                print(f"refused: {a.error}")
            elif explain:
                print(f"{a.name}, {a.solver}\n{_stages(a)}\n")
        if len(document["solvers"]) > 1:
            print(_ranking(document["solvers"]))
    for file in document.get("files", []):
        print(file)


def summary(done: Sequence[Attempt], names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Of each solver: files solved, seconds, and of several solvers the shares of the performance profile."""
    found: dict[str, dict[str, Any]] = {}
    profile = profile_of(done, names)
    for k, name in enumerate(names):
        mine = [a for a in done if a.solver == name]
        solved = [a for a in mine if a.verdict == "solved"]
        time = sum(a.solution["wall_s"] for a in mine if a.solution is not None)
        found[name] = {"problems": len(mine), "solved": len(solved), "wall_s": time}
        if len(names) > 1 and profile.problems:
            for key, tau in (("fastest", 1.0), ("within_2", 2.0), ("within_10", 10.0)):
                found[name][key] = float(profile.within(tau)[k])
    return found


def profile_of(done: Sequence[Attempt], names: Sequence[str]) -> Profile:
    """The profile of the problems that could be read and that every solver has tried."""
    import numpy as np

    from carom.problem import Profile

    times: dict[Path, dict[str, float]] = {}
    for a in done:
        if a.solver:
            solved = a.solution is not None and a.solution["converged"]
            time = max(float(a.solution["wall_s"]), TICK) if solved and a.solution is not None else math.inf
            times.setdefault(a.path, {})[a.solver] = time
    whole = [[row[name] for name in names] for row in times.values() if len(row) == len(names)]
    return Profile.of(names, np.array(whole).reshape(len(whole), len(names)))


def write(done: Sequence[Attempt], names: Sequence[str], out: Path, formats: Sequence[str]) -> list[Path]:
    """`results.csv`, and of several problems the profiles as figures with their numbers."""
    files = [out / "results.csv"]
    write_whole(files[0], csv_bytes(_rows(done)), durable=False, parents=True)
    profile = profile_of(done, names)
    if profile.problems > 1:
        from carom.show.plot import profile as drawn
        from carom.show.plot.style import save

        tolerance = next((a.solution["tolerance"] for a in done if a.solution is not None), 0.0)
        title = f"{counted(profile.problems, 'contact problem')} to err <= {tolerance:g}"
        if len(names) > 1:
            files += save(drawn.performance(profile, title), out, "profile", formats)
        files += save(drawn.times(profile, title), out, "times", formats)
    return files


# --- one problem ------------------------------------------------------------------------------------------------------


def _one(a: Attempt) -> str:
    """Problem, verdict and stages of one file by one solver, in the manner of `carom run`."""
    assert a.solution is not None
    f, s, r = a.facts, a.solution, a.solution["residual"]
    title = one_line(f["title"].strip(), 80)
    unique = ""
    if "rank" in f:
        unique = f"; rank {f['rank']}, nullity {f['nullity']}" + (
            ": r need not be unique" if f["nullity"] else ""
        )
    lines = [
        f"{title} ({a.name})" if title else a.name,
        f"{'solved' if s['converged'] else 'NOT SOLVED'}: err = {s['err']:.3g}, tolerance {s['tolerance']:g}",
        f"problem     {f['form']} form, {counted(f['contacts'], 'contact')} of {f['dimension']} rows",
        f"W           {f['rows']} rows, {counted(f['entries'], 'entry').replace('entrys', 'entries')}{unique}",
        f"solver      {a.solver}, {counted(s['iterations'], 'iteration')}, {seconds(s['wall_s'])}",
        f"worst       contact {r['worst']}: {r['worst_natural_map']:.3g} of {r['natural_map']:.3g};"
        f" complementarity {r['complementarity']:.3g}, outside the cone {r['cone_violation']:.3g},"
        f" penetration {r['penetration']:.3g}",
    ]
    return "\n".join([*lines, _stages(a)])


def _stages(a: Attempt) -> str:
    """The checkpoints, each with its reason at the end of the line."""
    assert a.solution is not None
    stages = a.solution["stages"]
    rows = [["stage", "solver", "iterations", "err", "time", "why"]]
    rows += [
        [
            s["name"],
            s["solver"],
            f"{s['iterations']}",
            _err(s["err"]),
            seconds(s["wall_s"]),
            one_line(s["why"]),
        ]
        for s in stages
    ]
    return table(rows, left=(0, 5))


# --- several ----------------------------------------------------------------------------------------------------------

HEAD = ("file", "contacts", "rows", "solver", "iterations", "time", "err", "finished by", "verdict")
#: Columns that a narrow terminal does without, in this order.
SPARE = ("rows", "finished by", "iterations", "contacts")


def _table(done: Sequence[Attempt], document: Mapping[str, Any]) -> Sheet:
    from carom.many.sheets import Sheet

    rows: list[dict[str, str]] = []
    before: Path | None = None
    for a in done:
        row = dict.fromkeys(HEAD, "-") | {"verdict": a.verdict, "solver": a.solver or "-"}
        row |= {key: str(a.facts[key]) for key in ("contacts", "rows") if key in a.facts}
        row["file"] = _cut(a.name)
        if a.path == before:
            row |= {"file": "", "contacts": "", "rows": ""}
        if a.solution is not None:
            row["iterations"], row["time"] = f"{a.solution['iterations']}", seconds(a.solution["wall_s"])
            row["err"], row["finished by"] = _err(a.err), a.finished
        rows.append(row)
        before = a.path
    solved = sum(a.verdict == "solved" for a in done)
    title = f"{solved} of {len(done)} solved to err <= {document['tolerance']:g}"
    head = list(HEAD)
    names = list(document["solvers"])
    if len(names) == 1:
        title = f"{solved} of {len(done)} solved by {names[0]} to err <= {document['tolerance']:g}"
        head.remove("solver")
    for spare in SPARE:
        if sum(max(len(name), *(len(row[name]) for row in rows)) + 2 for name in head) - 2 <= columns():
            break
        head.remove(spare)
    return Sheet(title, head, [[row[name] for name in head] for row in rows])


def _ranking(solvers: Mapping[str, Mapping[str, Any]]) -> str:
    """How often each solver is the fastest, or nearly."""
    rows = [["solver", "solved", "fastest", "within 2", "within 10", "time"]]
    for name, s in solvers.items():
        shares = [f"{s[key]:.0%}" if key in s else "-" for key in ("fastest", "within_2", "within_10")]
        rows.append([name, f"{s['solved']} of {s['problems']}", *shares, seconds(s["wall_s"])])
    return table(rows)


def _rows(done: Sequence[Attempt]) -> Iterator[Sequence[Any]]:
    columns = ("title", "form", "contacts", "dimension", "rows", "entries")
    found = ("iterations", "wall_s", "err")
    yield ("file", *columns, "solver", *found, "finished by", "verdict", "error")
    for a in done:
        solution = a.solution or {}
        row = [a.name, *(a.facts.get(key, "") for key in columns), a.solver]
        row += [solution.get(key, "") for key in found]
        yield [*row, a.finished, a.verdict, a.error]


def _cut(name: str) -> str:
    if len(name) <= NAME_WIDTH:
        return name
    half = (NAME_WIDTH - 3) // 2
    return f"{name[:half]}...{name[-half:]}"


def _err(value: float) -> str:
    return f"{value:.1e}" if math.isfinite(value) else "-"
