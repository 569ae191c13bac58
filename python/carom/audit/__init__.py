"""The auditor: judges a finished run by the laws of physics alone, from its files, without any code of the solvers.

`carom.audit.check("runs/break-1")` returns a `Report`: for each kind of law (`carom.audit.kinds`) how often it was
judged, the worst violation with its place and time, and what could not be judged from what was recorded, with the
option that would record it. `docs/reference/audit.md` states all laws and bounds.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from carom.audit import (
    balance,
    claims,
    clumps,
    cones,
    counts,
    courses,
    energy,
    flows,
    gaps,
    impacts,
    joints,
    kinds,
    motion,
    references,
    rises,
    springs,
    tables,
    tunnel,
    works,
)
from carom.audit.block import blocks
from carom.audit.data import Run, read
from carom.audit.near import near
from carom.audit.report import Finding, Place, Report, Tally, Unjudged, Verdict
from carom.audit.rerun import Rerun, rerun
from carom.errors import CaromError
from carom.result.directory import RunDir
from carom.result.remarks import remarks
from carom.run.result import Result

__all__ = ["Finding", "Place", "Report", "Rerun", "Unjudged", "Verdict", "check", "rerun"]


def check(run: Result | str | Path) -> Report:
    """Judge a run: a `carom.Result`, a run directory, or its `results.h5`, also of a run that did not reach its end.

    What the files claim wrongly is a finding of the report. Files that cannot be read raise `CaromError`; so does a record
    that begins with a restored state (`Simulation.restore`).
    """
    path = RunDir.open(run, "audit.check").path if run is None or isinstance(run, (str, Path)) else run.path
    evidence = read(path)
    restored = evidence.result._about.get("restored")
    if restored is not None:
        raise CaromError(
            f"{evidence.result.title!r}: what is recorded begins with a state that was restored, at step {restored}, and may"
            " differ from that of the scene, by which it is judged: give velocities in the scene, or do not restore"
        )
    tally = Tally(kinds.of_law(evidence.impact_law.restitution))
    with np.errstate(invalid="ignore", over="ignore"):  # NaNs of damaged files are findings, not accidents
        _judge(evidence, tally)
        if evidence.unseen:
            strict = Tally()
            _judge(evidence.by_default(), strict)
            claims = " and ".join(evidence.unseen)
            tally.doubt(
                strict,
                f"within bounds that {claims} widens, which no table bears out",
                "run with the defaults",
            )
    result = evidence.result
    return Report(
        str(path), result.title, evidence.method, evidence.frames, tally.close(), tuple(_warnings(evidence))
    )


def _judge(run: Run, tally: Tally) -> None:
    if not references.judge(run, tally):
        return
    tables.judge(run, tally)
    counts.judge(run, tally)
    flows.judge(run, tally)
    claims.judge(run, tally)
    rises.rises(run, tally)
    for block in blocks(run):
        pairs = near(block)
        tables.frames(block, tally)
        of_clumps = clumps.laws(block, pairs.free)
        motion.judge(block, tally, pairs.free, None if of_clumps is None else of_clumps.ways)
        clumps.judge(block, tally, of_clumps)
        motion.walls(block, tally)
        gaps.penetration(block, pairs, tally)
        gaps.recorded(block, tally)
        counts.of_frames(block, pairs, tally)
        gaps.complementarity(block, tally)
        gaps.approach(block, pairs, tally)
        cones.judge(block, tally)
        cones.passivity(block, tally)
        works.judge(block, tally)
        impacts.judge(block, tally)
        courses.judge(block, tally)
        springs.judge(block, pairs, tally)
        energy.judge(block, pairs, tally)
        balance.judge(block, tally)
        tunnel.judge(block, pairs, tally)
        joints.judge(block, tally)
        flows.of_frames(block, tally)


def _warnings(run: Run) -> list[str]:
    """What the run says of itself that a reader of the verdict should know."""
    result = run.result
    found = remarks(result, "cut_short", "gained", "unsettled", "missed", "missed_in_pile")
    if not result.outcome.ok:
        found.append(f"the run did not reach its end: {result.outcome.brief}")
    for column, words in (
        ("unconverged", "steps were accepted without convergence"),
        (
            "truncated",
            "impact sequences were cut and ended by one problem with all contacts",
        ),
    ):
        count = int((run.steps[column] > 0).sum())
        if count and not (column == "truncated" and remarks(result, "cut_short")):
            found.append(f"{words} ({count} steps)")
    parts = 0 if run.divides else int(run.cut.sum())
    if parts:
        found.append(f"steps were made in parts, whose bounds are wider ({parts} steps)")
    return found
