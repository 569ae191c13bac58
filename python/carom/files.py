"""Files of Carom: written whole or not at all, never through a link, and what went wrong in words with a cure.

A directory may come from others, with links and FIFOs where files of Carom are expected. All that is written or removed
in one goes through `inside` (folders of it) and `opened` (files of it), so nothing outside of it changes and nothing hangs.
A file that the caller names goes through `write_named`: where the name is a link or a FIFO, that is what was meant.
"""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import stat
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from carom.errors import CaromError


class RecordError(CaromError):
    """Results could not be written: no space, no permission, a file system that went away."""


class Anchored:
    """A path whose file is found also after the working directory has changed.

    It reads as it was given while the working directory is that in which it was given, afterwards as a whole.
    """

    def __init__(self, given: str | Path) -> None:
        self._given, self._base = Path(given), working_directory()

    @property
    def path(self) -> Path:
        return self._given if working_directory() == self._base else self.whole

    @property
    def whole(self) -> Path:
        """From the root on."""
        return self._given if self._base is None else self._base / self._given


def working_directory() -> Path | None:
    """Where the process is; None where that directory was removed."""
    try:
        return Path.cwd()
    except OSError:
        return None


def inside(root: Path, *parts: str) -> Path:
    """A path below the directory `root`; one that leads through a link is refused, for it may lead out of the directory."""
    path = root.joinpath(*parts)
    link = first_link(root, path)
    if link is not None:
        raise RecordError(f"{link} is a link, and nothing is written or removed through one; remove it")
    return path


def first_link(root: Path, path: Path) -> Path | None:
    """The first link on the way from the directory `root` down to `path`; `root` itself may be one."""
    way = [folder for folder in (path, *path.parents) if folder.is_relative_to(root) and folder != root]
    return next((folder for folder in reversed(way) if folder.is_symlink()), None)


def lies_in(path: Path, folder: Path) -> bool:
    """Whether a path, be it there or not, is that of a directory or leads into it, under whatever name."""
    way = path.resolve()
    return folder.exists() and any(part.exists() and part.samefile(folder) for part in (way, *way.parents))


def regular(path: Path) -> Path:
    """`path`, if it is a file, a link to one, or not there: opening anything else may hang for ever."""
    if path.exists() and not path.is_file():
        what = "a directory" if path.is_dir() else "a pipe or a device"
        raise CaromError(f"{path} is {what} where a file is expected; remove it")
    return path


def opened(path: Path, flags: int, mode: str) -> IO[bytes]:
    """Open a file to write, itself and no other: no link, nothing that hangs, no second name of another file (hard link).

    Raises `OSError` where the system does, `RecordError` where the file is another's.
    """
    guards = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        handle = os.open(path, flags | guards, 0o666)
    except OSError:
        inside(path.parent, path.name)
        raise
    found = os.fstat(handle)
    if not stat.S_ISREG(found.st_mode) or found.st_nlink > 1:
        os.close(handle)
        what = "has another name, a hard link" if stat.S_ISREG(found.st_mode) else "is no regular file"
        raise RecordError(f"{path} {what}, and is not written to; take a copy of the directory (cp -r)")
    return os.fdopen(handle, mode)


def lock(file: IO[Any], *, shared: bool = False) -> bool:
    """Try to lock a file; True also where the system has no such locks."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # network file systems without locks
    return True


def write_new(
    path: Path, data: bytes | memoryview, *, durable: bool = False, mode: int | None = None
) -> None:
    """Write a file that nobody else has: what lies there under its name is removed first, be it a link."""
    path.unlink(missing_ok=True)
    with opened(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, "wb") as file:
        if mode is not None:
            path.chmod(mode)
        file.write(data)
        if durable:
            file.flush()
            os.fsync(file.fileno())


def write_whole(path: Path, data: bytes | memoryview, *, durable: bool, parents: bool = False) -> None:
    """Replace a file by another of its mode in one move: readers see the old or the new one, never half of it.

    With `parents` the directory is made if it is not there.
    """
    if path.is_dir():
        raise RecordError(f"cannot write {path}: it is a directory; name a file")
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        old = path.lstat().st_mode if path.is_file() else 0
        write_new(temporary, data, durable=durable, mode=old & 0o777 if stat.S_ISREG(old) else None)
        os.replace(temporary, path)
        if durable:
            _sync_directory(path.parent)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink()
        raise RecordError(f"cannot write {path}: {unwritable(error)}") from error


def write_named(path: Path, data: bytes | memoryview) -> None:
    """Write a file that the caller names, whole or not at all: of a link that to which it leads, which may not be there yet.

    What is there and no file, as a FIFO or `/dev/stdout`, is written to and stays. Missing directories are made.
    """
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            with path.open("wb") as file:
                file.write(data)
        else:
            target = Path(os.path.realpath(path)) if path.is_symlink() else path
            write_whole(target, data, durable=False, parents=True)
    except OSError as error:
        raise RecordError(f"cannot write {path}: {unwritable(error)}") from error


def json_bytes(content: Any, **options: Any) -> bytes:
    """A line of JSON. Names of files may be no text: Python has their bytes as lone surrogates, which JSON can escape."""
    text = json.dumps(content, ensure_ascii=False, **options) + "\n"
    return text.encode(errors="backslashreplace")


def csv_bytes(rows: Iterable[Iterable[Any]]) -> bytes:
    """Rows as CSV; a number is the shortest text that reads back as the same bits."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def finite(value: Any) -> Any:
    """A document with null for each number that is not finite, as JSON demands."""
    if isinstance(value, float):
        return value if value - value == 0 else None
    if isinstance(value, Mapping):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    return value


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
    elsewhere = "write elsewhere"
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
