"""Progress bars, on a terminal only: that of runs, and only of those that last, and one for things that are counted."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from carom.cli.output import bare

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID

    from carom.run.sinks import Progress

#: A run that is over sooner than this shows no bar, and does not pay for importing one.
PATIENCE_S = 0.4


class ProgressBar:
    """Called by the run about ten times a second."""

    def __init__(self) -> None:
        self._bar: Bar | None = None
        self._task: TaskID | None = None

    def __call__(self, now: Progress) -> None:
        if self._bar is None:
            if now.wall_s < PATIENCE_S or now.step >= now.steps:
                return
            self._start(now)
        assert self._bar is not None
        assert self._task is not None
        self._bar.update(self._task, completed=now.step, facts=facts(now, self._bar.console.width))
        self._bar.refresh()

    def _start(self, now: Progress) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, TaskProgressColumn, TextColumn
        from rich.progress import Progress as Bar

        columns = (BarColumn(bar_width=20), TaskProgressColumn(), TextColumn("{task.fields[facts]}"))
        # No thread of its own: the run says when there is something new.
        self._bar = Bar(*columns, console=Console(file=bare(sys.stderr)), auto_refresh=False, transient=True)
        self._task = self._bar.add_task("", total=now.steps, facts="")
        self._bar.start()

    def stop(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()


def facts(now: Progress, width: int = 120) -> str:
    """The numbers beside the bar, fewer of them on a terminal less than 105 columns wide."""
    pace = f"{now.steps_per_s / 1e3:.3g}k" if now.steps_per_s >= 1e4 else f"{now.steps_per_s:.3g}"
    eta = int(now.eta_s) if now.eta_s < 1e8 else 0
    left = f"{eta // 3600}:{eta % 3600 // 60:02d}:{eta % 60:02d}"
    iterations = f"{now.iterations_position}+{now.iterations_velocity} it"
    if width < 105:
        return f"t {now.time:.4g}/{now.until:.4g} s  {pace} steps/s  ETA {left}"
    return (
        f"t {now.time:.4g}/{now.until:.4g} s  step {now.step}  {now.contacts} contacts  {iterations}"
        f"  {pace}/s  ETA {left}"
    )


@contextmanager
def progress_bar(wanted: bool) -> Iterator[ProgressBar | None]:
    """A progress bar if it is wanted and somebody can see it."""
    if not (wanted and sys.stderr.isatty()):
        yield None
        return
    bar = ProgressBar()
    try:
        yield bar
    finally:
        bar.stop()


@contextmanager
def counting_bar(wanted: bool, what: str) -> Iterator[Callable[[int, int], None] | None]:
    """A bar that is called with how many things (`what`) are done and how many there are, if somebody can see it."""
    if not (wanted and sys.stderr.isatty()):
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (BarColumn(bar_width=20), MofNCompleteColumn(), TextColumn(what), TimeRemainingColumn())
    with Bar(*columns, console=Console(file=bare(sys.stderr)), transient=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, known: bar.update(task, completed=done, total=known)
