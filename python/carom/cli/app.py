"""The list of commands."""

from __future__ import annotations

from typing import Annotated

import typer

from carom.cli.check import check
from carom.cli.cite import cite
from carom.cli.compare import compare
from carom.cli.converge import converge
from carom.cli.demo import demo
from carom.cli.doctor import doctor
from carom.cli.examples import examples
from carom.cli.export import export
from carom.cli.info import info
from carom.cli.plot import plot
from carom.cli.reproduce import reproduce
from carom.cli.resume import resume
from carom.cli.run import run
from carom.cli.schema import schema
from carom.cli.solve import solve
from carom.cli.sweep import sweep
from carom.cli.view import view

app = typer.Typer(
    name="carom",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        import carom

        typer.echo(f"carom {carom.__version__}")
        raise typer.Exit


@app.callback()
def carom(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Simulate spheres that touch, hit, slide, roll and spin.

    Exit codes: 0 done, 2 bad input, 3 solver not converged, 130 interrupted.

    Begin with `carom demo`, or with `carom examples copy three_balls` and `carom run three_balls.toml`.
    """


for _command in (
    demo,
    run,
    resume,
    check,
    compare,
    converge,
    sweep,
    plot,
    view,
    export,
    reproduce,
    solve,
    info,
    schema,
    doctor,
    cite,
):
    # Its first sentence stands whole in the list of commands, which click would cut at 45 characters.
    _sentence = (_command.__doc__ or "").strip().split("\n\n")[0]
    app.command(no_args_is_help=False, short_help=" ".join(_sentence.split()))(_command)
app.add_typer(examples, name="examples")
