"""Contact problems in the directory of a run: how their files are called, how one is found again.

Each is a file in the layout of FCLib (`carom.problem.fclib`) with a group `/carom` beside it: where the problem is
from, the bodies and frames of its contacts, and the multipliers `r` that the run found.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carom.problem.errors import ContactProblemError, refuse
from carom.problem.fclib import write_fclib
from carom.problem.global_ import GlobalProblem
from carom.problem.kept import frames, moving, multipliers, state
from carom.result.directory import RunDir

FOLDER = "problems"
FAILING = "failing_problem.h5"
LEVELS = ("position", "velocity")
#: Entries of a stored problem that go to the file as they are.
ORIGIN = (
    "level",
    "step",
    "time",
    "part",
    "island",
    "index",
    "iterations",
    "residual",
    "converged",
    "joints",
    "attempts",
)
_NAME = re.compile(
    r"step_(?P<step>\d+)(?:_part(?P<part>\d+))?_(?P<level>position|velocity)_(?P<island>\d+)(?:_(?P<index>\d+))?"
    r"(?:_again(?P<again>\d+))?\.hdf5"
)


def file_name(kept: Mapping[str, Any]) -> str:
    """`step_000123_position_0.hdf5`: step, level, island, and at velocity level the impact problem; in a halved step
    `_part2` after the step. `_again1` at the end is the second problem of the same place (`again`, 0 where there is none).
    """
    part = f"_part{kept['part']}" if kept["part"] else ""
    index = f"_{kept['index']}" if kept["level"] == "velocity" else ""
    again = f"_again{kept['again']}" if kept.get("again") else ""
    return f"step_{kept['step']:06d}{part}_{kept['level']}_{kept['island']}{index}{again}.hdf5"


def write_kept(path: Path, kept: Mapping[str, Any], form: str = "local") -> Path:
    """Write a problem as `Simulation.take_problems` and `failing_problem` give it."""
    problem = state(kept, form)
    of_v = {"v_bodies": moving(kept)} if isinstance(problem, GlobalProblem) else {}
    return write_fclib(problem, path, extra={**origin(kept), **of_v})


def keep_failing(directory: RunDir, kept: Mapping[str, Any], outcome: dict[str, Any]) -> None:
    """Write the problem that a run could not solve, and say in its outcome where; joints alone are no contact problem."""
    if kept["joints"] == len(kept["bodies"]):
        return
    try:
        outcome["problem_file"] = write_kept(directory.path / FAILING, kept).name
    except ContactProblemError as error:
        directory.log("problem not kept", file=FAILING, message=str(error))


def origin(kept: Mapping[str, Any]) -> dict[str, Any]:
    """The group `/carom` of a file: where the problem is from, its contacts, what the run found."""
    axes = frames(kept)
    return {
        **{key: kept[key] for key in ORIGIN},
        "again": kept.get("again", 0),
        "bodies": kept["bodies"][: len(axes)],
        "r": multipliers(kept),
        **{name: axes[:, k] for k, name in enumerate(("normal", "tangent1", "tangent2"))},
    }


@dataclass(frozen=True, order=True)
class KeptFile:
    """A problem of a run, by the name of its file."""

    step: int
    part: int
    level: str
    island: int
    index: int
    again: int
    path: Path

    def __str__(self) -> str:
        part = f", part={self.part}" if self.part else ""
        index = f", index={self.index}" if self.level == "velocity" else ""
        again = f", again={self.again}" if self.again else ""
        return f"step={self.step}{part}, level={self.level!r}, island={self.island}{index}{again}"


def kept_files(run: Path) -> list[KeptFile]:
    """The problems in the directory of a run, in the order of its steps."""
    found = []
    for path in (run / FOLDER).glob("*.hdf5"):
        if match := _NAME.fullmatch(path.name):
            step, part, island, index, again = (
                int(match[key] or 0) for key in ("step", "part", "island", "index", "again")
            )
            found.append(KeptFile(step, part, match["level"], island, index, again, path))
    return sorted(found)


def find(run: Path, failed_step: int | None, **wanted: Any) -> Path:
    """The file of the one problem with the `wanted` (not None) step, part, level, island, index and again.

    Without any it is the one that could not be solved, of step `failed_step`, or the only one there is.
    """
    wanted = {key: value for key, value in wanted.items() if value is not None}
    if (level := wanted.get("level")) not in (None, *LEVELS):
        raise refuse("level", f"{level!r}", f"there are {' and '.join(map(repr, LEVELS))}")
    failing = run / FAILING
    if failing.is_file() and (not wanted or wanted == {"step": failed_step}):
        return failing
    there = kept_files(run)
    fitting = [file for file in there if all(getattr(file, key) == value for key, value in wanted.items())]
    if len(fitting) == 1:
        return fitting[0].path
    asked = ", ".join(f"{key}={value!r}" for key, value in wanted.items())
    if fitting:
        names = _some(fitting)
        if any(file.again for file in fitting):
            names += " (again=0 is the first where again is not named)"
        cause = f"{len(fitting)} contact problems {'with ' + asked if asked else 'there'}"
        raise refuse(str(run), cause, f"say which: {names}")
    if not there and not failing.is_file():
        cause = "no contact problem was kept"
        raise refuse(str(run), cause, "save_problems=... (--save-problems) keeps those of chosen steps")
    known = [f"step {failed_step} (not solved)"] * failing.is_file()
    if here := [file for file in there if file.step == wanted.get("step")]:
        raise refuse(str(run), f"no contact problem with {asked}", f"of this step there are: {_some(here)}")
    steps = sorted({file.step for file in there})
    known += [f"steps {', '.join(map(str, steps[:8]))}{', ...' if len(steps) > 8 else ''}"] * bool(steps)
    raise refuse(str(run), f"no contact problem with {asked}", f"there are those of {' and '.join(known)}")


def _some(files: list[KeptFile]) -> str:
    """The first of these, for a message."""
    return "; ".join(map(str, files[:4])) + ("; ..." if len(files) > 4 else "")
