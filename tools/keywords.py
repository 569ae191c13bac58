"""Write python/carom/scene/tables/keywords.py: the keys of [run] and [record] as a typed dictionary.

python tools/keywords.py [--check]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from carom import _core
from carom.scene.tables.fields import Quantity
from carom.scene.tables.model import Record
from carom.scene.tables.options import Run

FILE = Path(__file__).parent.parent / "python/carom/scene/tables/keywords.py"
HEAD = '''"""The keys of `[run]` and `[record]` as keywords of `carom.simulate`. Written by tools/keywords.py."""

from __future__ import annotations

from typing import Literal, TypedDict


class Options(TypedDict, total=False):
    """Quantities are numbers in SI, or texts with a unit; `docs/reference/scenario.md` says what each key means."""

'''


def kind(name: str, field: Any) -> str:
    """The annotation of a key."""
    if name in _core.choices():
        words = [f'"{choice}"' for choice in _core.choices()[name]]
        short = f"Literal[{', '.join(words)}]"
        return (
            short
            if len(short) < 80
            else "\n        ".join(["Literal[", *(f"{w}," for w in words)]) + "\n    ]"
        )
    said = f"{field.annotation} {field.metadata}"
    found = [word for word in ("bool", "int", "float", "str") if word in str(field.annotation)]
    if Quantity.__name__ in said:
        found.append("str")
    if "Optional" in said:
        found.append("None")
    return " | ".join(found)


def text() -> str:
    """The whole file."""
    lines = [
        f"    {name}: {kind(name, field)}\n"
        for table in (Run, Record)
        for name, field in table.model_fields.items()
    ]
    return HEAD + "".join(lines)


if __name__ == "__main__":
    if "--check" not in sys.argv:
        FILE.write_text(text(), encoding="utf-8")
    elif FILE.read_text(encoding="utf-8") != text():
        sys.exit(f"{FILE} is not what tools/keywords.py writes; run it")
