"""What an example hands over: rows of a table, figures, counts, paragraphs. `page.py` and `figures.py` show them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError
from carom.reproduce.errata import BY_KEY

Verdict = Literal["ok", "paper in error", "short"]
Scale = Literal["linear", "log"]
Kind = Literal["line", "dashed", "points", "marked"]
#: Greatest and mean number of iterations of one sub-problem.
Iterations = tuple[float, float]

T = TypeVar("T")


class NotConverged(CaromError):
    """A run of an example stopped before its end because a step could not be solved."""


def _finite(where: str, **numbers: float | None) -> None:
    for name, value in numbers.items():
        if value is not None and not math.isfinite(value):
            raise ValueError(f"{where}: {name} is {value}; it must be a finite number")


@dataclass(frozen=True)
class Row:
    """One quantity: what the paper prints, what a closed form gives, what Carom gives.

    `tolerance` is the admitted magnitude of `difference`, in `unit`; `origin` says where it comes from, e.g. "the
    paper prints 3 digits", "first order, c h with c = 0.3", "rounding". A row with `paper_in_error` is held against
    the corrected closed form (`against="analytic"`), shows the printed value in `paper` and says in `note` what is
    wrong, and why; `erratum` is the key of that error in `errata.ERRATA`, which other rows may show as well.
    """

    quantity: str
    unit: str
    paper: float | str | None
    analytic: float | None
    carom: float
    tolerance: float
    origin: str
    against: Literal["paper", "analytic"]
    note: str = ""
    paper_in_error: bool = False
    erratum: str = ""
    example: str = ""
    """The `Example` that holds it, which sets this."""

    def __post_init__(self) -> None:
        """Refuse a row that cannot be judged: every verdict on the page is a comparison of two finite numbers."""
        where = ", ".join(filter(None, (self.example, self.quantity)))
        printed = self.paper if isinstance(self.paper, float | int) else None
        _finite(where, paper=printed, analytic=self.analytic, carom=self.carom, tolerance=self.tolerance)
        if self.tolerance < 0:
            raise ValueError(f"{where}: tolerance is {self.tolerance}; it must not be negative")
        if self.against not in ("paper", "analytic"):
            raise ValueError(f"{where}: against is {self.against!r}; it must be 'paper' or 'analytic'")
        if (printed if self.against == "paper" else self.analytic) is None:
            raise ValueError(f"{where}: compared with the {self.against} value, which is not a number")
        if not self.origin:
            raise ValueError(f"{where}: origin is empty; say where the tolerance comes from")
        if self.paper_in_error and (self.against != "analytic" or not self.note or self.paper is None):
            raise ValueError(
                f"{where}: an error of the paper needs its printed value, the corrected one in analytic"
                " (compared with that) and a note"
            )
        if self.erratum and (not self.paper_in_error or self.erratum not in BY_KEY):
            raise ValueError(
                f"{where}: erratum {self.erratum!r} is not in the list, or the row is not in error"
            )

    @property
    def reference(self) -> float:
        """The value that Carom's is compared with."""
        value = self.paper if self.against == "paper" else self.analytic
        assert isinstance(value, float | int)
        return float(value)

    @property
    def difference(self) -> float:
        """Carom minus the reference."""
        return self.carom - self.reference

    @property
    def verdict(self) -> Verdict:
        """`ok` or `short`; `paper in error`: agrees with the corrected value, which the paper's own does not."""
        if not abs(self.difference) <= self.tolerance:
            return "short"
        return "paper in error" if self.paper_in_error else "ok"


@dataclass(frozen=True)
class Curve:
    """One curve of a figure: `x` and `y` of shape (n,). `body` fixes the colour: the same body has it in all figures.

    `marked` is a line with a point at each of its values.
    """

    label: str
    x: F64
    y: F64
    kind: Kind = "line"
    body: int | None = None

    def __post_init__(self) -> None:
        """Make arrays of what was given, and refuse what cannot be drawn."""
        for name in ("x", "y"):
            values = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
                raise ValueError(
                    f"curve {self.label!r}: {name} must be a row of finite numbers, at least one"
                )
            object.__setattr__(self, name, values)
        if len(self.x) != len(self.y):
            raise ValueError(f"curve {self.label!r}: {len(self.x)} values of x, {len(self.y)} of y")


