"""`carom.sweep`: computes what is missing of a study, and gathers its table."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from carom.errors import CaromError, CaromWarning
from carom.many.batch import usable_processors
from carom.many.sweep import cluster, origin
from carom.many.sweep.cases import Job
from carom.many.sweep.folder import Folder
from carom.many.sweep.study import Measure, Study
from carom.many.sweep.table import Sweep
from carom.run.watch import check_function

#: Pieces of a study per worker: few enough to cost nothing, enough that no worker is left alone at the end.
PIECES = 16
#: Cases of one piece at most.
MOST_CASES = 250


@dataclass(frozen=True)
class Progress:
    """Where a study stands: cases that are there (with those of earlier calls), those of them that failed, all."""

    done: int
    failed: int
    cases: int
    new: int
    """Cases computed by this call."""
    wall_s: float

    @property
    def per_second(self) -> float:
        """Cases a second."""
        return self.new / self.wall_s if self.wall_s > 0 else 0.0

    @property
    def eta_s(self) -> float:
        """Seconds to the end at this pace."""
        return (self.cases - self.done) / self.per_second if self.new else float("inf")


def sweep(
    study: Study | str | Path,
    out: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    measure: Measure | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Sweep:
    """Compute the cases of a study (or of the file of one) that the folder `out` does not hold yet.

    `workers` processes of this machine compute, by default one per processor; 0: this process alone, without dask.
    `scheduler` is the address of a running one (`tcp://host:8786`), whose workers must see `out` under the same path.
    Cases that failed are rows like others and are not computed again without `retry_failed`. `measure(result)` gives
    further columns, `{name: number}`, from the `Result` of each case, which is then simulated with a run directory of
    its own and takes longer. `progress` is called after each piece.

    A script that calls this with workers needs `if __name__ == "__main__":` around the call, as for all processes of Python.
    """
    check_function("sweep", "progress", progress, "progress: print(progress)")
    if not isinstance(study, Study):
        study = Study.from_toml(study, measure)
    elif measure is not None:
        raise CaromError("sweep: give measure to Study.of, or the path of a study and measure here")
    if workers is not None and workers < 0:
        raise CaromError(
            f"sweep: workers = {workers}; give a number of processes, or 0 for this process alone"
        )
    folder = Folder(Path(out).absolute())
    with folder.driving():
        if told := folder.other_study(study):
            warnings.warn(told, CaromWarning, stacklevel=2)
        if missing(study, folder.outcomes(), retry_failed):
            for advice in study.targeting.advice():
                warnings.warn(advice, CaromWarning, stacklevel=2)
        with Team.of(workers, scheduler) as team:
            return complete(study, folder, team, retry_failed, progress)


@dataclass(frozen=True)
class Team:
    """Who computes: `workers` processes (0: this one), which last as long as the block."""

    workers: int
    compute: Callable[[Sequence[Job], cluster.Done], None]

    @classmethod
    @contextmanager
    def of(cls, workers: int | None, scheduler: str | None) -> Iterator[Team]:
        """`workers` processes of this machine, by default one per processor, or those of a `scheduler`."""
        count = usable_processors() if workers is None else workers
        with cluster.team(count, scheduler) as compute:
            yield cls(count, compute)


def missing(study: Study, outcomes: Mapping[str, str], retry_failed: bool) -> list[int]:
    """The cases that are still to be computed, by number."""
    there = {name for name, outcome in outcomes.items() if outcome == "done" or not retry_failed}
    return [k for k, name in enumerate(study.ids) if name not in there]


def complete(
    study: Study,
    folder: Folder,
    team: Team,
    retry_failed: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Sweep:
    """Compute the cases of a study that the folder lacks; whoever calls this is driving the folder."""
    before = folder.outcomes()
    lacking = missing(study, before, retry_failed)
    left = set(lacking)
    done = [name for k, name in enumerate(study.ids) if k not in left]
    if lacking and (told := origin.remark(folder.origins(done), origin.here())):
        warnings.warn(told, CaromWarning, stacklevel=3)
    state = Progress(len(done), sum(before[name] != "done" for name in done), study.cases, 0, 0.0)
    start = time.perf_counter()

    def note(cases: int, failed: int) -> None:
        nonlocal state
        elapsed = time.perf_counter() - start
        state = Progress(state.done + cases, state.failed + failed, state.cases, state.new + cases, elapsed)
        if progress is not None:
            progress(state)

    try:
        if lacking:
            team.compute(_pieces(study, folder, lacking, team.workers, retry_failed), note)
    finally:  # also after Ctrl-C: the table holds what there is
        table = folder.gather(study)
        found = Sweep(folder.path, study, table, state)
        folder.note(found.summary)
    return found


def _pieces(study: Study, folder: Folder, lacking: list[int], workers: int, retry: bool) -> list[Job]:
    size = max(1, min(MOST_CASES, -(-len(lacking) // (PIECES * max(1, workers)))))
    if study.keep_runs or study.measure is not None:
        size = max(1, size // 10)
    whole = Job("", str(folder.path), study, tuple(study.ids))
    jobs = [cluster.piece(whole, lacking[k : k + size]) for k in range(0, len(lacking), size)]
    if retry:  # under another name: what failed is in the part of the old one
        jobs = [Job(f"again{int(time.time()):x}{job.key}", job.folder, job.study, job.ids) for job in jobs]
    return jobs
