"""Options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON document on standard output and nothing else.")
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar and no summary.")]
Run = Annotated[
    Path, typer.Argument(metavar="RUN", help="A run directory, as `carom run` makes it.", show_default=False)
]
Scenario = Annotated[
    Path, typer.Argument(metavar="SCENARIO", help="A scenario file (TOML).", show_default=False)
]


def settings(pairs: list[str]) -> dict[str, Any]:
    """`KEY=VALUE` options as keywords of `carom.simulate`; values are TOML, and what is not TOML is a string."""
    import tomllib

    found: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        key = key.strip().removeprefix("run.").removeprefix("record.")
        if not equals or not key:
            raise typer.BadParameter(f"{pair!r} is not KEY=VALUE; write for example --set step=1e-4")
        try:
            found[key] = tomllib.loads(f"value = {text.strip()}")["value"]
        except tomllib.TOMLDecodeError:
            found[key] = text.strip()
    return found


def overrides(set_: list[str] | None, until: str | None) -> tuple[dict[str, Any], dict[str, str]]:
    """The keys given on the command line, and how a message calls the place of each."""
    options = settings(set_ or [])
    places = {key: f"--set {key}" for key in options}
    if until is not None:
        options["until"] = number(until)
        places["until"] = "--until"
    return options, places


def number(text: str | None) -> Any:
    """A number if it is one; what has a unit is left to the scenario, which knows them."""
    try:
        return None if text is None else float(text)
    except ValueError:
        return text
