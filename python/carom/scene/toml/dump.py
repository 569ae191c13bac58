"""From the tree to TOML text that reads back to the same tree, every float by its shortest exact form."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from carom.scene.tables.model import REPEATED, SINGLE, Scenario
from carom.scene.toml.literal import pairs


def to_text(tree: Scenario, *, everything: bool = False, folder: Path | None = None) -> str:
    """TOML. With `everything`, keys that were left at their defaults are written as well. The text will lie in `folder`:
    files have the names that lead to them from there, without a folder those from the root on.
    """
    parts = ["\n".join(pairs({"format": tree.format, "title": tree.title}))]
    for name in SINGLE:
        table = getattr(tree, name)
        if table is not None and (keys := table.written(everything=everything)):
            parts.append("\n".join([f"[{name}]", *pairs(keys)]))
    for name in REPEATED:
        for table in getattr(tree, name):
            keys = _seen_from(folder, table.written(everything=everything))
            parts.append("\n".join([f"[[{name}]]", *pairs(keys)]))
    return "\n\n".join(parts) + "\n"


def _seen_from(folder: Path | None, keys: dict[str, Any]) -> dict[str, Any]:
    """Keys of a table with the name that its file has from a folder on."""
    if "file" not in keys:
        return keys
    place, name = os.path.split(keys["file"])
    file = os.path.join(os.path.realpath(place), name)  # ".." counts from where links lead
    if folder is not None:
        with suppress(ValueError):  # on another drive
            file = Path(os.path.relpath(file, os.path.realpath(folder))).as_posix()
    return {**keys, "file": file}
