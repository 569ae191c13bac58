"""Whether rows refer to bodies, steps and frames that there are. Where they do not, no law can be judged from them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from carom.arrays import I64, Bool
from carom.audit.data import LEVELS, Run
from carom.audit.kinds import KINDS
from carom.audit.report import Place, Tally

ROWS = 200_000
"""Rows that are read at a time."""
WHY = "rows of the files name what is not there (references)"
CURE = "run the scenario again"


def judge(run: Run, tally: Tally) -> bool:
    """All numbers that point to rows, bodies or steps; False, with every other law left unjudged, where one does not."""
    _shapes(run, tally)
    _frames(run, tally)
    _rows(run, tally)
    sound = not tally.verdicts["references"].violations
    if not sound:
        for kind in KINDS:
            if kind != "references":
                tally.skip(kind, WHY, CURE)
    return sound


def at(dataset: str) -> Callable[[int], Place]:
    """The place of whatever is in a dataset."""
    return lambda i: Place(who=(dataset,))


def _count(tally: Tally, wrong: Any, dataset: str) -> None:
    """As many rows of a dataset point nowhere."""
    tally.measure("references", [np.count_nonzero(wrong)], 0.0, at(dataset))


def _shapes(run: Run, tally: Tally) -> None:
    """As many bodies, walls and joints as the scenario has."""
    segments = run.result._segments
    _count(tally, run.balls != len(run.model["radius"]), "/bodies")
    _count(tally, len(run.result.wall_names) != len(run.free_walls) + run.given_walls, "/planes and /walls")
    columns = segments.columns("frames")
    for name, wanted in (
        ("joint_impulse", len(run.joints)),
        ("walls", len(run.free_walls) + run.given_walls),
        ("free_walls", len(run.free_walls)),
        ("clumps", len(run.clumps)),
    ):
        if name in columns:
            _count(tally, segments.column("frames", name).shape[1] != wanted, f"/frames/{name}")
    for name, there in (("free_walls", run.free_walls), ("clumps", run.clumps)):
        _count(tally, bool(there) and name not in columns, f"/frames/{name}")


def _frames(run: Run, tally: Tally) -> None:
    """Steps count from 1, frames are of steps in their order, and their contacts follow one another."""
    number = np.asarray(run.steps["step"]).astype(np.int64)
    _count(tally, number != np.arange(1, len(number) + 1), "/steps/step")
    off = (run.step < 0) | (run.step > len(number)) | (np.diff(run.step, prepend=-1) <= 0)
    _count(tally, off, "/frames/step")
    ends = np.asarray(run.result._segments.column("frames", "contact_end")).astype(np.int64)
    _count(tally, (np.diff(ends, prepend=0) < 0) | (ends > len(run.result.contacts)), "/frames/contact_end")


def _rows(run: Run, tally: Tally) -> None:
    """Contacts and impacts are of a ball and of a ball or wall of a higher number, impacts and events of steps in order."""
    segments, last = run.result._segments, len(run.steps["step"])
    # Parts of meshes have numbers from 0 on, 7 for each triangle; other bodies have none.
    least, most = np.full((2, run.bodies + run.given_walls), -1)
    for w, wall in run.parts.meshes.items():
        assert wall.mesh is not None
        least[run.bodies + w], most[run.bodies + w] = 0, 7 * len(wall.mesh.corners) - 1
    for table in ("contacts", "impacts", *(["impulses"] if len(run.result.impulses) else [])):
        body = segments.column(table, "body")
        for first in range(0, len(body), ROWS):
            a, b = _whole(body[first : first + ROWS]).reshape(-1, 2).T
            wrong = (a < 0) | (a >= run.balls) | (b <= a) | (b >= run.bodies + run.given_walls)
            _count(tally, wrong, f"/{table}/body")
            if table != "impulses":
                status = _whole(segments.column(table, "status")[first : first + ROWS])
                _count(tally, (status < 0) | (status > 2), f"/{table}/status")
            if not wrong.any():
                _count(tally, run.law_index(a, b) < 0, f"/{table}/body")
                if table != "impulses" and "part" in segments.columns(table):
                    part = _whole(segments.column(table, "part")[first : first + ROWS])
                    _count(tally, (part < least[b]) | (part > most[b]), f"/{table}/part")
    for rows in (run.result.impacts, run.result.impulses):
        _count(tally, _disordered(_whole(rows["step"]), 1, last), f"/{rows.name}/step")
    events = run.result.events
    if len(events):
        _count(tally, _disordered(_whole(events["step"]), 0, last), "/events/step")
        who, kind = _whole(events["body"]), _whole(events["kind"])
        _count(tally, (who < 0) | (who >= run.balls), "/events/body")
        _count(tally, (kind != 0) & (kind != 1), "/events/kind")
    changes = run.result.transitions
    if len(changes):
        _count(tally, _disordered(_whole(changes["step"]), 1, last), "/transitions/step")
        who, other = _whole(changes["body"]).T
        wrong = (who < 0) | (who >= run.balls) | (other < -1) | (other >= len(run.names))
        _count(tally, wrong, "/transitions/body")
        _count(tally, _whole(changes["kind"]) >= len(changes.EVENTS), "/transitions/kind")
        _count(tally, (_whole(changes["mode"]) >= len(changes.MODES)).any(axis=1), "/transitions/mode")
    history, values = run.result.residuals, segments.column("residuals", "value")
    end, level = _whole(segments.column("residuals", "end")), _whole(history["level"])
    _count(tally, _disordered(_whole(history["step"]), 1, last), "/residuals/step")
    _count(tally, (level < 0) | (level >= len(LEVELS)), "/residuals/level")
    _count(tally, np.diff(end, prepend=0, append=len(values) + 1) <= 0, "/residuals/end")
    _count(tally, len(end) > 0 and end[-1] != len(values), "/residuals/end")


def _whole(column: Any) -> I64:
    return np.asarray(column).astype(np.int64)


def _disordered(step: I64, first: int, last: int) -> Bool:
    return (step < first) | (step > last) | (np.diff(step, prepend=first) < 0)
