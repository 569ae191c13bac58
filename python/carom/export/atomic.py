"""Files that appear whole or not at all: written beside their place, renamed at the end."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from carom.errors import CaromError
from carom.files import RecordError, inside, unwritable


@contextmanager
def writing_into(directory: Path) -> Iterator[None]:
    """Make a directory, and say in words why something could not be written there. One that stays empty goes again."""
    made = [folder for folder in (directory, *directory.parents) if not folder.exists()]
    try:
        directory.mkdir(parents=True, exist_ok=True)
        yield
    except CaromError:
        raise
    except OSError as error:
        # An error that names no file, or one below the directory, is of writing.
        raise RecordError(f"cannot write {directory}: {unwritable(error)}") from error
    finally:
        with suppress(OSError):  # the first that holds a file ends it
            for folder in made:
                folder.rmdir()


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A temporary path beside `path`, which takes its place if the block ends well and goes if it does not."""
    temporary = _beside(path)
    try:
        temporary.unlink(missing_ok=True)  # a link there would be written through
        yield temporary
        os.replace(temporary, path)
    finally:
        with suppress(OSError):
            temporary.unlink()


@contextmanager
def whole_folder(path: Path, own: str) -> Iterator[Path]:
    """The same for a folder. An old one is replaced if all its files match `own`, and refused otherwise."""
    if inside(path.parent, path.name).exists():
        foreign = sorted(set(path.iterdir()) - set(path.glob(own))) if path.is_dir() else [path]
        if foreign:
            raise CaromError(f"{foreign[0]} is no file of an export; choose another directory with -o")
    temporary = _beside(path)
    try:
        shutil.rmtree(temporary, ignore_errors=True)
        temporary.mkdir()
        yield temporary
        if path.exists():
            shutil.rmtree(path)
        os.replace(temporary, path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def without(directory: Path, names: Iterable[str], own: str | None = None) -> None:
    """Remove files of an earlier export, of what this one has none of; with `own` the files that match it in folders of
    these names, too, and folders that are empty then.
    """
    for name in names:
        (directory / name).unlink(missing_ok=True)
        folder = inside(directory, Path(name).stem) if own else directory
        for file in folder.glob(own) if own else ():
            file.unlink()
        if own:
            with suppress(OSError):
                folder.rmdir()


def _beside(path: Path) -> Path:
    for scrap in path.parent.glob(f".{path.name}.*.tmp"):  # of a process that was killed
        number = scrap.name.removesuffix(".tmp").rpartition(".")[2]
        if number.isdecimal() and not _lives(int(number)):
            is_folder = scrap.is_dir() and not scrap.is_symlink()
            shutil.rmtree(scrap) if is_folder else scrap.unlink(missing_ok=True)
    return path.with_name(f".{path.name}.{os.getpid()}.tmp")


def _lives(process: int) -> bool:
    if not hasattr(os, "killpg"):  # Windows, where signal 0 would end the process: its scrap stays
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
