"""Progress bars, on a terminal only: that of runs, and only of those that last, and of things that are counted."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from carom.cli.output import Interrupted, note
from carom.cli.process import bare

if TYPE_CHECKING:
    from rich.progress import Progress as RichBar

    from carom.run.sinks import Progress

#: A run that is over sooner than this shows no bar, and does not pay for importing one.
PATIENCE_S = 0.4
#: Seconds between two lines of progress where there is no terminal.
LINE_SECONDS = 15.0


class Bar:
    """Share and facts, on a terminal until it is stopped; it begins at its first call."""

    def __init__(self) -> None:
        self._bar: RichBar | None = None

    def show(self, done: int, of: int, facts: Callable[[int], str]) -> None:
        """So many are done; `facts` says more, on a terminal of so many columns."""
        if self._bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, TaskProgressColumn, TextColumn
            from rich.progress import Progress as RichBar

            columns = (BarColumn(bar_width=20), TaskProgressColumn(), TextColumn("{task.description}"))
            # No thread of its own: the work says when there is something new.
            console = Console(file=bare(sys.stderr))
            self._bar = RichBar(*columns, console=console, auto_refresh=False, transient=True)
            self._bar.add_task("", total=of)
            self._bar.start()
        task = self._bar.task_ids[0]
        self._bar.update(task, completed=done, total=of, description=facts(self._bar.console.width))
        self._bar.refresh()

    def stop(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()


class LineBar(Bar):
    """Progress on a terminal as a bar, elsewhere as a line now and then."""

    _last = 0.0

    def tell(self, done: int, of: int, told: str, wall_s: float) -> None:
        """So many are done after `wall_s` seconds; `told` says more."""
        if sys.stderr.isatty():
            self.show(done, of, lambda width: told)
        elif wall_s - self._last >= LINE_SECONDS:
            self._last = wall_s
            note(told)


@contextmanager
def keeping(kept: str) -> Iterator[None]:
    """Work of which `kept` is said after Ctrl-C."""
    try:
        yield
    except KeyboardInterrupt as error:
        raise Interrupted(f"interrupted; {kept}") from error


@contextmanager
def going_on(bar: LineBar | None, kept: str) -> Iterator[None]:
    """Work that the same command continues after Ctrl-C, `kept` says from where."""
    try:
        with keeping(f"{kept}, and the same command goes on from there"):
            yield
    finally:
        if bar is not None:
            bar.stop()


class ProgressBar(Bar):
    """Called by the run about ten times a second."""

    def __call__(self, now: Progress) -> None:
        if self._bar is not None or (now.wall_s >= PATIENCE_S and now.step < now.steps):
            self.show(now.step, now.steps, lambda width: facts(now, width))


def facts(now: Progress, width: int = 120) -> str:
    """The numbers beside the bar, fewer of them on a terminal less than 105 columns wide."""
    pace = f"{now.steps_per_s / 1e3:.3g}k" if now.steps_per_s >= 1e4 else f"{now.steps_per_s:.3g}"
    iterations = f"{now.iterations_position}+{now.iterations_velocity} it"
    if width < 105:
        return f"t {now.time:.4g}/{now.until:.4g} s  {pace} steps/s  ETA {left(now.eta_s)}"
    return (
        f"t {now.time:.4g}/{now.until:.4g} s  step {now.step}  {now.contacts} contacts  {iterations}"
        f"  {pace}/s  ETA {left(now.eta_s)}"
    )


def left(eta_s: float) -> str:
    """The time that is left, `0:01:30`."""
    eta = int(eta_s) if eta_s < 1e8 else 0
    return f"{eta // 3600}:{eta % 3600 // 60:02d}:{eta % 60:02d}"


@contextmanager
def progress_bar(wanted: bool) -> Iterator[ProgressBar | None]:
    """A progress bar if it is wanted and somebody can see it."""
    bar = ProgressBar() if wanted and sys.stderr.isatty() else None
    try:
        yield bar
    finally:
        if bar is not None:
            bar.stop()


@contextmanager
def counting_bar(wanted: bool, what: str = "") -> Iterator[Callable[..., None] | None]:
    """A bar that is called with how many things are done, how many there are and perhaps what was done last, if somebody
    can see it; `what` the things are.
    """
    if not (wanted and sys.stderr.isatty()):
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (BarColumn(bar_width=20), MofNCompleteColumn(), TextColumn("{task.description}"))
    clock = TimeRemainingColumn() if what else TimeElapsedColumn()
    with Progress(*columns, clock, console=Console(file=bare(sys.stderr)), transient=True) as bar:
        task = bar.add_task(what or "beginning", total=None)

        def show(done: int, known: int, last: str = "") -> None:
            bar.update(task, completed=done, total=known, description=f"{last} done" if last else what)

        yield show
