"""The tables of the results page, made from `layout`: `python -m carom.record.reference` brings the page up to date.

The page (docs/reference/results.md) is prose around blocks that stand between two comments; a test compares the blocks.
"""

from __future__ import annotations

import re
from pathlib import Path

from carom.record.layout import MEANINGS

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "results.md"
_BLOCK = re.compile(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def filled(page: str) -> str:
    """The page with every block as the layout has it now."""
    return _BLOCK.sub(lambda m: m[1] + _table(m[2]) + m[3], page)


def _table(group: str) -> str:
    rows = [
        (key.partition("/")[2], meaning) for key, meaning in MEANINGS.items() if key.startswith(f"{group}/")
    ]
    lines = ["| column | unit | meaning |", "|---|---|---|"]
    lines += [f"| `{name}` | {'' if m.unit == '1' else m.unit} | {m.text} |" for name, m in rows]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
