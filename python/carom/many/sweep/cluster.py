"""The driver's side: pieces of a study on dask.distributed, in a cluster of its own or a given one.

Workers that die are dask's matter: their pieces go to others. A piece that was on one dying worker after the other is cut
in two down to single cases. Of these, each is computed alone at the end: the one that kills workers then too is noted as
failed, and the study goes on.
"""

from __future__ import annotations

import hashlib
import logging
import signal
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from multiprocessing import resource_tracker  # noqa: TID251 nothing is started but what dask starts anyway
from pathlib import Path
from typing import Any

import numpy as np

from carom.errors import CaromError, extra
from carom.many.sweep import origin
from carom.many.sweep.cases import Job, by, compute
from carom.many.sweep.design import Design
from carom.many.sweep.folder import Folder
from carom.run.sinks import Interrupt

#: Called after each piece with its number of cases and how many of them failed.
Done = Callable[[int, int], None]

#: Pieces handed out per thread of the cluster; more wait here, so that a cluster that grows gets some.
AHEAD = 3
GONE = "the scheduler is gone; what was computed stays, and the same call goes on from there"
#: Seconds without a worker after which it is said.
PATIENCE_SECONDS = 20.0
#: Times that workers are started, or a scheduler is called, and the seconds that it may take to answer a call.
START_ATTEMPTS = 4
ANSWER_SECONDS = 10.0
#: Seconds between two looks at Ctrl-C and at whether the scheduler is there.
LOOK_SECONDS = 0.5


@contextmanager
def team(workers: int, scheduler: str | None) -> Iterator[Callable[[Sequence[Job], Done], None]]:
    """What computes pieces, in whatever order they end: this process, or a cluster that lasts as long as the block."""
    client: Any = None
    with ExitStack() as stack:

        def compute_all(jobs: Sequence[Job], done: Done) -> None:
            nonlocal client
            if workers == 0 and scheduler is None:
                for job in jobs:
                    done(*compute(job))
                return
            if client is None:
                client = stack.enter_context(_client(workers, scheduler))
            try:
                _drive(client, list(reversed(jobs)), done)
            except CaromError:
                raise
            except Exception as error:
                # Each call of dask says in its own way that the scheduler is lost. Errors of workers come as CaromError.
                if isinstance(error, (OSError, TimeoutError, CancelledError)) or client.status != "running":
                    raise CaromError(GONE) from error
                raise

        yield compute_all


@contextmanager
def _client(workers: int, scheduler: str | None) -> Iterator[Any]:
    needs = "a study on several processes needs dask", "cluster", ", or workers = 0 for this process alone"
    config, distributed = extra("dask.config", *needs), extra("distributed", *needs)
    with ExitStack() as stack:
        # A worker that is killed, or a scheduler that goes, is reported here in one line and not by dask in fifty.
        for logger in _loggers("distributed", "tornado.application"):
            stack.callback(logger.setLevel, logger.level)
            logger.setLevel(logging.CRITICAL)
        if scheduler is None:
            scratch = stack.enter_context(
                tempfile.TemporaryDirectory(prefix="carom-dask-", ignore_cleanup_errors=True)
            )
            settings = {"distributed.worker.profile.enabled": False, "temporary-directory": scratch}
            stack.enter_context(config.set(settings))
            # Dask cannot end workers that only begin: a signal waits until they have.
            halt = Interrupt()
            with halt.listening(signal.SIGINT, signal.SIGTERM), _deaf_children():
                cluster = _started(
                    partial(
                        distributed.LocalCluster, n_workers=workers, threads_per_worker=1, processes=True, host="127.0.0.1",
                        dashboard_address=None, local_directory=scratch, memory_limit=0, silence_logs=logging.CRITICAL,
                        # It serves by HTTP even without a dashboard: at any port, or two studies at once would be told of.
                        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                    ),
                    "a worker died while it started, and the others are started again with it",
                    f"{workers} workers cannot be started; give fewer, or workers = 0 for this process alone (a script that"
                    ' calls carom.sweep needs `if __name__ == "__main__":` around the call)',
                )  # fmt: skip
            stack.callback(cluster.close)
            if halt.signal is not None:
                signal.raise_signal(halt.signal)
            yield stack.enter_context(distributed.Client(cluster))
            return
        client = _started(
            partial(distributed.Client, scheduler, timeout=ANSWER_SECONDS),
            f"no scheduler answers at {scheduler} yet; the study waits for it",
            f"no scheduler answers at {scheduler}; start one with `dask scheduler`,"
            f" and workers with `dask worker {scheduler}`",
        )
        yield stack.enter_context(client)


