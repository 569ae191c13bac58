"""Options that several commands have."""

from __future__ import annotations

import csv
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer
from typer.core import TyperCommand, TyperOption

from carom.cli.output import note
from carom.errors import CaromError, Problem, ScenarioError, did_you_mean, only_once
from carom.files import csv_bytes

if TYPE_CHECKING:
    from carom.run.result import Result
    from carom.scene.scene import Scene
    from carom.show.plot.style import Chart


def option(*words: str, **more: Any) -> Any:
    """An option: its names, its METAVAR if it has one, its help."""
    names = [word for word in words if word.startswith("-")]
    *metavar, told = words[len(names) :]
    return typer.Option(*names, metavar=metavar[0] if metavar else None, help=told, **more)


class Command(TyperCommand):
    """A command that refuses an option of one value that is given twice, of which the last one would count, and an empty
    path, which would be the working directory.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """The arguments that are left when the options are read."""
        if not ctx.resilient_parsing:
            seen = set()
            values, _, order = self.make_parser(ctx).parse_args(args=list(args))
            for param in self.params:
                value = values.get(str(param.name))
                if "" in (value if isinstance(value, list | tuple) else [value]) and self._takes_paths(param):
                    name = param.opts[-1] if isinstance(param, TyperOption) else param.metavar
                    ctx.fail(f"{name}: the path is empty; name a file or a directory")
            for given in order:
                one = isinstance(given, TyperOption) and not (given.multiple or given.is_flag)
                if one and given.name in seen:
                    ctx.fail(f"{given.opts[-1]} is given twice; leave out one of the two")
                seen.add(given.name)
        return super().parse_args(ctx, args)

    def _takes_paths(self, param: Any) -> bool:
        """Whether an argument or option is a path, or several; typer itself says so in each version in another way."""
        hint = get_type_hints(self.callback)[str(param.name)]
        return Path in (hint, *(part for inner in (hint, *get_args(hint)) for part in get_args(inner)))


Json = Annotated[bool, option("--json", "Print one JSON document on standard output and nothing else.")]
Quiet = Annotated[bool, option("--quiet", "-q", "Show no progress bar and no summary.")]
Run = Annotated[
    Path, typer.Argument(metavar="RUN", help="Run directory, made by `carom run`.", show_default=False)
]
Scenario = Annotated[
    Path, typer.Argument(metavar="SCENARIO", help="Scenario file (TOML).", show_default=False)
]


Case = Annotated[str | None, option("--case", "NAME", "Use this [[case]] of the file.")]
Until = Annotated[str | None, option("--until", "TIME", "Simulated time: seconds, or with a unit.")]
Set = Annotated[
    list[str] | None,
    option(
        "--set",
        "KEY=VALUE",
        "Override a parameter of the file, or a key of [run] or [record]; may be repeated.",
    ),
]


Formats = Annotated[str, option("--format", "FORMAT", "File formats: png, svg, pdf; several with commas.")]


def listed(option: str, *texts: str | None) -> list[str]:
    """What an option that takes several with commas was given, also more than once; none where it was not given.

    A text is a line of CSV: a name with a comma stands in double quotes, and quotes within these are doubled.
    """
    found = []
    for text in filter(lambda text: text is not None, texts):
        row = next(csv.reader([str(text)], skipinitialspace=True), [])
        parts = [part.strip() for part in row if part.strip()]
        if not parts:
            raise CaromError(f"{option}: {text!r} names nothing; name one or more, with commas between them")
        found += parts
    return found


def listing(names: Sequence[str]) -> str:
    """Names as `listed` takes them, quoted for a shell."""
    return shlex.quote(csv_bytes([names]).decode().removesuffix("\n"))


def times(option: str, *given: str | None) -> list[float]:
    """The times (s) of an option that takes several with commas, in seconds or with a unit."""
    from carom.units import number as read

    return [read("", option, number(part), "time", infinite=True) for part in listed(option, *given)]


def time(option: str, given: str | None) -> float | None:
    """The time (s) of an option, in seconds or with a unit."""
    if len(found := times(option, given)) > 1:
        raise CaromError(f"{option}: {given!r} names several times; give one")
    return found[0] if found else None


def figure_formats(text: str) -> list[str]:
    """The formats of figures asked for."""
    from carom.show.plot import FORMATS

    formats = listed("--format", text)
    for given in formats:
        if given not in FORMATS:
            raise CaromError(f"--format: {given!r} is no format of a figure; {did_you_mean(given, FORMATS)}")
    return formats


def can_draw() -> bool:
    """Whether there is what figures need; if not, that is said."""
    from importlib.util import find_spec

    found = find_spec("matplotlib") is not None
    if not found:
        note("no figures: matplotlib is missing (pip install 'carom[plot]')")
    return found


def loaded(run: Path) -> Result:
    """The result of a run; what is to be said of it goes to standard error."""
    import warnings

    from carom.run.result import load

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = load(run)
    for warning in caught:
        note(str(warning.message))
    return result


def settings(pairs: list[str]) -> dict[str, Any]:
    """`KEY=VALUE` options as keywords of `carom.simulate`; values are TOML, and what is not TOML is a string."""
    return overrides(pairs, None)[0]


def _assignments(pairs: list[str]) -> list[tuple[str, Any]]:
    """Keys as they are written, with or without the section before a point, and values; numbers as of `--until`."""
    import tomllib

    found: list[tuple[str, Any]] = []
    for pair in pairs:
        key, equals, text = pair.partition("=")
        key = key.strip()
        if not equals or not key.rpartition(".")[2]:
            raise typer.BadParameter(f"{pair!r} is not KEY=VALUE; write for example --set step=1e-4")
        try:
            found.append((key, tomllib.loads(f"value = {text.strip()}")["value"]))
        except tomllib.TOMLDecodeError:
            found.append((key, number(text.strip())))
    return found


def overrides(set_: list[str] | None, until: str | None) -> tuple[dict[str, Any], dict[str, str]]:
    """The keys given on the command line, and how a message calls the place of each."""
    given = [
        (key.removeprefix("run.").removeprefix("record."), f"--set {key}", value)
        for key, value in _assignments(set_ or [])
    ]
    if until is not None:
        given.append(("until", "--until", number(until)))
    return only_once(given), {place: told for place, told, _ in given}


def scene(scenario: Path, case: str | None, set_: list[str] | None, until: str | None = None) -> Scene:
    """The scene of a file, in the variant and with the settings given on the command line."""
    from carom.scene.scene import Scene

    parameters = _parameters(scenario, set_ or [])
    taken = {key for key, _ in parameters}
    rest = [pair for pair in set_ or [] if pair.partition("=")[0].strip() not in taken]
    options, places = overrides(rest, until)
    given = only_once((key.removeprefix(_PARAMETERS), f"--set {key}", value) for key, value in parameters)
    found = Scene.from_toml(scenario, case=case, parameters=given)
    return found.overridden(options, places) if options else found


_PARAMETERS = "parameters."


def _parameters(scenario: Path, pairs: list[str]) -> list[tuple[str, Any]]:
    """Those settings that concern parameters of the file, with their keys as they are written."""
    assigned = _assignments(pairs)
    if not assigned:
        return []
    from carom.scene.tables.model import SINGLE
    from carom.scene.toml import load

    known, _ = load.variants(scenario)
    options = {key: name for name in ("run", "record") for key in SINGLE[name].model_fields}
    found = []
    for key, value in assigned:
        if key.startswith(_PARAMETERS) or key in known:
            if key in options:
                raise CaromError(
                    f"--set {key}: both a parameter of the file and a key of [{options[key]}] are called so;"
                    f" write --set {_PARAMETERS}{key}=... or --set {options[key]}.{key}=..."
                )
            found.append((key, value))
        elif known and key.rpartition(".")[2] not in options:
            cause = "is neither a parameter of the file nor a key of [run] or [record]"
            raise ScenarioError([Problem(f"--set {key}", "", cause, did_you_mean(key, [*known, *options]))])
    return found


def number(text: str | None) -> Any:
    """A number if it is one; what has a unit is left to the scenario, which knows them."""
    try:
        return None if text is None else float(text)
    except ValueError:
        return text


Force = Annotated[bool, option("--force", "Replace files that are there.")]


def refuse_existing(name: str, path: Path | None, force: bool) -> None:
    """Refuses to write what is there already, before anything is computed. `name` is the option that names the file."""
    if path is not None and not force and path.exists() and not path.is_dir():
        raise CaromError(f"{name}: {path} exists already; give --force to replace it, or another name")


def refuse_figure(plot: Path | None, force: bool) -> None:
    """Refuses a figure whose name ends in no known format, and one that is there, as are its numbers beside it."""
    from carom.show.plot import FORMATS

    if plot is not None and plot.suffix.removeprefix(".") not in FORMATS:
        raise typer.BadParameter(f"--plot {plot}: give a name that ends in .{', .'.join(FORMATS)}")
    if plot is not None:
        for path in (plot, plot.with_suffix(".csv")):
            refuse_existing("--plot", path, force)


def drawn(chart: Callable[[Any], Chart], found: Any, plot: Path | None) -> list[str]:
    """The files of the chart of what was found, with its numbers; none without a name."""
    from carom.show.plot import require_matplotlib
    from carom.show.plot.style import save

    if plot is None:
        return []
    require_matplotlib()
    return [str(file) for file in save(chart(found), plot.parent, plot.stem, [plot.suffix.removeprefix(".")])]
