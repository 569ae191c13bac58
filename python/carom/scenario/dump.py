"""From the tree to TOML text that reads back to the same tree, every float by its shortest exact form."""

from __future__ import annotations

import re

import tomli_w

from carom.scenario.model import REPEATED, SINGLE, Scenario

_SCALAR = r'(?:"(?:[^"\\\n]|\\.)*"|[-+0-9.eE]+|inf|nan)'
_ARRAY = re.compile(rf"\[\n((?:    {_SCALAR},\n)+)\]")


def to_text(tree: Scenario, *, everything: bool = False) -> str:
    """TOML. With `everything`, keys that were left at their defaults are written as well."""
    parts = [tomli_w.dumps({"format": tree.format, "title": tree.title})]
    for name in SINGLE:
        keys = getattr(tree, name).written(everything=everything)
        if keys:
            parts.append(f"[{name}]\n" + _flat(tomli_w.dumps(keys)))
    for name in REPEATED:
        for table in getattr(tree, name):
            parts.append(f"[[{name}]]\n" + _flat(tomli_w.dumps(table.written(everything=everything))))
    return "\n".join(parts)


def _flat(text: str) -> str:
    """Arrays on one line (the writer gives each number its own); strings hold no line breaks here."""
    return _ARRAY.sub(
        lambda m: "[" + ", ".join(row.strip().rstrip(",") for row in m[1].splitlines()) + "]", text
    )
