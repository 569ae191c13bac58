"""The command line. `carom.cli:program` is the entry point, `main` what other programs
call; every command is a module of its own beside this one.

Only typer is imported for all of them: what a command computes with is imported when it runs, so that `--help` is quick.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and raise `SystemExit`: 0 done, 2 bad input, 3 solver not converged, 130 interrupted."""
    _exit(sys.argv[1:] if arguments is None else arguments, own=False)


def program() -> None:
    """`main` as a process of its own: it ends, and no signal changes its exit code any more."""
    _exit(sys.argv[1:], own=True)


def _exit(arguments: Sequence[str], own: bool) -> None:
    try:
        from carom.cli.process import decided, flushed, reopen, terminated_as_interrupted

        reopen()
        with decided(own), terminated_as_interrupted():
            code = flushed(_called(list(arguments)))
    except KeyboardInterrupt:
        code = 130
    sys.exit(code)


def _called(given: list[str]) -> int:
    from carom.cli.app import app
    from carom.cli.process import printable, unwritable

    with printable(output=False):
        try:
            try:
                return app(args=given, prog_name="carom", standalone_mode=False) or 0
            except OSError:
                raise
            except Exception as error:
                return _misused(error, as_json="--json" in given)
        except OSError as error:  # of help, or what is said of a misspelt line: commands let none out
            return unwritable(error)


def _misused(error: Exception, *, as_json: bool) -> int:
    """One line, and a document with `--json`, for a command line that cannot be understood.

    Which package the errors come from depends on the version of typer; they are known by what they can do.
    """
    from carom.cli.output import BAD_INPUT, INTERRUPTED, fail

    if type(error).__name__ == "Abort":
        return INTERRUPTED
    if type(error).__name__ == "NoArgsIsHelpError":  # asked for nothing: the help is the answer
        error.show()  # type: ignore[attr-defined]
        return BAD_INPUT
    if not hasattr(error, "format_message"):
        raise error
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "carom"
    told = " ".join(str(error.format_message()).split()).rstrip(".")
    return fail(f"{told}; {command} --help explains it", BAD_INPUT, as_json)
