"""`carom plot`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from carom.cli.options import Formats, Json, Run, listed, listing, loaded, option
from carom.cli.output import files, guarded, note
from carom.files import inside


@guarded
def plot(
    run: Run,
    what: Annotated[
        list[str] | None,
        option(
            "--what",
            "FIGURE",
            "Figures: velocities, angular-velocities, heights, trajectories, energies, phases, impacts, iterations,"
            " residuals, or all (default); may be repeated.",
        ),
    ] = None,
    step: Annotated[
        int | None,
        option(
            "--step",
            "K",
            "Step shown by residuals and impacts. Default: the one with most iterations or impact problems.",
        ),
    ] = None,
    bodies: Annotated[
        str | None, option("--bodies", "A,B", "Draw only these bodies; a clump means its balls.")
    ] = None,
    format_: Formats = "png",
    width: Annotated[
        str, option("--width", "WIDTH", "Figure width: single or double column of a page.")
    ] = "double",
    out: Annotated[Path | None, option("-o", "--out", "DIR", "Output directory. Default: RUN/plots.")] = None,
    as_json: Json = False,
) -> None:
    """Draw figures of a run, and write their numbers as CSV.

    Example: carom plot runs/break-1 --what velocities --format pdf
    """
    result = loaded(run)
    named = listed("--what", *(what or ["all"]))
    if step is not None and "all" in named:
        kinds = result.plot.available(step)
        for kind in result.plot.available():
            if kind not in kinds:
                note(f"step {step} has no {kind}: no such figure")
    drawn = result.plot.save(
        out or inside(result.path, "plots"),
        None if "all" in named else named,
        formats=listed("--format", format_),
        bodies=listed("--bodies", bodies) or None,
        step=step,
        width=width,
    )
    from carom.show.plot.motion import MOST_LINES

    if bodies is None and len(result.names) > MOST_LINES:
        spread = "figures show median, 5 to 95 %, least and greatest"
        note(f"{len(result.names)} bodies: {spread}; --bodies {listing(result.names[:2])} draws these two")
    files(drawn, as_json)
