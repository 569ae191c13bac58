"""What a command needs of its process: standard streams that can be written, and signals that end its work in order."""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

#: What a terminal would obey instead of showing it: control characters, and those that turn the direction of the text;
#: and lone surrogates, which are no text: bytes of the names of files.
CONTROLS = {
    *range(32), *range(127, 160), *range(0x202A, 0x202F), *range(0x2066, 0x206A), *range(0xD800, 0xE000)
} - {ord("\n"), ord("\t")}  # fmt: skip
SHOWN = dict.fromkeys(CONTROLS, "\ufffd")

UNWRITABLE = 2
"""Exit code where standard output takes nothing: a place that cannot be written (`carom.cli.output.BAD_INPUT`)."""


class Unwritable(OSError):
    """Standard output takes no more."""


class Printable:
    """A stream that shows text and obeys nothing in it: names in files of others may hold escape sequences.

    What it cannot write is an `Unwritable`; a `mute` one, for standard error, leaves it out: there is no place to tell it.
    """

    def __init__(self, raw: TextIO, mute: bool = False) -> None:
        self.raw, self._mute = raw, mute

    def write(self, text: str) -> int:
        """Write `text` with a mark for each character that a terminal would obey, or that its encoding has not."""
        coding = self.raw.encoding or "utf-8"
        with self._told():
            self.raw.write(text.translate(SHOWN).encode(coding, "replace").decode(coding))
        return len(text)

    def flush(self) -> None:
        """Write what waits."""
        with self._told():
            self.raw.flush()

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            if not self._mute:
                raise Unwritable(*error.args) from error
            silence(self.raw)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.raw, name)


def bare(stream: TextIO) -> TextIO:
    """The stream below a `Printable` one, for a bar that moves on the terminal."""
    return getattr(stream, "raw", stream) if isinstance(stream, Printable) else stream


@contextmanager
def printable(output: bool = True) -> Iterator[None]:
    """Standard error as a `Printable` stream, and standard output too unless others write to it in ways of their own."""
    before = sys.stdout, sys.stderr
    sys.stderr = Printable(bare(before[1]), mute=True)
    sys.stdout = Printable(bare(before[0])) if output else before[0]
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def reopen() -> None:
    """Put something in the place of standard streams that were closed: a file of results would get their number, and what
    is printed would end up in it.
    """
    # So writing to standard output fails, which is said, and messages vanish.
    for number, mode in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, mode), True)  # the lowest number that is free
    sys.stdout = sys.stdout or open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 it stays open
    sys.stderr = sys.stderr or open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115


def silence(stream: TextIO) -> None:
    """Let a stream that cannot be written go nowhere: what waits in it would be tried again when the process ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, stream.fileno())
    finally:
        os.close(nowhere)


def unwritable(error: OSError, code: int = 0) -> int:
    """Say that standard output cannot be written; the exit code is that of the command where it has one."""
    silence(sys.stdout)
    if error.errno == errno.EPIPE:
        return code  # the reader has left (`carom info RUN | head`); nobody wants to hear of it
    why = "it is closed" if error.errno == errno.EBADF else error.strerror
    kept = "files that the command wrote are kept, what it printed is lost"
    print(f"carom: standard output cannot be written ({why}); {kept}", file=sys.stderr)
    return code or UNWRITABLE


def flushed(code: int) -> int:
    """Write what waits in standard output; returns the exit code of a command that would have had `code`."""
    with printable():
        try:
            sys.stdout.flush()
        except Unwritable as error:
            code = unwritable(error, code)
        sys.stderr.flush()
    return code


def leave_at_once(code: int) -> None:
    """End the process without what Python does at its end."""
    os._exit(flushed(code))


@contextmanager
def terminated_as_interrupted() -> Iterator[None]:
    """SIGTERM ends the work as Ctrl-C does: nothing half written stays, and the processes end too.

    SIGINT is set as well: a shell that starts a command in the background leaves it ignored.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    old = {number: signal.signal(number, interrupt) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


@contextmanager
def decided(own: bool) -> Iterator[None]:
    """After it the exit code of a process that is its `own` stays: Python takes a while to end, and would end by SIGINT."""
    try:
        yield
    finally:
        if own and threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            # So it would, too, where a KeyboardInterrupt left an `exec`, as that of a dataclass, though it was caught; the
            # next such call makes it forget.
            eval("0")  # noqa: S307 no data