@contextmanager
def _deaf_children() -> Iterator[None]:
    """What is started in the block never hears Ctrl-C, nor do the processes that it starts later.

    A terminal sends Ctrl-C to all processes of a command. Workers would end with a traceback each; they end with this one.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Where it starts this helper process, Python 3.11 lets its thread hear again what was blocked there.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _started(start: Callable[[], Any], remark: str, refusal: str) -> Any:
    """What `start` makes, which may be late, or lose a process on the way: it is tried several times."""
    attempt = 0
    while True:
        attempt += 1
        try:
            return start()
        except ValueError as error:  # an address that is none
            raise CaromError(refusal) from error
        except (OSError, TimeoutError, RuntimeError) as error:
            if attempt == START_ATTEMPTS:
                raise CaromError(refusal) from error
            if attempt == 1:
                warnings.warn(remark, UserWarning, stacklevel=2)


def _loggers(*roots: str) -> list[logging.Logger]:
    """The loggers of these names and all below them: dask gives some of the latter levels of their own."""
    known = [
        name for name in logging.root.manager.loggerDict if name.startswith(tuple(f"{r}." for r in roots))
    ]
    return [logging.getLogger(name) for name in (*roots, *known)]


def _drive(client: Any, waiting: list[Job], done: Done) -> None:
    from distributed import wait

    flying: dict[Any, Job] = {}
    # Single cases that were on workers when these died, guilty or not: each is computed once more with nothing beside it.
    suspects: list[Job] = []
    on_trial: Job | None = None
    alone_since = time.monotonic()
    while waiting or flying or suspects:
        threads = sum(client.nthreads().values()) if client.status == "running" else 1
        while waiting and len(flying) < AHEAD * max(1, threads):
            job = waiting.pop()
            flying[client.submit(compute, job, key=f"carom-{job.key}", pure=False, retries=1)] = job
        if not flying:
            on_trial = suspects.pop()
            flying[client.submit(compute, on_trial, key=f"carom-{on_trial.key}-alone", pure=False)] = on_trial
        # Of a scheduler that is lost meanwhile, all pieces count as cancelled; what follows sees to both.
        with suppress(TimeoutError, CancelledError):
            wait(list(flying), timeout=LOOK_SECONDS, return_when="FIRST_COMPLETED")
        if client.status != "running":
            raise CaromError(GONE)
        if threads and client.status == "running":
            alone_since = time.monotonic()
        elif time.monotonic() - alone_since > PATIENCE_SECONDS:
            warnings.warn("the scheduler has no workers; the study waits for some", UserWarning, stacklevel=2)
            alone_since = np.inf
        for future in [f for f in flying if f.status != "pending"]:
            job = flying.pop(future)
            if future.status == "finished":
                done(*future.result())
            elif future.status == "error":
                pieces = _after(job, future.exception(), done if job is on_trial else None)
                (suspects if len(job.ids) == 1 else waiting).extend(pieces)
            else:  # lost with a scheduler that came back, or cancelled
                waiting.append(job)
            future.release()


def _after(job: Job, error: BaseException, done: Done | None) -> list[Job]:
    """What is to be computed instead of a piece that ended so; a single case is given up where `done` is there."""
    from distributed import KilledWorker

    if not isinstance(error, KilledWorker):
        if isinstance(error, (CaromError, OSError)):
            raise CaromError(f"a worker stopped: {error}") from error
        raise error
    if len(job.ids) > 1:
        half = len(job.ids) // 2
        return [piece(job, range(half)), piece(job, range(half, len(job.ids)))]
    if done is None:
        return [job]
    message = "several workers died while they computed it, perhaps for lack of memory"
    columns = {"id": job.ids, "outcome": ["worker_died"], "message": [message]}
    row = {name: np.array(value, dtype=object) for name, value in columns.items()}
    Folder(Path(job.folder)).write_part(job.key, [{**row, **job.study.columns, **by(origin.here(), 1)}])
    done(1, 1)
    return []


def piece(job: Job, cases: range | Sequence[int]) -> Job:
    """Some cases of a piece as a piece of its own, named after the cases in it."""
    chosen = list(cases)
    table = {name: values[chosen].tolist() for name, values in job.study.points.items()}
    study = replace(job.study, axes=(), design=Design("table", table=table))
    ids = tuple(job.ids[k] for k in chosen)
    return Job(hashlib.sha256("".join(ids).encode()).hexdigest()[:16], job.folder, study, ids)
