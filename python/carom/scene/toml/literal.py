"""A value as TOML on one line, every float by its shortest exact form."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import tomli_w


def literal(value: Any) -> str:
    """`value` (a number, text, or lists and tables of them) as it stands after `key = `.

    The library writes each element of a list on a line of its own and tables only under a header, which would tear laws
    and vectors apart; it still writes the text, whose escapes are the only difficulty.
    """
    if hasattr(value, "tolist"):  # arrays
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return tomli_w.dumps({"x": value})[len("x = ") : -1]
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)  # TOML has inf and nan
    if isinstance(value, Mapping):
        return "{ " + ", ".join(pairs(value)) + " }"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(literal, value))}]"
    return str(value)


def pairs(table: Mapping[str, Any]) -> list[str]:
    """The lines `key = value` of a table; its keys are bare words."""
    return [f"{key} = {literal(value)}" for key, value in table.items()]
