"""The run directory: which files make up a run, who may create or replace one, and whether its writer still
lives.

scenario.toml      the scenario as it was run: every default spelled out, random numbers drawn
run.json           status, outcome, versions, summary
results.h5         frames, contacts, impacts, steps; after a resume also results-0002.h5 and so on
checkpoint-*.npz   the last two states from which the run continues bit for bit
*.aside*           what `carom resume --checkpoint` put aside
log.jsonl          one JSON object per line: what happened when
"""

from __future__ import annotations

import errno
import io
import json
import os
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from carom.errors import CaromError
from carom.files import (
    Anchored,
    RecordError,
    first_link,
    json_bytes,
    lock,
    opened,
    reason,
    regular,
    unwritable,
    write_whole,
)

#: What a run writes, and all that `--force` removes: a file that is not Carom's own is never deleted. Wherever a removal is
#: stopped the rest is in order: checkpoints go before the results that they continue, the scenario after both, and last
#: the log, by which a directory is known that has no `run.json`.
_OWN = (
    "checkpoint-*.npz",
    "results*.h5",
    "failing_problem.h5",
    "problems/*.hdf5",
    "problems/.*.tmp",
    "*.aside*",
    *(f"plots/*.{kind}" for kind in ("png", "svg", "pdf", "csv")),
    "export/[!.]*.*",
    "export/balls/*.vtp",
    "export/contacts/*.vtp",
    "export/walls/*.vtp",
    "export/pictures/*.png",
    "view.html",
    ".*.tmp",
    "run.json",
    "scenario.toml",
    "log.jsonl",
)

#: What is read of a run.
_READ = ("run.json", "scenario.toml", "log.jsonl", "results*.h5", "checkpoint-*.npz")

#: Attempts to become the writer, and the pause after each, s.
LOCK_ATTEMPTS = 10
LOCK_PAUSE = 0.02


