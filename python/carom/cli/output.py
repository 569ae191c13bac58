"""What all commands share: one line for an error, one document for `--json`, exit codes."""

from __future__ import annotations

import functools
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterable
from typing import Any, ParamSpec

import typer

from carom.cli.process import Unwritable, leave_at_once, printable, unwritable
from carom.errors import CaromError, ScenarioError
from carom.files import finite, json_bytes
from carom.text import seconds as seconds

P = ParamSpec("P")

DONE, CRASH, BAD_INPUT, NOT_CONVERGED, INTERRUPTED = 0, 1, 2, 3, 130

#: Set to see where an error of Carom itself comes from.
TRACEBACK = "CAROM_TRACEBACK"


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, with the line that the command says of it."""


def guarded(command: Callable[P, int | None]) -> Callable[P, None]:
    """A command whose errors and warnings become a line each on standard error; it may return its exit code."""

    @functools.wraps(command)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> None:
        with printable():
            try:
                code = _run(command, *args, **kwargs)
            except Unwritable as error:
                code = unwritable(error)
        _leave_at_once_if_broken(code)
        raise typer.Exit(code)

    return wrapped


def _run(command: Callable[P, int | None], *args: P.args, **kwargs: P.kwargs) -> int:
    as_json = bool(kwargs.get("as_json"))
    try:
        with warnings.catch_warnings():
            said: set[str] = set()

            def say(message: Warning | str, *_: Any, **__: Any) -> None:
                if str(message) not in said:  # each of many figures may have the same one
                    said.add(str(message))
                    note(f"warning: {message}")

            warnings.showwarning = say
            code = command(*args, **kwargs) or DONE
    except KeyboardInterrupt as error:
        told = str(error) if isinstance(error, Interrupted) else "interrupted"
        code = fail(told, INTERRUPTED, as_json)
    except Unwritable:
        raise
    except (ValueError, OSError, MemoryError) as error:
        if not isinstance(error, (CaromError, OSError, MemoryError)):
            code = _crashed(error, as_json)
        else:
            code = _refused(error, as_json)
    except Exception as error:
        if isinstance(error, typer.Exit) or type(error).__module__.split(".")[0] in ("typer", "click"):
            raise  # usage errors, which typer explains itself
        code = _crashed(error, as_json)
    return code


def fail(message: str, code: int, as_json: bool = False, **facts: Any) -> int:
    """Say on standard error what is wrong, and as a JSON document too if one was asked for; returns `code`."""
    print(f"carom: {message}", file=sys.stderr)
    if as_json:
        emit({"error": message, "code": code, **facts})
    return code


def emit(document: Any) -> None:
    """The one JSON document of a command with `--json`. What is not a finite number becomes null, as JSON demands."""
    print(json_bytes(finite(document), indent=2, allow_nan=False).decode(), end="")


def note(message: str) -> None:
    """A remark on standard error."""
    print(f"carom: {message}", file=sys.stderr)


def files(found: Iterable[Any], as_json: bool) -> None:
    """Say which files were written, a line each or as a document."""
    names = [str(file) for file in found]
    emit({"files": names}) if as_json else print("\n".join(names))


def _leave_at_once_if_broken(code: int) -> None:
    writer = sys.modules.get("carom.result.record.writer")
    if writer is not None and writer.Writer.unclosable:
        leave_at_once(code)


def _refused(error: Exception, as_json: bool) -> int:
    if isinstance(error, ScenarioError):
        # Problems of a file begin with its name and line, as those of compilers do.
        print(re.sub("(?m)^(?=--)", "carom: ", error.report()), file=sys.stderr)
        if as_json:
            emit({"error": str(error), "code": BAD_INPUT, "problems": [p.to_dict() for p in error.problems]})
        return BAD_INPUT
    if isinstance(error, MemoryError):
        return fail(
            "not enough memory for this; use fewer bodies, or a larger `every` in [record]",
            BAD_INPUT,
            as_json,
        )
    if isinstance(error, OSError) and error.filename:
        return fail(f"{error.filename}: {error.strerror}", BAD_INPUT, as_json)
    return fail(" ".join(str(error).split()) or type(error).__name__, BAD_INPUT, as_json)


def _crashed(error: BaseException, as_json: bool) -> int:
    if os.environ.get(TRACEBACK):
        raise error
    told = f"{type(error).__name__}: {' '.join(str(error).split())}"
    return fail(
        f"error in Carom itself, please report it ({TRACEBACK}=1 shows where): {told}", CRASH, as_json
    )
