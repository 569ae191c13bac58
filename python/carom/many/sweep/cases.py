"""The worker's side: simulates a piece of a study and leaves its rows in the folder, whole or not at all.

Nothing is sent back but counts. If the worker, the driver or the scheduler is killed, parts that were written stay; a
piece that is begun again first looks what it left there itself.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from carom.arrays import F64, Array
from carom.errors import CaromError, ScenarioError
from carom.many.batch import simulate_batch
from carom.many.batch_result import KINEMATICS
from carom.many.sweep import origin
from carom.many.sweep.folder import Folder
from carom.many.sweep.study import RESERVED, Study
from carom.many.threads import ENERGIES, MONITORS
from carom.run.result import Result, load
from carom.run.simulate import RunFailed, resume, simulate
from carom.run.summary import LISTED_BODIES
from carom.scene.scene import Scene

Columns = dict[str, Array]

#: Seconds between two parts, and about as much computing is lost with a worker.
WRITE_SECONDS = 5.0
#: Seconds of computing in one call of the batch.
CALL_SECONDS = 1.0
#: Cases in one call of the batch at most.
MOST_CASES = 2000


@dataclass(frozen=True)
class Job:
    """A piece of a study: its cases are those of `study`, with the names `ids` that they have in the whole."""

    key: str
    folder: str
    study: Study
    ids: tuple[str, ...]


def compute(job: Job) -> tuple[int, int]:
    """Simulate what is missing of a piece; returns how many cases it has and how many of them failed."""
    folder = Folder(Path(job.folder))
    before = folder.outcomes(f"{job.key}-*")
    left = [k for k, name in enumerate(job.ids) if name not in before]
    failed = sum(outcome != "done" for name, outcome in before.items() if name in set(job.ids))
    kept: list[Columns] = []
    written, chunk = time.monotonic(), 1
    while left:
        now, left = left[:chunk], left[chunk:]
        start = time.monotonic()
        columns = rows(job.study, now, folder, [job.ids[k] for k in now])
        elapsed = time.monotonic() - start
        columns["seconds"] = np.full(len(now), elapsed / len(now))
        kept.append(columns)
        failed += int(np.sum(columns["outcome"] != "done"))
        chunk = int(np.clip(chunk * CALL_SECONDS / max(elapsed, 1e-6), 1, min(MOST_CASES, 8 * chunk)))
        if not left or time.monotonic() - written > WRITE_SECONDS:
            folder.write_part(job.key, kept)
            kept, written = [], time.monotonic()
    return len(job.ids), failed


def rows(study: Study, cases: Sequence[int], folder: Folder, ids: Sequence[str]) -> Columns:
    """The rows of some cases: their names, parameters, outcome, totals and final state."""
    found: Columns = {"id": np.array(ids, dtype=object)}
    found |= {name: values[list(cases)] for name, values in study.columns.items()}
    found |= by(origin.here(), len(cases))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the driver has warned of the first case
        if study.keep_runs or study.measure is not None:
            parts = [_one_run(study, case, folder, name) for case, name in zip(cases, ids, strict=True)]
        elif study.targeting.fast and _together(cases):
            parts = _batch(study, range(cases[0], cases[-1] + 1))
        else:
            parts = [_one(study, case) for case in cases]
    return {**found, **joined(parts)}


def by(who: origin.Origin, rows: int) -> Columns:
    """The columns that say who computed some rows."""
    return {name: np.full(rows, value, dtype=object) for name, value in zip(origin.COLUMNS, who, strict=True)}


def _together(cases: Sequence[int]) -> bool:
    return cases[-1] - cases[0] + 1 == len(cases)


def _batch(study: Study, cases: range) -> list[Columns]:
    """Cases that are arrays laid over one scene, in one call."""
    targets = study.targeting
    try:
        values = targets.values(targets.of_arrays, cases)
    except CaromError:  # an expression has no value at one of them
        return [_one(study, case) for case in cases]
    return [_chosen(study, _computed(targets.base, values))]


def _computed(scenes: Scene | Sequence[Scene], values: Mapping[str, F64] | None = None) -> Columns:
    """The columns of a batch; what the core refuses is called as what a scenario refuses."""
    columns = simulate_batch(scenes, values, threads=1).columns()
    outcome = columns["outcome"]
    columns["outcome"] = np.where(np.isin(outcome, ("bad_scene", "bad_model")), "refused", outcome).astype(
        object
    )
    return columns


def _one(study: Study, case: int) -> Columns:
    """A case with a scene of its own."""
    try:
        return _chosen(study, _computed([study.targeting.scene(case)]))
    except CaromError as error:
        return _refused(error)


def _one_run(study: Study, case: int, folder: Folder, name: str) -> Columns:
    """A case with a run directory: one that is there is loaded or continued."""
    try:
        scene = study.targeting.scene(case)
        try:
            result = _run(scene, folder.run(name) if study.keep_runs else None)
        except RunFailed as error:
            result = error.result
        with result:
            # A run that was there may be of another Carom.
            columns = _of_result(result) | by(origin.of(result.versions), 1)
            if study.measure is not None and result.outcome.ok:
                columns |= _measured(study, result, {*study.columns, *RESERVED, *columns})
    except CaromError as error:
        return _refused(error) | by(origin.here(), 1)
    return _chosen(study, columns)


def _run(scene: Scene, path: Path | None) -> Result:
    if path is None:
        return simulate(scene)
    if (path / "run.json").exists():
        try:
            result = load(path)
            if result.status in ("done", "failed"):
                return result
            result.close()
            return resume(path)
        except RunFailed:
            raise  # it was continued, and its end is the case's
        except CaromError:
            pass  # what cannot be continued is computed anew
    path.parent.mkdir(parents=True, exist_ok=True)
    return simulate(scene, out=path, force=path.exists())


def _of_result(result: Result) -> Columns:
    """The columns of a batch, from a result."""
    summary, outcome = result.summary, result.outcome
    found: dict[str, Any] = {
        "outcome": outcome.kind,
        "message": "" if outcome.ok else str(outcome),
        "time": float(result.time[-1]),
        **{name: float(summary.get(name, np.nan)) for name in MONITORS},
        **{f"energy_{name}": float(summary.get("energy", {}).get(name, np.nan)) for name in ENERGIES},
    }
    for quantity, width in KINEMATICS.items() if outcome.ok else ():
        letters, last = "wxyz" if width == 4 else "xyz", getattr(result, quantity)[-1]
        for body, name in enumerate(result.names):
            found |= {f"{name}.{quantity}.{x}": last[body, i] for i, x in enumerate(letters)}
    return {name: _column(value) for name, value in found.items()}


def _measured(study: Study, result: Result, taken: Set[str]) -> Columns:
    """What the study measures, in columns of its own: none of those `taken`."""
    assert study.measure is not None
    try:
        given = study.measure(result)
        try:
            pairs = dict(given)
        except (TypeError, ValueError):
            return _not_measured(f"it returned {given!r:.80}; return numbers by name, as {{'height': 0.1}}")
        found = {}
        for name, value in pairs.items():
            try:
                found[str(name)] = np.array([float(value)])
            except (TypeError, ValueError):
                return _not_measured(f"{name} is {value!r:.80}, not a number; return numbers by name")
    except CaromError as error:
        return _not_measured(str(error))
    except Exception as error:  # the user's own code: its mistake is that of one case
        return _not_measured(f"{type(error).__name__}: {error}")
    if clash := sorted(taken & set(found)):
        return _not_measured(f"a column is called {', '.join(clash)} already; choose another name")
    return found


def _not_measured(why: str) -> Columns:
    return {"outcome": _column("measure_failed"), "message": _column(f"measure: {why}")}


def _refused(error: CaromError) -> Columns:
    told = str(error.problems[0]) if isinstance(error, ScenarioError) else str(error)
    return {"outcome": _column("refused"), "message": _column(told)}


def _column(value: Any) -> Array:
    return np.array([value], dtype=object if isinstance(value, str) else np.float64)


def _chosen(study: Study, columns: Mapping[str, Array]) -> Columns:
    """Without the overrides, which follow from the parameters, and with the balls that are wanted."""
    names = study.targeting.base.names
    kept = study.bodies if study.bodies is not None else names if len(names) <= LISTED_BODIES else ()
    unwanted = {name for name in names if name not in kept}
    return {
        name: values
        for name, values in columns.items()
        if not name.startswith("parameter ") and not (unwanted and name.rsplit(".", 2)[0] in unwanted)
    }


def joined(parts: Sequence[Mapping[str, Array]]) -> Columns:
    """Rows below each other; what a part lacks is not a number, of text empty."""
    if len(parts) == 1:
        return dict(parts[0])
    kinds = {name: values.dtype for part in parts for name, values in part.items()}
    found = {}
    for name, kind in kinds.items():
        pieces = []
        for part in parts:
            rows = len(next(iter(part.values())))
            blank = np.full(rows, "", dtype=object) if kind.kind == "O" else np.full(rows, np.nan)
            pieces.append(part.get(name, blank))
        found[name] = np.concatenate(pieces)
    return found
