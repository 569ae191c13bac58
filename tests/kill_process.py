"""`carom` in a process that is forked from one with everything imported: a kill costs what is computed, not the start."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import tempfile
from pathlib import Path

_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(
    ["kill_process", "carom.cli", "carom.run.simulate", "carom.scene.scene", "pytest"]
)


class Forked:
    """As much of `subprocess.Popen` as the harness needs."""

    def __init__(self, arguments: list[str]) -> None:
        handle, name = tempfile.mkstemp(prefix="carom-kill-")
        os.close(handle)
        self._errors = Path(name)
        self._process = _CONTEXT.Process(target=_carom, args=(arguments, name))
        self._process.start()

    @property
    def returncode(self) -> int | None:
        """Exit code, less than zero after a signal; None while it runs."""
        return self._process.exitcode

    poll = returncode.fget

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end; `subprocess.TimeoutExpired` if it does not come in time (s)."""
        self._process.join(None if timeout is None else max(0.0, timeout))
        code = self._process.exitcode
        if code is None:
            raise subprocess.TimeoutExpired("carom", timeout or 0.0)
        return code

    def kill(self) -> None:
        """SIGKILL."""
        self._process.kill()

    def communicate(self) -> tuple[None, str]:
        """Wait for the end; returns what was printed on standard error."""
        self.wait()
        told = self._errors.read_text()
        self._errors.unlink()
        return None, told


def _carom(arguments: list[str], errors: str) -> None:
    from carom.cli import main

    for number, path in ((1, os.devnull), (2, errors)):
        handle = os.open(path, os.O_WRONLY)
        os.dup2(handle, number)
        os.close(handle)
    sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
    main(arguments)
