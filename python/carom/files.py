"""Files written whole or not at all, and what went wrong in words with a cure."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path

from carom.errors import CaromError


class RecordError(CaromError):
    """Results could not be written: no space, no permission, a file system that went away."""


def write_whole(path: Path, data: bytes | memoryview, *, durable: bool, parents: bool = False) -> None:
    """Replace a file by another in one move: readers see the old or the new one, never half of it.

    With `parents` the directory is made if it is not there.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        with open(temporary, "wb") as file:
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        os.replace(temporary, path)
        if durable:
            _sync_directory(path.parent)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink()
        raise RecordError(f"cannot write {path}: {unwritable(error)}") from error


def _sync_directory(path: Path) -> None:
    # The rename itself must reach the disk; some systems cannot sync a directory, and then do not need it.
    with suppress(OSError):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def reason(error: BaseException) -> str:
    """The cause of an input/output error in a few words; HDF5 hides the error number inside a long message."""
    return _known(error)[0]


def unwritable(error: BaseException) -> str:
    """Cause and cure of a failed attempt to write."""
    cause, cure = _known(error)
    return f"{cause}; {cure}"


def _known(error: BaseException) -> tuple[str, str]:
    text = str(error)
    number = getattr(error, "errno", None)
    elsewhere = "write elsewhere with -o"
    for code, cause, cure in (
        (errno.ENOSPC, "no space left on the disk", f"free some, or {elsewhere}"),
        (errno.EDQUOT, "the disk quota is used up", f"free some, or {elsewhere}"),
        (errno.EFBIG, "the file grew beyond the limit of this process", "raise it (ulimit -f)"),
        (errno.EACCES, "permission denied", elsewhere),
        (errno.EPERM, "permission denied", elsewhere),
        (errno.EROFS, "the file system is read-only", elsewhere),
        (errno.EIO, "the disk reports an input/output error", elsewhere),
        (errno.ENOTDIR, "a part of the path is a file, not a directory", elsewhere),
        (errno.EEXIST, "a part of the path is a file, not a directory", elsewhere),
        (errno.EISDIR, "it is a directory", "name a file"),
        (errno.ENAMETOOLONG, "the name is too long", "choose a shorter one"),
    ):
        if number == code or f"errno = {code}," in text:
            return cause, cure
    words = getattr(error, "strerror", None) if number is not None else None
    return words or (text.splitlines()[0] if text else type(error).__name__), elsewhere
