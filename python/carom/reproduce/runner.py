"""Runs examples of the paper beside each other, each in a process of its own; one that fails does not stop the others."""

from __future__ import annotations

import multiprocessing  # noqa: TID251 an example each
import os
import signal
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait  # noqa: TID251
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module  # noqa: TID251 the examples
from pathlib import Path
from typing import Any

from carom.errors import CaromError, one_line
from carom.reproduce import examples
from carom.reproduce.document import Context, Example, Figure, NotConverged, Row
from carom.reproduce.figures import draw
from carom.run.simulate import RunFailed

#: Section or appendix -> module with `reproduce`, and `PARTS` if it has heavy ones.
MODULES = {name: f"{examples.__name__}.{module}" for name, module in examples.NAMES.items()}


@dataclass(frozen=True)
class Failure:
    """An example, or a figure of it, that raised: what, and where in its module."""

    example: str
    error: str
    place: str
    not_converged: bool = False

    @classmethod
    def of(cls, example: str, error: BaseException) -> Failure:
        """The error as one line, and the innermost place in a file of this package."""
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if Path(frame.filename).parts[-2:] != ("paper", "runner.py")]
        place = f"{Path(own[-1].filename).name}, line {own[-1].lineno}" if own else ""
        # What a person is to mend needs no name of a class.
        kind = "" if isinstance(error, CaromError) else f"{type(error).__name__}: "
        return cls(example, one_line(f"{kind}{error}"), place, isinstance(error, NotConverged | RunFailed))


@dataclass(frozen=True)
class Report:
    """All that the chosen examples gave, in the paper's order; `files`: example -> number of a figure -> file names."""

    examples: tuple[Example, ...]
    failures: tuple[Failure, ...]
    context: Context
    jobs: int
    wall_s: float
    files: Mapping[str, Mapping[str, Sequence[str]]] = field(default_factory=dict)

    @property
    def rows(self) -> list[Row]:
        """Every row of every example."""
        return [row for example in self.examples for row in example.rows]

    @property
    def verdicts(self) -> Counter[str]:
        """How many rows have each verdict."""
        return Counter(row.verdict for row in self.rows)

    @property
    def complete(self) -> bool:
        """Whether everything ran and no row is short."""
        return not self.failures and not self.verdicts["short"]


@dataclass(frozen=True)
class Drawing:
    """Where the figures go, and in which formats."""

    directory: Path
    formats: tuple[str, ...]


#: Called with tasks done, tasks known, and what was done last.
Progress = Callable[[int, int, str], None]


def run(
    chosen: Sequence[str],
    context: Context,
    *,
    jobs: int,
    drawing: Drawing | None = None,
    progress: Progress | None = None,
) -> Report:
    """Run the examples with these names, at most `jobs` at a time, and draw their figures."""
    begin = time.perf_counter()
    with _workers(jobs) as pool:
        work = _Work(pool, context, drawing, progress or (lambda done, known, what: None))
        for name in chosen:
            work.begin(name)
        work.finish()
    return Report(
        tuple(work.examples[name] for name in chosen if name in work.examples),
        tuple(sorted(work.failures, key=lambda failure: list(chosen).index(failure.example))),
        replace(context, parts={}),
        jobs,
        time.perf_counter() - begin,
        work.files,
    )


class _Work:
    """Tasks and what follows from each: heavy parts, then their example, then its figures."""

    def __init__(
        self, pool: ProcessPoolExecutor, context: Context, drawing: Drawing | None, progress: Progress
    ) -> None:
        self.pool, self.context, self.drawing, self.progress = pool, context, drawing, progress
        self.examples: dict[str, Example] = {}
        self.failures: list[Failure] = []
        self.files: dict[str, dict[str, list[str]]] = {}
        self._parts: dict[str, dict[str, Any]] = {}
        self._missing: Counter[str] = Counter()
        self._spent: Counter[str] = Counter()
        self._then: dict[Future[Any], tuple[str, str, Callable[[Any], None]]] = {}
        self._known = 0

    def begin(self, name: str) -> None:
        """Start with the heavy parts of an example if it has any."""
        try:
            parts = sorted(getattr(import_module(MODULES[name]), "PARTS", {}))
        except Exception as error:
            self.failures.append(Failure.of(name, error))
            return
        self._parts[name] = {}
        self._missing[name] = len(parts)
        for part in parts:
            self._submit(name, part, partial(self._keep, name, part), _part, part)
        if not parts:
            self._reproduce(name)

    def finish(self) -> None:
        """Go on until nothing is left to do."""
        while self._then:
            done, _ = wait(self._then, return_when=FIRST_COMPLETED)
            for future in done:
                name, what, then = self._then.pop(future)
                try:
                    answer, seconds = future.result()
                except BrokenProcessPool:
                    self.failures.append(_died(name))
                except Exception as error:  # what came back cannot be unpickled
                    self.failures.append(Failure.of(name, error))
                else:
                    self._spent[name] += seconds
                    if isinstance(answer, Failure):
                        self.failures.append(answer)
                    else:
                        then(answer)
                self.progress(self._known - len(self._then), self._known, f"{name} {what}".strip())
        # A failed part keeps its example from being run, and one line says so.
        self.failures = list(dict.fromkeys(self.failures))

    def _submit(
        self, name: str, what: str, then: Callable[[Any], None], function: Callable[..., Any], *given: Any
    ) -> None:
        try:
            future = self.pool.submit(_guarded, name, function, MODULES[name], *given, self.context)
        except BrokenProcessPool:
            self.failures.append(_died(name))
            return
        self._known += 1
        self._then[future] = (name, what, then)

    def _keep(self, name: str, part: str, found: Any) -> None:
        self._parts[name][part] = found
        self._missing[name] -= 1
        if not self._missing[name]:
            self._reproduce(name)

    def _reproduce(self, name: str) -> None:
        self._submit(name, "", self._reproduced, _example, name, self._parts.pop(name))

    def _reproduced(self, example: Example) -> None:
        self.examples[example.id] = replace(example, wall_s=self._spent[example.id])
        if self.drawing is None:
            return
        for figure in example.figures:
            then = partial(self._drawn, example.id, figure.number)
            self._submit(example.id, f"figure {figure.number}", then, _draw, figure, self.drawing)

    def _drawn(self, name: str, number: str, names: list[str]) -> None:
        self.files.setdefault(name, {})[number] = names


# --- in the workers -------------------------------------------------------------------------------------------------


def _guarded(name: str, function: Callable[..., Any], *given: Any) -> tuple[Any, float]:
    begin = time.perf_counter()
    try:
        answer = function(*given)
    except Exception as error:
        answer = Failure.of(name, error)
    return answer, time.perf_counter() - begin


def _part(module: str, part: str, context: Context) -> Any:
    return import_module(module).PARTS[part](context)


def _example(module: str, name: str, parts: Mapping[str, Any], context: Context) -> Example:
    example: Example = import_module(module).reproduce(replace(context, parts=parts))
    if not isinstance(example, Example) or example.id != name:
        raise TypeError(f"{module}.reproduce must return the Example {name!r}")
    return example


def _draw(module: str, figure: Figure, drawing: Drawing, context: Context) -> list[str]:
    return draw(figure, drawing.directory, drawing.formats)


def _died(name: str) -> Failure:
    return Failure(name, "the process that computed it was killed; is there enough memory?", "")


@contextmanager
def _workers(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that begin anew (no lock of ours is copied into them) and that end with us, however we end."""
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_obey)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        raise
    pool.shutdown()


def _obey() -> None:
    """Ctrl-C is for the parent to answer; and a worker whose parent is gone leaves."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
