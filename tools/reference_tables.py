"""Writes the tables of the pages scenario.md, packings.md and results.md in docs/reference, and of guides/choose.md.

    python tools/reference_tables.py [--check]

The pages are prose around blocks that stand between two comments. `--check` compares and writes nothing.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

from carom import _core
from carom.result.record.layout import MEANINGS
from carom.scene.tables.base import Table
from carom.scene.tables.impact_laws import LAWS
from carom.scene.tables.model import NESTED, REPEATED, SINGLE, Scenario
from carom.units import DIMENSIONS, UNITS

PAGES = Path(__file__).resolve().parents[1] / "docs" / "reference"
_BLOCK = re.compile(r"(<!-- table (\w+) -->\n?).*?(<!-- end -->)", re.DOTALL)


def block(name: str) -> str:
    """The table of a section, of the keys at the top (`top`) or of the units (`units`); the names of the `functions`."""
    if name == "functions":
        return ", ".join(f"`{function}`" for function in _core.Expression.functions())
    if name == "units":
        return _units()
    if name == "impact_laws":
        return _impact_laws()
    if name == "top":
        return _table(
            {key: f for key, f in Scenario.model_fields.items() if key not in {**SINGLE, **REPEATED}},
            Scenario,
        )
    owner = {**SINGLE, **REPEATED, **NESTED}[name]
    return _table(owner.model_fields, owner)


def _table(fields: dict[str, Any], owner: type[Table]) -> str:
    rows = ["| key | unit | default | meaning |", "|---|---|---|---|"]
    for key, field in fields.items():
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        unit = str(extra.get("unit", "")).replace("^2", "²").replace("^3", "³")
        rows.append(f"| `{key}` | {unit} | {_default(key, field, owner)} | {_meaning(key, field, owner)} |")
    return "\n".join(rows) + "\n"


def _default(key: str, field: Any, owner: type[Table]) -> str:
    if (owner.section, key) == ("run", "until") or field.is_required():
        return "required"
    default = field.get_default(call_default_factory=True)
    if default is None:
        return ""
    return f"`{json.dumps(default)}`" if default != "" else "empty"


def _meaning(key: str, field: Any, owner: type[Table]) -> str:
    text = str(field.description)
    admitted = _core.choices().get(key) if owner is SINGLE["run"] else None
    if admitted:
        text += ". One of " + ", ".join(f"`{value}`" for value in admitted)
    return text.replace("|", "\\|")


def _units() -> str:
    rows = ["| quantity | SI | units on their own |", "|---|---|---|"]
    for name, (exponents, si, _) in DIMENSIONS.items():
        if si:
            own = ", ".join(f"`{unit}`" for unit, row in UNITS.items() if row[2] == exponents)
            rows.append(f"| {name} | `{si}` | {own} |")
    return "\n".join(rows) + "\n"


def _impact_laws() -> str:
    rows = ["| `impact` | what it does | take it | energy |", "|---|---|---|---|"]
    for name, law in LAWS.items():
        energy = "never rises" if law.energy else "can rise"
        default = " (default)" if name == _core.defaults()["impact"] else ""
        rows.append(f"| `{name}`{default} | {law.summary} | {law.advice} | {energy} |")
    return "\n".join(rows) + "\n"


def with_all_sections(page: str) -> str:
    """The page with an empty section at its end for each table of the format that it lacks."""
    missing = [name for name in (*SINGLE, *REPEATED) if f"<!-- table {name} -->" not in page]
    return page + "".join(f"\n## `{name}`\n\n<!-- table {name} -->\n<!-- end -->\n" for name in missing)


def columns(group: str) -> str:
    """The columns of a group of `results.h5`."""
    rows = ["| column | unit | meaning |", "|---|---|---|"]
    for key, meaning in MEANINGS.items():
        if key.startswith(f"{group}/"):
            unit = "" if meaning.unit == "1" else meaning.unit
            rows.append(f"| `{key.partition('/')[2]}` | {unit} | {meaning.text} |")
    return "\n".join(rows) + "\n"


_PAGES = (
    ("scenario.md", block),
    ("packings.md", block),
    ("results.md", columns),
    ("../guides/choose.md", block),
)


def main() -> int:
    """The command."""
    for name, table in _PAGES:
        page = (PAGES / name).read_text(encoding="utf-8")
        text = with_all_sections(page) if name == "scenario.md" else page
        text = _BLOCK.sub(lambda m, table=table: m[1] + table(m[2]) + m[3], text)
        if "--check" not in sys.argv:
            (PAGES / name).write_text(text, encoding="utf-8")
        elif text != page:
            print(f"docs/reference/{name} is not up to date: run tools/reference_tables.py", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
