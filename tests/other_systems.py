"""A command of Carom on a system that has none of what is Linux's own; run by test_portability.py.

    python other_systems.py COMMAND [ARGUMENT ...]

What macOS and Windows lack is taken away, and what Windows refuses is refused: to move or sync a file that is open, to ask
with signal 0 whether a process lives. The rest of the two systems is not simulated.
"""

from __future__ import annotations

import builtins
import errno
import os
import sys
from pathlib import Path
from typing import Any

GONE = (
    "memfd_create", "sched_getaffinity", "sched_setaffinity", "sendfile", "killpg", "fork", "geteuid", "getuid",
    "O_NOFOLLOW", "O_NONBLOCK", "mkfifo", "posix_fallocate", "posix_fadvise", "getloadavg", "setsid", "fchmod",
)  # fmt: skip


def open_files() -> dict[int, str]:
    found = {}
    for entry in os.listdir("/proc/self/fd"):
        try:
            found[int(entry)] = os.readlink(f"/proc/self/fd/{entry}")
        except OSError:
            continue
    return found


def become_another_system() -> None:
    import fcntl

    flags = fcntl.fcntl
    if not hasattr(os, "memfd_create"):  # this is one
        return
    for module in ("fcntl", "resource", "pwd", "grp", "termios"):
        sys.modules[module] = None  # type: ignore[assignment]
    for name in GONE:
        if hasattr(os, name):
            delattr(os, name)
    real = {"rename": os.rename, "replace": os.replace, "fsync": os.fsync, "open": builtins.open}

    def moves(name: str) -> Any:
        def move(old: Any, new: Any, **how: Any) -> None:
            there = {os.path.realpath(old), os.path.realpath(new)}
            if there & set(open_files().values()):
                raise PermissionError(errno.EACCES, "used by another process", str(old))
            real[name](old, new, **how)

        return move

    def fsync(file: Any) -> None:
        number = file if isinstance(file, int) else file.fileno()
        if os.path.isdir(open_files().get(number, "")) or flags(number, 3) & 3 == os.O_RDONLY:
            raise OSError(errno.EBADF, "Bad file descriptor")
        real["fsync"](number)

    def kill(process: int, signal: int) -> None:
        raise AssertionError(f"os.kill({process}, {signal}) ends a process on Windows")

    def opened(file: Any, *arguments: Any, **named: Any) -> Any:
        if str(file).startswith(("/proc", "/dev/shm")):
            raise FileNotFoundError(errno.ENOENT, "no such file", str(file))
        return real["open"](file, *arguments, **named)

    os.rename, os.replace, os.fsync, os.kill = moves("rename"), moves("replace"), fsync, kill
    builtins.open = opened
    Path.read_text = lambda self, *a, **k: opened(self, "r", *a, **k).read()  # type: ignore[method-assign]


if __name__ == "__main__":
    become_another_system()
    from carom.cli import main

    main()
