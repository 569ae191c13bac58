"""`carom cite`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument

from carom.cli.options import Json
from carom.cli.output import emit, guarded


@guarded
def cite(
    what: Annotated[
        Path | None, Argument(metavar="[SCENARIO|RUN]", help="Scenario file or run directory.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Print how to cite Carom, and the sources of its methods.

    With a scenario or a run, print only the sources that it uses.

    Example: carom cite runs/5.6_break-1
    """
    import carom
    from carom.reproduce.citations import bibtex, sources

    scene = None
    if what is not None:
        from carom.result.directory import RunDir
        from carom.scene.scene import Scene

        scene = Scene.from_toml(RunDir.open(what).scenario if what.is_dir() else what)
    found = sources(scene)
    if as_json:
        emit({"version": carom.__version__, "bibtex": bibtex(), "sources": found})
        return
    print(f"Please cite Carom with its version, and the papers whose methods it uses:\n\n{bibtex()}\n")
    for source in found.values():
        print(f"  {source}")
