"""The table at the end of `carom run`: what happened, what it cost, where the files are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.cli.output import seconds, table
from carom.errors import counted

if TYPE_CHECKING:
    from carom.result import Result

#: Counts that are zero where all went well, and what each is called in words, for one and for many.
TROUBLES = {
    "unconverged": ("sub-problem accepted unconverged", "sub-problems accepted unconverged"),
    "fallbacks": ("rescue by a fallback", "rescues by a fallback"),
    "truncated_sequences": ("impact sequence cut short", "impact sequences cut short"),
    "halvings": ("step halved", "steps halved"),
    "missed_impacts": ("impact missed", "impacts missed"),
}
#: Travel in a step, in radii, from which a ball can pass through another or a plane unnoticed.
MOST_TRAVEL = 1.0


def text(summary: Mapping[str, Any], result: Result) -> str:
    """The summary of a run for a terminal, at most 100 columns wide."""
    blocks = [
        _head(summary),
        _events(result),
        _iterations(summary),
        _troubles(summary),
        _energy(summary, result),
    ]
    blocks += [_phases(summary), _files(summary, result)]
    return "\n".join(block for block in blocks if block)


def _head(summary: Mapping[str, Any]) -> str:
    title = summary.get("title") or summary["scenario"]
    if summary.get("case"):
        title += f" [{summary['case']}]"
    return (
        f"{title}\n"
        f"{str(summary['outcome']).replace('_', ' ')}: {counted(summary['steps'], 'step')} of {summary['step']:g} s,"
        f" t = {summary['time']:g} s, {seconds(summary['wall_s'])} (core {seconds(summary['core_s'])})"
    )


def _events(result: Result) -> str:
    step = np.asarray(result.impacts["step"])
    contacts = np.asarray(result.steps["contacts"])
    most = int(contacts.max()) if len(contacts) else 0
    with_impacts = len(np.unique(step))
    return (
        f"events      {counted(with_impacts, 'step')} with impacts ({counted(len(step), 'impulse')});"
        f" up to {counted(most, 'contact')} closed at once"
    )


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


def _troubles(summary: Mapping[str, Any]) -> str:
    found = [f"{n} {one if n == 1 else many}" for k, (one, many) in TROUBLES.items() if (n := summary.get(k))]
    travel = summary.get("travel_max") or 0.0
    if travel > MOST_TRAVEL and "penalty" not in summary:  # whose substeps see every impact
        found.append(f"balls moved up to {travel:.2g} radii in a step, impacts may be missed (shorten step)")
    return "troubles    " + ("; ".join(found) if found else "none")


def _energy(summary: Mapping[str, Any], result: Result) -> str:
    energy = summary.get("energy")
    lines = []
    if energy:
        rise = f"largest rise {energy['max_rise']:.2g} J" if energy["max_rise"] > 0 else "never rises"
        lines.append(f"energy      {energy['initial']:.6g} J to {energy['final']:.6g} J, {rise}")
    deepest = summary.get("penetration_max")
    if deepest is not None:
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
    from carom.rundir import size_on_disk

    path = summary["directory"]
    size = size_on_disk(result.path) / 1e6
    held = f"{counted(len(result.time), 'frame')}, {size:.1f} MB"
    return f"files       {path}  ({held})\nnext        carom view {path}   carom plot {path}"
