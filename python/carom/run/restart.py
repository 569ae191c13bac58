"""From which checkpoint a run continues, and why not from another one.

The newest is taken if it is whole, of this scenario, of this version of Carom, and if all results up to it are
there. Otherwise nothing is done: the error says what is wrong and what there is instead, and the user decides.
Nothing that was refused is deleted: it is put aside under another name.
"""

from __future__ import annotations

import functools
import itertools
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carom import _core
from carom.errors import CaromError, counted, did_you_mean
from carom.result.directory import RunDir
from carom.result.record import Rows, Segments
from carom.run import changes, checkpoint
from carom.run.checkpoint import Checkpoint
from carom.scene.plan import Plan, thinned

#: What `carom resume --checkpoint` and `carom.resume(checkpoint=...)` take.
CHOICES = ("newest", "previous", "start")

#: Versions whose checkpoints this one continues with the same bits.
COMPATIBLE: frozenset[str] = frozenset()

#: Added to the name of what a continued run must not meet again.
ASIDE = ".aside"


def _silent(text: str) -> None:
    """For callers that want no report."""


@dataclass(frozen=True)
class Wish:
    """From where a run is to go on: `checkpoint` is one of `CHOICES`; with `any_version` that of another version of
    Carom will do. `tell` is called with what the user should know.
    """

    checkpoint: str = "newest"
    any_version: bool = False
    tell: Callable[[str], None] = _silent

    def __post_init__(self) -> None:
        if self.checkpoint not in CHOICES:
            raise CaromError(
                f"checkpoint: unknown choice {self.checkpoint!r}; {did_you_mean(self.checkpoint, CHOICES)}"
            )

    @property
    def anew(self) -> bool:
        """Whether the run is to be computed from its start."""
        return self.checkpoint == "start"


def choose(directory: RunDir, about: Mapping[str, Any], wish: Wish) -> Checkpoint | None:
    """The checkpoint to continue from, None for the start; `about` is the content of `run.json`.

    Raises `CaromError` if what was wished for cannot be used.
    """
    if wish.anew:
        return None
    paths = checkpoint.found(directory.path)
    here = f"carom resume {directory.path}"
    if wish.checkpoint == "previous" and len(paths) < 2:
        found = f"only {paths[0].name}" if paths else "none"
        raise CaromError(
            f"{directory.path} has no previous checkpoint, {found}; `{here} --checkpoint start` computes the run anew"
        )
    judge = functools.partial(_judged, directory, about, wish.any_version)
    wanted = CHOICES.index(wish.checkpoint)
    if wanted >= len(paths):
        if "summary" in about:  # it was not cut short, and such a run in a directory leaves one
            raise CaromError(
                f"{directory.path} has no checkpoint: its result was kept in memory and saved, or they were removed;"
                f" `{here} --checkpoint start` computes the run anew from its scenario, and puts these results aside"
            )
        complaint = _missing(directory, Rows())  # killed before the first one
        if complaint:
            raise CaromError(f"{complaint}; `{here} --checkpoint start` computes the run anew")
        return None
    chosen = judge(paths[wanted])
    if isinstance(chosen, Checkpoint):
        return chosen
    others = [(name, judge(path)) for name, path in zip(CHOICES, paths) if name != wish.checkpoint]
    for name, other in others:
        if isinstance(other, Checkpoint):
            option = "" if name == "newest" else " --checkpoint previous"
            raise CaromError(
                f"{chosen}; the {name} one, of step {other.step} (t = {other.time:g} s), can be: `{here}{option}`"
                " continues from it"
            )
    raise CaromError(f"{chosen}; no other can be; `{here} --checkpoint start` computes the run anew")


def put_aside(directory: RunDir, chosen: Checkpoint | None, wish: Wish) -> list[str]:
    """Rename what stands in the way of continuing from `chosen`; returns the names as they were.

    These are newer checkpoints, which would otherwise count as the newest, and, if it was wished that the run begins
    anew, all its results: nothing in them counts any more, and they may be damaged in any way.
    """
    passed = [
        path
        for path in checkpoint.found(directory.path)
        if chosen is None or path.name > checkpoint.name(chosen.step)
    ]
    if wish.anew:  # after the checkpoints, which are worth nothing without them
        passed += directory.segments()
    for path in passed:
        path.rename(_free(path.with_name(path.name + ASIDE)))
    return [path.name for path in passed]


def end_killed(segments: list[dict[str, Any]], chosen: Checkpoint | None) -> None:
    """Say where the last part of a run ended that was killed, and what it took: by the checkpoint from which the next one
    goes on. What it computed after that does not count.
    """
    if segments and "to_step" not in segments[-1]:
        part = segments[-1]
        begun = part["from_step"]
        if chosen is None or chosen.step <= begun:
            part["to_step"] = begun  # and it took nothing that counts
        else:
            part["to_step"], (part["wall_s"], part["core_s"]) = chosen.step, chosen.spent


def _free(path: Path) -> Path:
    """`path`, or with the first number from 2 on that makes it the name of nothing: what was put aside stays."""
    numbered = (path.with_name(f"{path.name}{n}") for n in itertools.count(2))
    return next(name for name in itertools.chain([path], numbered) if not os.path.lexists(name))


def of_frames(old: Plan, new: Plan) -> list[str]:
    """What the user should know of an extension: it keeps the steps between frames, which were chosen for fewer steps."""
    if old.is_crowded or not new.is_crowded:
        return []
    apart, every = counted(new.every, "step"), thinned(new.steps)
    return [
        f"frames stay {apart} apart, as in the run so far: {new.frames + 1} of them to t = {new.until:g} s;"
        f" a new run with every = {every} has {new.steps // every + 1}"
    ]


def remarks(chosen: Checkpoint | None, wish: Wish) -> list[str]:
    """What the user should know of a choice that is possible."""
    if chosen is None:
        return [] if wish.anew else ["there is no checkpoint (yet); the run begins anew"]
    mine = checkpoint.build()
    if mine and chosen.build and mine != chosen.build:
        return [
            "Carom was built anew since the checkpoint was written; only the same build is sure to give the same bits"
        ]
    return []


def _judged(directory: RunDir, about: Mapping[str, Any], any_version: bool, path: Path) -> Checkpoint | str:
    """The checkpoint of a file, or what is wrong with it."""
    try:
        saved = checkpoint.load(path)
    except CaromError as error:
        return str(error)
    told = f"checkpoint {path} cannot be used: "
    if saved.scenario not in changes.identities(about):
        return told + "it belongs to another scenario"
    if saved.version != _core.__version__ and saved.version not in COMPATIBLE and not any_version:
        return (
            f"{told}it is of Carom {saved.version}, this is {_core.__version__}, and other versions may compute other"
            " bits (continue it with that version, or give --any-version)"
        )
    complaint = _missing(directory, saved.rows)
    return told + complaint if complaint else saved


def _missing(directory: RunDir, rows: Rows) -> str | None:
    """What of the results up to a checkpoint, at which the run had `rows`, is not there."""
    paths = directory.segments()
    if not paths and not any(rows):
        return None
    try:
        segments = Segments(paths, upto=rows)
        segments.verify()
        complaint = segments.lack()
        segments.close()
    except CaromError as error:
        return str(error)
    return complaint
