"""The list of commands."""

from __future__ import annotations

from itertools import chain
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from carom.cli.check import check
from carom.cli.cite import cite
from carom.cli.compare import compare
from carom.cli.converge import converge
from carom.cli.demo import demo
from carom.cli.doctor import doctor
from carom.cli.examples import examples
from carom.cli.export import export
from carom.cli.fit import fit
from carom.cli.info import info
from carom.cli.options import Command
from carom.cli.play import play
from carom.cli.plot import plot
from carom.cli.reproduce import reproduce
from carom.cli.resume import resume
from carom.cli.run import run
from carom.cli.schema import schema
from carom.cli.solve import solve
from carom.cli.sweep import sweep
from carom.cli.view import view

#: The commands by purpose, in the order of `carom --help`.
GROUPS: dict[str, tuple[Any, ...]] = {
    "Start": (demo, play, examples, doctor),
    "Simulate": (run, resume, sweep, fit),
    "Look": (view, plot, export, info),
    "Check": (check, converge, compare, reproduce),
    "Other tasks": (solve, schema, cite),
}


def name_of(command: Any) -> str:
    return "examples" if command is examples else str(command.__name__)


class GroupedCommands(TyperGroup):
    """A list of commands by purpose, before the options. Typer itself groups commands only in Rich's frames."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        width = max(map(len, self.commands))
        for title, group in GROUPS.items():
            names = map(name_of, group)
            rows = [(n.ljust(width), self.commands[n].get_short_help_str(formatter.width)) for n in names]
            with formatter.section(title):
                formatter.write_dl(rows)
        super().format_options(ctx, formatter)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """`format_options` has listed the commands."""


app = typer.Typer(
    name="carom",
    cls=GroupedCommands,
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
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Simulate rigid balls that hit, slide, roll and spin.

    Begin with

    \b
      carom demo                       a billiard break: table, figures, 3D pages
      carom examples copy three_balls  a scenario file, to read and to edit
      carom run three_balls.toml       simulate it
      carom COMMAND --help             options of a command, and an example

    Exit codes: 0 done, 2 bad input, 3 not converged, 130 interrupted.
    """


for _command in chain(*GROUPS.values()):
    if _command is examples:
        continue
    # Its first sentence stands whole in the list of commands, which click would cut at 45 characters.
    _sentence = (_command.__doc__ or "").strip().split("\n\n")[0]
    app.command(cls=Command, no_args_is_help=False, short_help=" ".join(_sentence.split()))(_command)
app.add_typer(examples, name="examples")