class RunDir:
    """The files of one run. `create` makes a new one, `RunDir(path)` stands for one that is there. If it is `durable`,
    what describes the run is forced to the disk, without which its checkpoints were worth nothing.
    """

    def __init__(self, path: Path, *, durable: bool = True) -> None:
        self._anchored = Anchored(path)
        self.durable = durable
        self._log: IO[str] | None = None
        self._replaces = False

    @property
    def path(self) -> Path:
        """Where it is: as it was given, or as a whole if the working directory is another one by now."""
        return self._anchored.path

    @property
    def whole(self) -> Path:
        """Where it is, from the root on."""
        return self._anchored.whole

    @property
    def scenario(self) -> Path:
        return self.path / "scenario.toml"

    @property
    def about(self) -> Path:
        return self.path / "run.json"

    @property
    def log_file(self) -> Path:
        return self.path / "log.jsonl"

    @classmethod
    def open(cls, path: Path | str, caller: str = "load") -> RunDir:
        """An existing run; a path that is none is a `CaromError` that says what was found instead. `caller` is what a
        message calls the function.
        """
        if not isinstance(path, str | os.PathLike) or not str(path):
            found = "nothing" if path is None else "an empty path" if path == "" else type(path).__name__
            raise CaromError(
                f"{caller} takes the path of a run directory, found {found}; carom.simulate(..., out=PATH) makes one"
            )
        path = Path(path)
        if (
            path.is_file()
            and path.name in ("run.json", "scenario.toml", "results.h5")
            and (path.parent / "run.json").exists()
        ):
            path = path.parent  # a file inside the directory, as completion in a shell offers it
        if not path.exists():
            raise CaromError(f"{path}: no such run directory; check the path, `carom run SCENARIO` makes one")
        for pattern in _READ:
            for file in path.glob(pattern):
                regular(file)
        if not (path / "run.json").is_file():
            cls(path)._refuse_lost()
            if path.is_dir() and not any(path.iterdir()):
                raise CaromError(
                    f"{path} is empty, not a run directory; if a run was stopped there before it wrote anything, start it"
                    f" again, as `carom run SCENARIO -o {path} --force`"
                )
            if path.is_dir() and cls(path)._is_own():
                raise CaromError(
                    f"{path}: the run was stopped before it wrote anything, and there is nothing to continue;"
                    f" start it again, as `carom run SCENARIO -o {path} --force`"
                )
            if (path / "sweep.json").is_file():
                raise CaromError(
                    f"{path} is the folder of a study, not a run directory; `carom sweep STUDY -o {path}` draws"
                    " it and, with --csv FILE, writes its table; in Python `carom.sweep(STUDY, FOLDER)` opens it"
                )
            what = (
                "a file, not a run directory"
                if path.is_file()
                else "not a run directory (it has no run.json)"
            )
            raise CaromError(f"{path} is {what}; `carom run SCENARIO` makes one")
        return cls(path)

    @classmethod
    def create(cls, path: Path | str, *, force: bool = False) -> RunDir:
        """A new run directory. An existing path is refused; with `force` an old run goes as the new one is `writing`."""
        if not str(path):
            raise CaromError("the path of the run directory is empty; name a directory")
        path = Path(path)
        new = cls(path)
        try:
            if path.is_dir() and force:
                with new.writing() if new.log_file.exists() else nullcontext():
                    if any(path.iterdir()) and not (new.about.exists() or new._is_own()):
                        new._refuse_lost()
                        raise CaromError(
                            f"{path} holds other files and is not a run directory; choose another directory"
                        )
                new._replaces = True
            path.mkdir(parents=True, exist_ok=force)
        except OSError as error:
            if isinstance(error, FileExistsError) and path.exists():
                cure = "give --force (force=True in Python) to replace it, or another directory"
                raise CaromError(
                    f"{path} exists already; {cure}"
                    if path.is_dir()
                    else f"{path} is a file; choose another path"
                ) from None
            raise RecordError(f"cannot create the run directory {path}: {unwritable(error)}") from error
        return new

    @classmethod
    def next(cls, stem: str, parent: Path | str = "runs") -> RunDir:
        """A new run directory `runs/<stem>-<n>` with the first free number, even if others do the same right now."""
        parent = Path(parent)
        try:
            parent.mkdir(parents=True, exist_ok=True)
            taken = [p.name[len(stem) + 1 :] for p in parent.glob(f"{_literal(stem)}-*")]
            n = max((int(t) for t in taken if t.isdecimal()), default=0) + 1
            while True:
                with suppress(FileExistsError):
                    (parent / f"{stem}-{n}").mkdir()
                    return cls(parent / f"{stem}-{n}")
                n += 1
        except OSError as error:
            raise RecordError(f"cannot create a run directory in {parent}: {unwritable(error)}") from error

    def segments(self) -> list[Path]:
        """`results.h5`, `results-0002.h5`, ... in the order of the run."""
        first = self.path / "results.h5"
        others = sorted(self.path.glob("results-*.h5"), key=lambda path: (len(path.name), path.name))
        return [first] * first.exists() + others

    def next_segment(self) -> Path:
        """Where a new segment goes."""
        taken = [path.stem.removeprefix("results").lstrip("-") or "1" for path in self.segments()]
        n = max((int(number) for number in taken if number.isdecimal()), default=0) + 1
        return self.path / ("results.h5" if n == 1 else f"results-{n:04d}.h5")

    def read(self) -> dict[str, Any]:
        """The content of `run.json`."""
        try:
            content = json.loads(self.about.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            why = "it is nested too deeply" if isinstance(error, RecursionError) else reason(error)
            cure = "restore it, or run the scenario again"
            raise CaromError(f"{self.about} cannot be read: {why}; {cure}") from error
        if not isinstance(content, dict):
            raise CaromError(f"{self.about} does not describe a run; restore it, or run the scenario again")
        return content

    def is_finished(self, steps: int) -> bool:
        """Whether the run has reached step `steps` and ended well."""
        about = self.read()
        outcome = about.get("outcome") or {}
        return about.get("status") == "done" and outcome.get("step") == steps

    def write(self, about: Mapping[str, Any]) -> None:
        """Replace `run.json`."""
        write_whole(self.about, json_bytes(about, indent=2), durable=self.durable)

    def write_scenario(self, text: str) -> None:
        """Replace `scenario.toml`."""
        write_whole(self.scenario, text.encode(), durable=self.durable)

    def write_in_place(self, about: Mapping[str, Any]) -> None:
        """Overwrite `run.json` where it lies: the last resort on a full disk, which has no room for a second file."""
        text = json_bytes(about)
        with suppress(OSError, RecordError), opened(self.about, os.O_RDWR, "r+b") as file:
            file.write(text)
            file.truncate()

    def log(self, event: str, **facts: Any) -> None:
        """Append a line to `log.jsonl`; only inside `writing`."""
        if self._log is not None:
            line = {"time": datetime.now(UTC).isoformat(timespec="milliseconds"), "event": event, **facts}
            with suppress(OSError):  # the log is a courtesy; the results report a full disk
                self._log.write(json_bytes(line).decode())
                self._log.flush()

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Be the one writer of this run. A lock on the log tells a living writer from one that was killed."""
        try:
            log = opened(self.log_file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, "ab")
            self._log = io.TextIOWrapper(log, encoding="utf-8")  # closed below, also by the kernel
        except OSError as error:
            told = f"cannot write {self.log_file}: {reason(error)}"
            if error.errno in (errno.EROFS, errno.EACCES, errno.EPERM):
                raise RecordError(
                    f"{told}; copy the run to where it can be written, and continue it there"
                ) from error
            raise RecordError(f"cannot write {self.log_file}: {unwritable(error)}") from error
        try:
            if not any(lock(self._log) for _ in _attempts()):
                raise CaromError(
                    f"{self.path} is being written by another process; wait for it, or interrupt it first"
                )
            if self._replaces:
                self._replace()
            for scrap in self.path.glob(".*.tmp"):  # of a process that was killed while it wrote one
                scrap.unlink(missing_ok=True)
            yield
        finally:
            with suppress(OSError):
                self._log.close()
            self._log = None

    def is_being_written(self) -> bool:
        """Whether the process that writes this run still lives (on this machine)."""
        try:
            with open(regular(self.log_file), encoding="utf-8") as log:
                return not lock(log, shared=True)
        except OSError:
            return False

    def _own(self) -> list[Path]:
        """What a run has written here. A folder that is a link may lead anywhere: what is in it is not the run's."""
        found = (file for pattern in _OWN for file in self.path.glob(pattern))
        return [file for file in found if first_link(self.path, file.parent) is None]

    def _replace(self) -> None:
        """Remove the old run. The log is emptied: who waits for its lock would else get that of a file which is gone."""
        assert self._log is not None
        try:
            self._remove_own(but=self.log_file)
            self._log.truncate(0)
        except OSError as error:
            raise RecordError(f"cannot replace the run {self.path}: {unwritable(error)}") from error
        self._replaces = False

    def _remove_own(self, but: Path | None = None) -> None:
        for file in self._own():
            if file != but and (file.is_symlink() or not file.is_dir()):
                file.unlink()

    def _is_own(self) -> bool:
        """Whether it is what a run leaves that was killed before it wrote `run.json`: the log, and nothing foreign."""
        there = set(self.path.iterdir())
        return self.log_file in there and there <= set(self._own()) and not self._results()

    def _results(self) -> list[str]:
        """What there is that is written after `run.json` and removed before it."""
        return [path.name for path in (*self.segments(), *sorted(self.path.glob("checkpoint-*.npz")))]

    def _refuse_lost(self) -> None:
        """Raise where `run.json` of a run was lost: neither is its result nothing, nor is it to be replaced."""
        if self.log_file.exists() and not self.about.exists() and (found := self._results()):
            raise CaromError(
                f"{self.about} is missing, and {', '.join(found)} of the run are there; put it back, as from a copy, or"
                " choose another directory for a new run"
            )

    def remove(self) -> None:
        """Delete what a run writes, and the directory if nothing else is in it."""
        with suppress(OSError):
            self._remove_own()
            parts = ("balls", "contacts", "walls", "pictures")
            folders = ("problems", "plots", *(f"export/{part}" for part in parts), "export")
            for empty in (*(self.path / name for name in folders), self.path):
                if empty.exists():
                    empty.rmdir()


def temporary() -> RunDir:
    """An empty run directory that nobody will look for after this process."""
    return RunDir(Path(tempfile.mkdtemp(prefix="carom-")), durable=False)


def size_on_disk(path: Path) -> int:
    """Bytes of all files in a run directory."""
    return sum(f.stat().st_size for f in path.rglob("*") if f.is_file())


def now() -> str:
    """The time for `run.json`, UTC, to the second."""
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())


def _attempts() -> Iterator[None]:
    """Several in a fraction of a second: a reader that looks whether somebody writes holds the lock for a moment."""
    for _ in range(LOCK_ATTEMPTS):
        yield
        time.sleep(LOCK_PAUSE)


def _literal(stem: str) -> str:
    return "".join(f"[{c}]" if c in "*?[" else c for c in stem)
