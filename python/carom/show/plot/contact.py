"""Contacts: which pairs touched when, sticking or slipping, and how the impacts of one step followed each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import F64, I64, Array, Bool
from carom.errors import CaromError, counted
from carom.measure.contacts import along_and_across, closed
from carom.result.data import RunData
from carom.show.plot.style import (
    COLOURS,
    GREY,
    LETTERS_PER_INCH,
    LINE,
    Chart,
    fitted,
    headed,
    paired,
    panels,
    styled,
    whole_numbers,
    width,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Pairs with a row of their own.
MOST_PAIRS = 14
#: Impulses below this share of the greatest are rounding.
NOTHING = 1e-12
#: Problems whose sums have stems; of more these would be a grey wall.
MOST_STEMS = 60
#: Width of a digit of the numbers at discs, in, with a share of the gap between them.
DIGIT = 0.085
STATUS = ("open", "stick", "slip")
LOOKS = {"stick": COLOURS[0], "slip": COLOURS[1]}


@dataclass(frozen=True)
class Strip:
    """A pair in one status from one time to another, s."""

    pair: tuple[str, str]
    begin: float
    end: float
    status: str


def phases(result: RunData) -> Chart:
    """A strip per pair of bodies: when it sticks, when it slips, when there is a gap (nothing).

    The status of a frame stands for the time since the frame before. A contact that closed and opened again between two
    frames is a tick. The axis ends at the last frame with contacts: that of a run cut short may be the state alone.
    """
    found, every = strips(result)
    pairs = list(dict.fromkeys(strip.pair for strip in found))
    time = np.asarray(result.time)
    more = every - len(pairs)
    left = f"{counted(more, 'further pair')} touched for a shorter time" if more else ""
    with styled():
        labels = [paired(pair, {name for other in pairs for name in other}) for pair in pairs]
        indent = _indent(labels)
        figure, (axes,) = panels(1, 0.9 + 0.26 * len(pairs), headed(result.title, left), indent)
        for status, colour in LOOKS.items():
            for row, pair in enumerate(pairs):
                spans = [(s.begin, s.end - s.begin) for s in found if (s.pair, s.status) == (pair, status)]
                axes.broken_barh(spans, (row - 0.32, 0.64), color=colour, linewidth=0.7)
            if any(s.status == status for s in found):
                axes.plot([], [], color=colour, linewidth=6, label=status)
        if ticks := [(s.end, pairs.index(s.pair)) for s in found if s.status == "open"]:
            between = "touched in between"
            axes.plot(*np.array(ticks).T, "|", color="black", markersize=7, label=between)
        axes.set_yticks(range(len(pairs)), labels)
        axes.set_ylim(len(pairs) - 0.4, -0.6)
        axes.set_xlim(time[0], time[-2 if result._has_bare_end else -1])
        axes.grid(axis="y", visible=False)
        axes.set_xlabel("time (s)")
        figure.legend(loc="outside upper left", ncols=3)
    columns = {"from (s)": "begin", "to (s)": "end", "status": "status"}
    numbers = {head: np.array([getattr(s, key) for s in found]) for head, key in columns.items()}
    return Chart(figure, {"pair": np.array([" - ".join(s.pair) for s in found]), **numbers})


def strips(result: RunData) -> tuple[list[Strip], int]:
    """Times of equal status of the pairs that touch longest, pair by pair, and how many pairs there are in all."""
    contacts = result.contacts
    if not len(contacts):
        raise CaromError(
            "the run holds no contacts: nothing touched, or contacts = false in [record]; simulate with contacts = true"
        )
    time = np.asarray(result.time)
    body = np.asarray(contacts["body"]).astype(np.int64)
    frame, status = np.asarray(contacts["frame"]), np.asarray(contacts["status"])
    size = np.linalg.norm(np.asarray(contacts["impulse"]), axis=1)
    felt = (status > 0) | (size > NOTHING * size.max(initial=0.0))  # open, and nothing was felt: a gap
    body, frame, status, gap = body[felt], frame[felt], status[felt], np.asarray(contacts["gap"])[felt]
    part = np.asarray(contacts["part"])[felt] if "part" in contacts else None
    names = [*result.names, *result.wall_names]
    pairs, of_row = np.unique(body[:, 0] * len(names) + body[:, 1], return_inverse=True)
    keys = np.stack(np.divmod(pairs, len(names)), axis=1)
    # Those that are in contact for most frames, in the order of their first.
    order = np.argsort(-np.bincount(of_row), kind="stable")[:MOST_PAIRS]
    first = {k: int(frame[of_row == k].min()) for k in order}
    found = []
    for k in sorted(order, key=lambda k: (first[k], k)):
        pair = names[keys[k][0]], names[keys[k][1]]
        frames, of_mesh = frame[of_row == k], None if part is None else part[of_row == k]
        # The table has the status of the last step in which the contact was closed, which may be before the frame.
        states = np.where(_closed(result, keys[k], gap[of_row == k], frames, of_mesh), status[of_row == k], 0)
        frames, one = np.unique(frames, return_index=True)
        states = np.maximum.reduceat(states, one)  # a ball may touch a mesh at several places
        breaks = np.flatnonzero((np.diff(frames) > 1) | (np.diff(states) != 0) | (states[1:] == 0)) + 1
        for run in np.split(np.arange(len(frames)), breaks):
            begin = time[max(0, frames[run[0]] - 1)]
            found.append(Strip(pair, float(begin), float(time[frames[run[-1]]]), STATUS[int(states[run[0]])]))
    return found, len(keys)


def _closed(result: RunData, pair: I64, gap: Array, frames: Array, part: Array | None) -> Bool:
    """Whether two bodies touch at some frames, where their contact had the recorded `gap`, m, when it was closed, of meshes
    with a `part`.
    """
    first, second = (
        np.asarray(result.position[:, end])[frames]
        for end in np.minimum(pair, len(result.names) - 1).tolist()
    )
    return closed(result, np.tile(pair, (len(frames), 1)), gap, (first, second), frames, part)


def impacts(result: RunData, step: int | None = None) -> Chart:
    """The impact problems of one step, by default of that with most: for each, the pairs that take part and their impulses.

    The area of a disc is the size of the normal impulse. Problem 0 is that of the loads in a step with an impact. Problems
    of several times in the step are numbered anew, in their order. Where a sequence is too long for numbers, a panel above
    shows the sum of the impulses of each problem.
    """
    step = busiest_step(result) if step is None else step
    rows = result.impacts.where(np.asarray(result.impacts["step"]) == step)
    if not len(rows):
        raise CaromError(f"there was no impact in step {step}; the busiest step is {busiest_step(result)}")
    normal, impulse = np.asarray(rows["normal"]), np.asarray(rows["impulse"])
    along, across = along_and_across(impulse, normal)
    problem = np.asarray(rows["problem"]).astype(np.int64)
    pairs = np.array([" - ".join(pair) for pair in np.asarray(rows["pair"])])
    strength = {pair: float(along[pairs == pair].sum()) for pair in pairs}
    shown = sorted(strength, key=lambda pair: -strength[pair])[:MOST_PAIRS]
    listed = [pair for pair in dict.fromkeys(pairs) if pair in shown]
    of = {" - ".join(pair): pair for pair in np.asarray(rows["pair"]).tolist()}
    status = np.array([STATUS[int(k)] for k in np.asarray(rows["status"])])
    time = np.asarray(rows["time"])
    numbers: dict[str, Array] = {
        "time (s)": time,
        "problem": problem,
        "pair": pairs,
        "status": status,
        "normal impulse (N s)": along,
        "friction impulse (N s)": across,
        "approach (m/s)": np.asarray(rows["approach"]),
        "separation (m/s)": np.asarray(rows["separation"]),
    }
    first, last = (f"{t:.5g}" for t in (time.min(), time.max()))
    when = first if time.min() == time.max() else f"{first}\u00a0to\u00a0{last}"
    title = headed(result.title, f"impacts of step\u00a0{step}, t\u00a0=\u00a0{when}\u00a0s")
    among = {name for pair in listed for name in of[pair]}
    names = [paired(of[pair], among) for pair in listed]
    if time.min() != time.max():
        problem = 1 + np.unique(np.stack([time, problem]), axis=1, return_inverse=True)[1].ravel()
    discs = Discs(
        problem,
        np.array([listed.index(pair) if pair in shown else -1 for pair in pairs]),
        np.maximum(0.0, along),
        status,
    )
    with styled():
        figure = (_numbered if _room(problem, along, names) else _summed)(discs, title, names, len(strength))
    return Chart(figure, numbers)


@dataclass(frozen=True)
class Discs:
    """The normal impulses of a sequence: problem, row of the figure (-1: none), size (N s) and status of each."""

    problem: I64
    row: I64
    size: F64
    status: Array

    def draw(self, axes: Axes, largest: float) -> None:
        """Discs whose areas are the impulses, with one of each status that occurs in the legend."""
        most = float(self.size.max(initial=1e-300))
        for name in (*LOOKS, "open"):
            here = (self.status == name) & (self.row >= 0)
            if not here.any():
                continue
            colour = LOOKS.get(name, GREY)
            area = 12 + largest * self.size[here] / most
            axes.scatter(self.problem[here], self.row[here], s=area, color=colour, linewidth=0, zorder=3)
            axes.plot([], [], "o", color=colour, label=name)


def _room(problem: I64, along: F64, names: list[str]) -> bool:
    """Whether there is room for the number of each impulse beside the one of the next problem."""
    digits = max(len(_number(value)) for value in along)
    places = int(np.ptp(problem)) + 1
    return bool(places * max(4, digits) * DIGIT <= width() - _indent(names))


def _number(value: float) -> str:
    return f"{value:.{3 if width() > 5 else 2}g}"


def _numbered(discs: Discs, title: str, names: list[str], every: int) -> Figure:
    """A row for each pair, with the impulses written at their discs."""
    label = fitted("problem of the sequence; numbers: normal impulses (N\u00a0s)", _indent(names))
    height = 1.1 + 0.42 * len(names) + LINE * label.count("\n")
    figure, (axes,) = panels(1, height, title, _indent(names))
    discs.draw(axes, 130)
    most = float(discs.size.max(initial=1e-300))
    look: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "bottom", "fontsize": 8}
    for x, row, size in zip(discs.problem, discs.row, discs.size, strict=True):
        if row >= 0:
            text = _number(size) if size > NOTHING * most else "0"
            axes.annotate(text, (int(x), int(row)), xytext=(0, 3 + 5 * np.sqrt(size / most)), **look)
    _rows(axes, discs, names, 0.8)
    axes.set_xticks(np.unique(discs.problem))
    axes.set_xlabel(label)
    figure.legend(loc="outside upper left", ncols=3)
    return figure


def _summed(discs: Discs, title: str, names: list[str], every: int) -> Figure:
    """Of long sequences: above what all pairs have in each problem, below the rows without numbers, until they end."""
    lower = 0.24 * len(names)
    of = "the pairs" if every == len(names) else f"the {len(names)} pairs with most"
    words = f"problem of the sequence; above: sum of the normal impulses; below: discs of {of}, by area"
    label = fitted(f"{words}, largest {discs.size.max():.3g}\u00a0N\u00a0s", _indent(names))
    height = 2.65 + lower + LINE * label.count("\n")
    figure, (above, axes) = panels(2, height, title, _indent(names), (1.3, max(0.6, lower)))
    problems = np.unique(discs.problem)
    total = np.array([discs.size[discs.problem == k].sum() for k in problems])
    felt = total > NOTHING * total.max(initial=0.0)
    if len(problems) <= MOST_STEMS:
        above.vlines(problems[felt], total[felt].min(initial=1.0) / 2, total[felt], color=GREY, linewidth=0.8)
    above.semilogy(problems[felt], total[felt], "o", color="black", markersize=2.5)
    above.set_xlim(problems[0] - 0.5, problems[-1] + 0.5)
    above.set_ylabel(f"all {counted(every, 'pair')}\n(N\u00a0s)")
    discs.draw(axes, 70)
    _rows(axes, discs, names, 0.6)
    for axis in (above, axes):
        whole_numbers(axis.xaxis, 12 if width() > 5 else 6)
    axes.set_xlabel(label)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=3)
    return figure


def _rows(axes: Axes, discs: Discs, names: list[str], above: float) -> None:
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -above)
    listed = discs.problem[discs.row >= 0]
    axes.set_xlim(listed.min() - 0.5, listed.max() + 0.5)


def _indent(names: list[str]) -> float:
    """Room that names take at the left, in."""
    return 0.2 + max(map(len, names), default=0) / LETTERS_PER_INCH


def busiest_step(result: RunData) -> int:
    """The step with most impact problems, of several the one with the largest impulse, of these the first."""
    if not len(result.impacts):
        raise CaromError("the run holds no impacts: nothing hit anything, or impacts = false in [record]")
    step, time, problem = (np.asarray(result.impacts[name]) for name in ("step", "time", "problem"))
    hit, of_row = np.unique(step, return_inverse=True)
    largest = np.zeros(len(hit))
    np.maximum.at(largest, of_row.ravel(), np.linalg.norm(np.asarray(result.impacts["impulse"]), axis=1))
    # Of several times in a step the table of steps has the longest sequence, and of problems that nothing came of no rows.
    times = np.unique(np.stack([step, time, problem])[:, problem > 0], axis=1)[0]
    counts = np.searchsorted(times, hit, side="right") - np.searchsorted(times, hit)
    steps = np.asarray(result.steps["step"])
    there = np.isin(hit, steps)
    counts[there] = np.maximum(
        counts[there], np.asarray(result.steps["impact_problems"])[np.isin(steps, hit)]
    )
    return int(hit[np.lexsort((-largest, -counts))[0]])
