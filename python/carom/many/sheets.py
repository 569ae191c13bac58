"""Comparisons and convergence studies as tables of text: what the command line prints, and `str()` of them in Python."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from carom.arrays import F64
from carom.many.impulses import half
from carom.many.order import pairwise_order
from carom.many.quantity import QUANTITIES
from carom.text import WIDTH, columns, seconds, table

if TYPE_CHECKING:
    from carom.many.compare import Comparison, MethodRun
    from carom.many.converge import Convergence
    from carom.many.order import Order


#: Bodies whose velocities a comparison of impact laws lists.
MOST_BODIES = 20


@dataclass(frozen=True)
class Sheet:
    """A title, a table as `carom.text.table` has it, and remarks."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    remarks: Sequence[str] = ()
    left: Collection[int] = (0,)

    def __str__(self) -> str:
        return "\n".join([self._text(WIDTH), *(f"note: {remark}" for remark in self.remarks)])

    def show(self) -> None:
        """Print title and table, as wide as the terminal; remarks are for standard error and left to the caller."""
        print(self._text(columns()))

    def _text(self, width: int) -> str:
        return f"{self.title}\n\n{table([self.head, *self.rows], width, head=True, left=self.left)}"


def titled(title: str, case: str | None) -> str:
    """The title of a scene with its case."""
    return f"{title} [{case}]" if case else title


def of_comparison(found: Comparison, untitled: str = "comparison") -> Sheet:
    """A column for each method; `untitled` heads the table where the scene has no title."""
    runs = list(found)
    rows: list[list[str]] = []

    def row(label: str, cell: Callable[[MethodRun], str]) -> None:
        cells = [cell(run) for run in runs]
        if any(c != "-" for c in cells):
            rows.append([label, *cells])

    def counts(label: str, key: str) -> None:
        row(label, lambda run: f"{run.numbers[key]:d}" if run.numbers.get(key) else "-")

    row("outcome", lambda r: "done" if r.ok else r.outcome.split(";")[0].split(" at ")[0])
    row("wall time", lambda r: seconds(r.numbers["wall_s"]))
    row("core time", lambda r: seconds(r.numbers["core_s"]))
    for key in ("steps", "substeps", "halvings"):
        counts(key, key)
    row("penetration (m)", lambda r: f"{max(0.0, r.numbers['penetration_max']):.1e}")
    row("final energy (J)", lambda r: f"{r.numbers['energy']['final']:.6g}")
    row("energy rise (J)", lambda r: f"{max(0.0, r.numbers['energy']['max_rise']):.1e}")
    counts("impulses of impacts", "impacts")
    counts("unconverged", "unconverged")
    counts("fallbacks", "fallbacks")
    if found.laws:
        _impulses(rows, runs)
        axes = found.directions
        along = ", ".join(f"v_{'xyz'[i]}" for i in axes)
        rows.append([f"velocities at {found.times[-1]:g} s, {along} (m/s)"])
        for k, name in enumerate(found.bodies[:MOST_BODIES]):
            row(f"  {name}", lambda r, k=k: _numbers(r.states["velocity"][-1][k, axes]))  # type: ignore[misc]
    for time in found.times if len(runs) > 1 else ():
        heading = [f"off {runs[0].name} at {time:g} s, greatest, and relative"]
        rows.append(heading)
        for quantity, (_, unit) in QUANTITIES.items():
            row(f"  {quantity.replace('_', ' ')} ({unit})", lambda r, q=quantity, t=time: _off(r, q, t))  # type: ignore[misc]
        if rows[-1] is heading:
            heading[0] = f"at {time:g} s no ball is there in all runs; take an earlier time with at"
    title = titled(found.title or untitled, found.case)
    return Sheet(
        f"{title}: h = {found.step:g} s to t = {found.times[-1]:g} s",
        ["", *(run.name for run in runs)],
        rows,
        found.remarks,
    )


def _numbers(values: F64) -> str:
    return "-" if np.isnan(values).all() else " ".join(f"{x:.5f}" for x in values)


def _impulses(rows: list[list[str]], runs: Sequence[MethodRun]) -> None:
    """When pairs have half of their impulse, and how much it is: the pairs of the first law in its order, then others."""
    pairs = dict.fromkeys(pair for run in runs for pair in run.order)
    if pairs:
        rows.append(["impulse: half of it after so many impact problems, and N s"])
    for pair in pairs:
        found = [run.impulses.get(pair) for run in runs]
        rows.append([f"  {pair}", *("-" if p is None else f"{half(p):.3f}  {p[-1, 1]:.3e}" for p in found)])


def _off(run: MethodRun, quantity: str, time: float) -> str:
    for d in run.differences:
        if d.quantity == quantity and abs(d.time - time) < 1e-12 + 1e-9 * time:
            return f"{d.greatest:.1e}  {d.relative:.0e}"
    return "-"


def of_convergence(found: Convergence, untitled: str = "convergence") -> Sheet:
    """A row for each step: the errors and the orders between neighbours, and the fitted orders below."""
    names = list(found.errors)
    rows = []
    for i, h in enumerate(found.steps):
        cells = [f"{h:.4g}"]
        for name in names:
            cells += [f"{found.errors[name][i]:.3e}", _between(found, name, i)]
        rows.append(cells)
    fits: list[str] = []
    for name in names:
        order = found.orders[name]
        fits += ["" if order is None else _fitted(order), ""]
    rows += [["least squares", *fits]]
    head = ["h (s)", *(cell for name in names for cell in (name, "order"))]
    title = titled(found.title or untitled, found.case)
    return Sheet(
        f"{title}: relative error {found.where} against {found.reference}", head, rows, found.remarks
    )


def _fitted(order: Order) -> str:
    spread = f" +- {order.uncertainty:.3f}" if order.uncertainty == order.uncertainty else ""
    return f"{order.value:.3f}{spread}"


def _between(found: Convergence, name: str, i: int) -> str:
    """The order between a step and the one before it, where both errors stand clear of rounding."""
    if i == 0:
        return ""
    order = pairwise_order(found.steps[i - 1 : i + 1], found.errors[name][i - 1 : i + 1])
    return "-" if order is None else f"{order:.2f}"
