"""The mark by which a scene, and every run of it, says that it is a table of the kit: `[billiard_table]`."""

from __future__ import annotations

import tomllib
from typing import Any

from carom.billiards.data import Spec
from carom.billiards.table import Table
from carom.errors import CaromError

HEADER = "[billiard_table]"


def table_of(result: Any) -> Table | None:
    """The table of the kit that a run was made on; None of any other run."""
    try:
        text = getattr(result, "scenario", None)
        if not isinstance(text, str) or HEADER not in text:
            return None  # the scenario of many spheres takes long to parse
        return Table(Spec(**tomllib.loads(text)["billiard_table"]))
    except (ValueError, KeyError, TypeError, RecursionError, CaromError):
        return None  # a lost or damaged copy of the scenario does not keep the motion from being seen
