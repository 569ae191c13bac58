"""`carom examples list` and `carom examples copy`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from carom.cli.options import Command, Json, option
from carom.cli.output import emit, guarded
from carom.errors import CaromError
from carom.files import write_named
from carom.scene.shipped import find as find

examples = typer.Typer(no_args_is_help=True, help="List and copy the scenarios that come with Carom.")


def _names(incomplete: str) -> list[str]:
    """What a shell offers for a name that has begun; the last part of a name is enough."""
    from carom.scene.shipped import shipped

    return [n for name in shipped() for n in {name, name.rsplit("/", 1)[-1]} if n.startswith(incomplete)]


@examples.command("list", cls=Command)
@guarded
def list_(as_json: Json = False) -> None:
    """List the scenarios that come with Carom.

    Example: carom examples list
    """
    from carom.scene.shipped import shipped

    rows = [(name, _title(path)) for name, path in shipped().items()]
    if as_json:
        emit([{"name": name, "title": title} for name, title in rows])
    else:
        width = max((len(name) for name, _ in rows), default=0)
        print("\n".join(f"{name:{width}}  {title}" for name, title in rows))


@examples.command("copy", cls=Command)
@guarded
def copy(
    name: Annotated[
        str,
        typer.Argument(help="Name from `carom examples list`.", show_default=False, autocompletion=_names),
    ],
    to: Annotated[Path, typer.Argument(help="File or directory to copy to.")] = Path(),
    force: Annotated[bool, option("--force", "Replace an existing file.")] = False,
    as_json: Json = False,
) -> None:
    """Copy a scenario, to run it and to edit it.

    Example: carom examples copy paper/5.6_break
    """
    source = find(name)
    target = to / source.name if to.is_dir() or to.suffix != ".toml" else to
    if target.exists() and not force:
        raise CaromError(f"{target} exists already; give --force to replace it, or another name")
    try:
        write_named(target, source.read_bytes())
    except CaromError as error:
        raise CaromError(str(error).replace("write elsewhere", f"give another place after {name}")) from None
    if as_json:
        emit({"file": str(target)})
    else:
        print(f"{target}  (carom run {target})")


def _title(path: Path) -> str:
    found = re.search(r'^title\s*=\s*"(.*)"', path.read_text(encoding="utf-8"), re.MULTILINE)
    return found[1] if found else ""
