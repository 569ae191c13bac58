"""From the tree to TOML text that reads back to the same tree, every float by its shortest exact form."""

from __future__ import annotations

from carom.scene.tables.model import REPEATED, SINGLE, Scenario
from carom.scene.toml.literal import pairs


def to_text(tree: Scenario, *, everything: bool = False) -> str:
    """TOML. With `everything`, keys that were left at their defaults are written as well."""
    parts = ["\n".join(pairs({"format": tree.format, "title": tree.title}))]
    for name in SINGLE:
        table = getattr(tree, name)
        if table is not None and (keys := table.written(everything=everything)):
            parts.append("\n".join([f"[{name}]", *pairs(keys)]))
    for name in REPEATED:
        for table in getattr(tree, name):
            parts.append("\n".join([f"[[{name}]]", *pairs(table.written(everything=everything))]))
    return "\n\n".join(parts) + "\n"
