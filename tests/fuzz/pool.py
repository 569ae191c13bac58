"""Tries inputs in a child process with a limit on its memory and a clock that the parent watches.

A segmentation fault, a hang or a process out of memory then is a finding with its input, and not the end of the tests.
"""

from __future__ import annotations

import multiprocessing
import resource
import signal
import tempfile
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

#: Address space that a case may take beyond what the libraries have after import, bytes. No good input of the corpora
#: needs a tenth of it.
MEMORY = 1 << 30
#: Seconds after which a case is a hang. The slowest good input takes about one.
PATIENCE = 20.0

REFUSED, TAKEN = "refused", "taken"


@dataclass(frozen=True)
class Verdict:
    """What came of a case: "refused" (with an error in words), "taken", or what is wrong with Carom."""

    kind: str
    text: str = ""

    @property
    def ok(self) -> bool:
        return self.kind in (REFUSED, TAKEN)


class Pool:
    """One child at a time, started anew where a case ended it."""

    def __init__(self, base: Path, *, memory: int = MEMORY, patience: float = PATIENCE) -> None:
        self.base, self.memory, self.patience = base, memory, patience
        self._context = multiprocessing.get_context("spawn")
        self._child: multiprocessing.process.BaseProcess | None = None
        self._line: Connection | None = None

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def one(self, target: str, case: bytes) -> Verdict:
        """The verdict on one case of a target."""
        if self._child is None:
            self._start()
        assert self._line is not None
        assert self._child is not None
        try:
            self._line.send((target, case))
            if not self._line.poll(self.patience):
                self._end()
                return Verdict("hang", f"no answer within {self.patience:g} s")
            kind, text = self._line.recv()
            return Verdict(kind, text)
        except (EOFError, OSError):
            self._child.join(5.0)
            code = self._child.exitcode
            self._end()
            name = signal.Signals(-code).name if code is not None and code < 0 else f"exit {code}"
            return Verdict("crash", name)

    def _start(self) -> None:
        self._line, other = self._context.Pipe()
        self._child = self._context.Process(target=_serve, args=(other, self.base, self.memory), daemon=True)
        self._child.start()
        other.close()
        if not self._line.poll(60.0) or self._line.recv() != "ready":  # the import takes its time
            raise RuntimeError("the child process did not start")

    def _end(self) -> None:
        if self._child is not None:
            self._child.kill()
            self._child.join()
        if self._line is not None:
            self._line.close()
        self._child = self._line = None


def _serve(line: Connection, base: Path, memory: int) -> None:
    """The child: imports, bounds its memory, then judges one case after another."""
    from fuzz import targets

    with tempfile.TemporaryDirectory(prefix="carom-fuzz-") as folder:
        judges = {name: make(Path(folder), base) for name, make in targets.TARGETS.items()}
        now = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (now + memory, now + memory))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        line.send("ready")
        while True:
            try:
                target, case = line.recv()
            except EOFError:
                return
            line.send(targets.judged(judges[target], case))
