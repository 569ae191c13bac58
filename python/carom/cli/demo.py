"""`carom demo`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

from carom.cli.options import Json, Quiet, can_draw, option
from carom.cli.output import DONE, NOT_CONVERGED, emit, guarded, note, seconds
from carom.cli.progress import progress_bar
from carom.files import inside
from carom.text import columns


@guarded
def demo(
    out: Annotated[Path, option("-o", "--out", "DIR", "Output directory.")] = Path("demo"),
    plots: Annotated[bool, option("Draw the figures (needs matplotlib).")] = True,
    quiet: Quiet = False,
    as_json: Json = False,
) -> int:
    """Run the paper's billiard break; print a table, write 3D pages.

    The table compares Carom with the paper, with and without rolling resistance. Runs, figures and a 3D page of each case
    go to DIR; an earlier demo there is replaced.

    Example: carom demo -o /tmp/demo
    """
    from carom.reproduce import demo as story

    begin = time.perf_counter()
    document: dict[str, Any] = {"cases": {}}
    code = DONE
    for case in story.CASES:
        directory = out / case
        with progress_bar(not (quiet or as_json)) as bar:
            result = story.simulate(case, directory, progress=bar)
        if not result.outcome.ok:
            note(f"{case}: {result.outcome}")
            code = NOT_CONVERGED
            continue
        rows = story.compare(result, story.exactly(result))
        files = [result.view(title=result.title or case).path]
        if plots and can_draw():
            files += result.plot.save(inside(result.path, "plots"))
        document["cases"][case] = {
            "rows": story.as_json(rows),
            "directory": str(directory),
            "files": [str(f) for f in files],
        }
        if not (quiet or as_json):
            print(f"{result.title or case}\n\n{story.as_table(rows, columns())}\n")
            print(f"3D page     {files[0]}  (open it in a browser; it needs no network)")
            if len(files) > 1:
                print(f"figures     {files[1].parent}{'/'}  ({len(files) - 1} files)")
            print(f"run         {directory}\n")
    document["wall_s"] = time.perf_counter() - begin
    if as_json:
        emit(document)
    elif not quiet:
        print(f"all of it took {seconds(document['wall_s'])}")
    return code
