"""The mark by which a scene, and every run of it, says that it is a table of the kit: `[billiard_table]`."""

from __future__ import annotations

from typing import Any

from carom.errors import CaromError
from carom.scene.billiards.data import Spec
from carom.scene.billiards.shots import Shot, struck
from carom.scene.billiards.table import Table


def table_of(result: Any) -> Table | None:
    """The table of the kit that a run was made on; None of any other run."""
    try:
        return table_in(result.scene)
    except CaromError:
        return None  # a lost or damaged copy of the scenario does not keep the motion from being seen


def shots_of(result: Any) -> list[Shot]:
    """The shots of a run on a table of the kit: one for each ball that moves at the start."""
    table = table_of(result)
    if table is None:
        raise CaromError(
            "shots: the run is not on a table of carom.billiards; its hits are in result.impacts"
        )
    return [table.shot(result, name) for name in struck(result)]


def table_in(scene: Any) -> Table | None:
    """The table of the kit that a scene is; None of any other scene."""
    mark = scene.billiard_table
    return None if mark is None else Table(Spec(**mark.written(everything=True)))
