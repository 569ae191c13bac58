"""The table at the end of `carom run`: what happened, what it cost, where the files are."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.cli.output import seconds
from carom.errors import counted
from carom.result.remarks import remarks
from carom.text import table

if TYPE_CHECKING:
    from carom.result.outcome import Outcome
    from carom.run.result import Result

#: Counts that are zero where all went well, and what each is called in words, for one and for many.
TROUBLES = {
    "unconverged": ("sub-problem accepted unconverged", "sub-problems accepted unconverged"),
    "fallbacks": ("solve by a backup method", "solves by a backup method"),
    "truncated_sequences": ("impact sequence cut short", "impact sequences cut short"),
    "halvings": ("step halved", "steps halved"),
}
#: Travel in a step, in radii, from which a ball can pass through another or a plane unnoticed.
MOST_TRAVEL = 1.0


def text(summary: Mapping[str, Any], result: Result) -> str:
    """The summary of a run for a terminal, at most 100 columns wide."""
    head = [_warnings(result), _head(summary, result)]
    if result.outcome.failed:  # why there is no result comes before what may be wrong in it
        head.reverse()
    blocks = [
        *head,
        _events(result),
        _flow(summary, result),
        _handed(summary),
        _iterations(summary),
        _troubles(summary, result),
        _energy(summary, result),
    ]
    blocks += [_phases(summary), _files(summary, result)]
    return "\n".join(block for block in blocks if block)


def _warnings(result: Result) -> str:
    """What may make the numbers below worthless stands before them."""
    return "\n".join(
        textwrap.fill(told, 100, initial_indent="warning     ", subsequent_indent=" " * 12)
        for told in remarks(result)
    )


def _head(summary: Mapping[str, Any], result: Result) -> str:
    title = summary.get("title") or summary["scenario"]
    if summary.get("case"):
        title += f" [{summary['case']}]"
    outcome = result.outcome
    ended = outcome.kind.replace("_", " ")
    if outcome.failed:
        ended = f"FAILED, {ended}" + ("" if outcome.step is None else f" in step {outcome.step}")
    return (
        f"{title}\n"
        f"{ended}: {counted(summary['steps'], 'step')} of {summary['step']:g} s{' done' if outcome.failed else ''},"
        f" t = {summary['time']:g} s, {seconds(summary['wall_s'])} (core {seconds(summary['core_s'])})"
    )


def _events(result: Result) -> str:
    step = np.asarray(result.impacts["step"])
    contacts = np.asarray(result.steps["contacts"])
    most = int(contacts.max()) if len(contacts) else 0
    if result.scene.record.impacts:
        with_impacts = len(np.unique(step))
        impacts = f"{counted(with_impacts, 'step')} with impacts ({counted(len(step), 'impulse')})"
    else:
        impacts = "impacts not recorded"
    return f"events      {impacts}; up to {counted(most, 'contact')} closed at once"


def _flow(summary: Mapping[str, Any], result: Result) -> str:
    if not result.flows:
        return ""
    coming = sum(inflow.size() for inflow in result.scene.inflows)
    entered = f"{summary['entered']} of {counted(coming, 'ball')} entered, " if coming else ""
    return f"flow        {entered}{counted(summary['removed'], 'ball')} left"


def _handed(summary: Mapping[str, Any]) -> str:
    """What method `events` could not do in closed form."""
    if not summary.get("handovers"):
        return ""
    times = counted(summary["handovers"], "time")
    return f"pressing    nsga took over {times}, for {summary['stepped']:.3g} s in all"


def _iterations(summary: Mapping[str, Any]) -> str:
    penalty = summary.get("penalty")
    if penalty:
        return f"substeps    {penalty['substeps']}, the shortest {penalty['substep_min']:.3g} s"
    rows = [["iterations", "max", "mean"]]
    for level, counts in summary.get("iterations", {}).items():
        rows.append([f"  {level}", f"{counts['max']:g}", f"{counts['mean']:.3g}"])
    problems = summary.get("impact_problems")
    if problems:
        rows.append(["impact problems", f"{problems['max']:g}", f"{problems['mean']:.3g}"])
    for level, trials in summary.get("line_search", {}).items():
        rows.append([f"line search, {level}", *_counts(trials)])
    return table(rows)


def _counts(value: Any) -> list[str]:
    # A total, or maximum and mean like the iterations.
    return [f"{value['max']:g}", f"{value['mean']:.3g}"] if isinstance(value, Mapping) else [f"{value:g}"]


def _troubles(summary: Mapping[str, Any], result: Result) -> str:
    found = [f"stopped: {result.outcome.where}"] if result.outcome.failed else []
    found += [
        f"{n} {one if n == 1 else many}" for k, (one, many) in TROUBLES.items() if (n := summary.get(k))
    ]
    found += remarks(result, "missed_in_pile")
    travel = summary.get("travel_max") or 0.0
    divides = result.scene.run.options()["method"] in ("penalty", "events")  # which see every impact
    if travel > MOST_TRAVEL and not divides:
        found.append(f"balls moved up to {travel:.2g} radii in a step, impacts may be missed (shorten step)")
    return "troubles    " + ("; ".join(found) if found else "none")


def _energy(summary: Mapping[str, Any], result: Result) -> str:
    energy = summary.get("energy")
    lines = []
    if energy and not summary["steps"]:
        lines.append(f"energy      {energy['initial']:.6g} J at the start")
    elif energy:
        rise = "never rises"
        if energy["max_rise"] > 0:
            rise = f"largest rise {energy['max_rise']:.2g} J ({energy['max_rise_relative']:.1g} relative)"
        lines.append(f"energy      {energy['initial']:.6g} J to {energy['final']:.6g} J, {rise}")
    for told in remarks(result, "unsettled"):
        lines.append(textwrap.fill(told, 100, initial_indent=" " * 12, subsequent_indent=" " * 12))
    if scaled := summary.get("safeguarded"):
        least = f"the least to {100 * summary['restitution_scale_min']:.3g} %"
        lines.append(
            f"restitution scaled down in {counted(scaled, 'step')} ({least}), else energy would rise; usual in piles"
        )
    deepest = summary.get("penetration_max")
    if deepest is not None and summary["steps"]:
        radius = float(np.min(result.bodies["radius"]))
        lines.append(
            f"penetration at most {max(0.0, deepest):.2g} m ({max(0.0, deepest) / radius:.1g} of a radius)"
        )
    return "\n".join(lines)


def _phases(summary: Mapping[str, Any]) -> str:
    phases = {name: s for name, s in summary.get("phases", {}).items() if s > 0}
    total = sum(phases.values())
    if not total:
        return ""
    rows = [[f"  {name}", seconds(s), f"{100 * s / total:.0f} %"] for name, s in phases.items()]
    return table([["time by phase"], *rows])


def _files(summary: Mapping[str, Any], result: Result) -> str:
    from carom.result.directory import size_on_disk

    path = summary["directory"]
    size = size_on_disk(result.path) / 1e6
    held = f"{counted(len(result.time), 'frame')}, {size:.1f} MB"
    return f"files       {path}  ({held})\nnext        {_next(path, result)}"


def _next(path: str, result: Result) -> str:
    """The commands that lead on: to look at the motion, or out of what stopped it."""
    look = f"carom view {path}   carom plot {path}"
    outcome = result.outcome
    if not outcome.failed:
        return f"carom resume {path}   {look}" if outcome.kind == "interrupted" else look
    joined = outcome.level == "smooth" or (result.summary.get("failure") or {}).get("joints")
    commands = [f"carom info {path}"]
    cure = _easier(outcome)
    if outcome.kind == "not_converged" and cure and not joined:  # joints that contradict one another stay
        commands.insert(0, f"carom resume {path} --set {cure}")
    if len(result.time) > 1:
        commands.append(f"carom view {path}")
    return "   ".join(commands)


def _easier(outcome: Outcome) -> str | None:
    """The first option that the advice of the core names (`cures.rs`), as `--set` takes it: one piece of advice, not two."""
    cure = re.search(r'(\w+) = "?([^\s",;]+)', outcome.advice)
    return f"{cure[1]}={cure[2]}" if cure else None
