"""The command line. `carom.cli:main` is the entry point; every command is a module of its own beside this one.

Only typer is imported for all of them: what a command computes with is imported when it runs, so that `--help` is quick.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and leave the process: 0 done, 2 bad input, 3 solver not converged, 130 interrupted."""
    try:
        from carom.cli.app import app
    except KeyboardInterrupt:
        sys.exit(130)
    app(args=list(arguments) if arguments is not None else None, prog_name="carom")