@dataclass(frozen=True)
class Figure:
    """One figure of the paper, drawn anew. `number` as in the paper ("3a"); axes labelled with units, "time in s".

    `caption` says what it shows and what the paper says about it. `slopes` are reference slopes drawn in log-log axes.
    `limits` are (x from, x to, y from, y to), None where the data decide; `equal`: one metre is as long on both axes.
    """

    number: str
    title: str
    xlabel: str
    ylabel: str
    curves: tuple[Curve, ...]
    caption: str
    xscale: Scale = "linear"
    yscale: Scale = "linear"
    slopes: tuple[float, ...] = ()
    limits: tuple[float | None, float | None, float | None, float | None] = (None, None, None, None)
    equal: bool = False
    example: str = ""
    """The `Example` that holds it, which sets this."""

    def __post_init__(self) -> None:
        """A logarithmic axis needs positive numbers; say so here, where the example is known."""
        where = f"figure {self.number}"
        if not self.curves:
            raise ValueError(f"{where} has no curve")
        for curve in self.curves:
            for axis, scale, values in (("x", self.xscale, curve.x), ("y", self.yscale, curve.y)):
                if scale == "log" and not (values > 0).all():
                    raise ValueError(
                        f"{where}: {axis} of {curve.label!r} must be positive on a logarithmic axis"
                    )
        if self.slopes and (self.xscale, self.yscale) != ("log", "log"):
            raise ValueError(f"{where}: slopes need two logarithmic axes")

    @property
    def name(self) -> str:
        """Name of its files, without ending."""
        return f"{self.example}_figure_{self.number}"


@dataclass(frozen=True)
class Counts:
    """Iterations of one run beside the paper's. `line_search`: line searches at position and velocity level, in all.

    `paper` holds what the paper prints under the same names (`smooth`, `position`, `velocity`, `line_search`); a pair
    with None where it prints one number of two, no key where it prints nothing. `tolerance` is the solver's, `step`
    in s.
    """

    case: str
    smooth: Iterations
    position: Iterations
    velocity: Iterations
    line_search: tuple[int, int]
    paper: Mapping[str, tuple[float | None, float | None]]
    unconverged: int
    fallbacks: int
    tolerance: float
    step: float

    def __post_init__(self) -> None:
        """Refuse names that the table would not show."""
        unknown = set(self.paper) - {"smooth", "position", "velocity", "line_search"}
        if unknown:
            raise ValueError(f"counts of {self.case}: unknown names {sorted(unknown)}")
        _finite(f"counts of {self.case}", tolerance=self.tolerance, step=self.step)


@dataclass(frozen=True)
class Example:
    """All that one example of the paper gave.

    `texts` are paragraphs of Markdown: what was done, errata, differences explained. `options`: name of a run -> its
    numerical options. `scenarios`: file names in `scenarios/paper`. The runner sets `wall_s`.
    """

    id: str
    title: str
    rows: tuple[Row, ...]
    figures: tuple[Figure, ...] = ()
    counts: tuple[Counts, ...] = ()
    texts: tuple[str, ...] = ()
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    scenarios: tuple[str, ...] = ()
    wall_s: float = 0.0

    def __post_init__(self) -> None:
        """Everything in it is its own, and no two rows or figures have one name."""
        for name in ("rows", "figures"):
            parts = tuple(replace(part, example=self.id) for part in getattr(self, name))
            object.__setattr__(self, name, parts)
        for kind, names in (
            ("quantity", [row.quantity for row in self.rows]),
            ("figure", [figure.number for figure in self.figures]),
        ):
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise ValueError(f"example {self.id}: {kind} {twice[0]!r} occurs twice")


@dataclass(frozen=True)
class Context:
    """How examples are to be run.

    `quick`: the same rows with the same tolerances, from fewer points (steps of a study of convergence, cases of a
    figure). `threads`: threads of one simulation; examples run beside each other, so 1 is right. `tolerance`: a
    tolerance of the solver that replaces the default one, None for the default. `parts`: results computed before, see
    `part`.
    """

    quick: bool = False
    threads: int = 1
    tolerance: float | None = None
    parts: Mapping[str, Any] = field(default_factory=dict)

    def part(self, name: str, function: Callable[[Context], T]) -> T:
        """Result of a heavy part of an example: computed by the runner in a process of its own, or here and now.

        A module that has such parts names them in `PARTS: dict[str, Callable[[Context], Any]]`; the functions stand at
        module level and what they return can be pickled.
        """
        found: T = self.parts[name] if name in self.parts else function(self)
        return found

    @staticmethod
    def scenario(name: str) -> Path:
        """Path of a scenario of the paper by its file name, in a checkout and in an installed package."""
        return Path(__file__).resolve().parent.parent / "scenarios" / "paper" / name


def to_json(value: Any) -> Any:
    """Plain lists, dictionaries, numbers and strings of anything above; a row has its difference and its verdict."""
    if isinstance(value, Row):
        plain = {"example": value.example, **{f.name: to_json(getattr(value, f.name)) for f in fields(value)}}
        return plain | {"difference": value.difference, "verdict": value.verdict}
    if hasattr(value, "__dataclass_fields__"):
        return {f.name: to_json(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray | np.generic):
        return to_json(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [to_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
