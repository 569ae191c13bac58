"""The messages about scenarios, as the source states them: what `docs/reference/errors.md` lists and the tests provoke.

A message is written where the mistake is found, as a cause and a cure; this module reads those places in the source of
`carom.scenario`. `python tests/error_catalogue.py` writes the list of the page anew.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "reference" / "errors.md"
BEGIN, END = "<!-- all messages -->", "<!-- end of all messages -->"
#: Calls that state a message, with the place of the cause among their arguments.
CALLS = {"Finding": 1, "refuse": 0, "wrong": 0, "Problem": 2, "formulas.refuse": 1, "self.refuse": 1}
FILL = "..."


@dataclass(frozen=True, order=True)
class Message:
    """Cause and cure with "..." where they name something."""

    cause: str
    cure: str

    def matches(self, told: str) -> bool:
        """Whether a printed message is this one."""
        return _pattern(self.cause).search(told) is not None and _pattern(self.cure).search(told) is not None


def _pattern(text: str) -> re.Pattern[str]:
    return re.compile(".*".join(map(re.escape, text.split(FILL))), re.DOTALL)


def messages() -> list[Message]:
    """Every message of the scenario format whose cause is written down in the source, sorted."""
    found = set()
    for path in sorted((ROOT / "python" / "carom" / "scenario").glob("*.py")):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(function, ast.FunctionDef):
                found |= set(_of(function))
    return sorted(found)


def _of(function: ast.FunctionDef) -> list[Message]:
    texts: dict[str, str] = {}
    found = []
    nodes = [node for node in ast.walk(function) if isinstance(node, ast.stmt | ast.expr)]
    for node in sorted(nodes, key=lambda node: (node.lineno, node.col_offset)):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            texts[node.targets[0].id] = _text(node.value, texts)
        elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            texts[node.target.id] = texts.get(node.target.id, FILL) + _text(node.value, texts)
        elif isinstance(node, ast.Call) and (name := _name(node.func)) in CALLS:
            at = CALLS[name]
            if len(node.args) > at + 1:
                cause, cure = (_text(arg, texts) for arg in node.args[at : at + 2])
                if re.search(r"[a-z]{3}", cause):  # more than what is found out elsewhere
                    found.append(Message(cause, cure))
    return found


def _name(function: ast.expr) -> str:
    if isinstance(function, ast.Attribute):
        owner = ast.unparse(function.value)
        return f"{owner.rpartition('.')[2]}.{function.attr}"
    return function.id if isinstance(function, ast.Name) else ""


def _text(node: ast.expr, texts: dict[str, str]) -> str:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        text = node.value
    elif isinstance(node, ast.JoinedStr):
        text = "".join(_text(part, texts) for part in node.values)
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        text = _text(node.left, texts) + _text(node.right, texts)
    elif isinstance(node, ast.Name):
        text = texts.get(node.id, FILL)
    else:
        text = FILL
    return re.sub(r"\.{4,}", FILL, text)


def table() -> str:
    """The list as it stands on the page."""
    rows = [f"| {_cell(m.cause)} | {_cell(m.cure)} |" for m in messages()]
    return "\n".join(["| message | cure |", "|---|---|", *rows])


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("[[", "\\[\\[") if text != FILL else "said with it"


def written() -> str:
    """The list that the page holds now."""
    page = PAGE.read_text(encoding="utf-8")
    return page.partition(BEGIN)[2].partition(END)[0].strip()


def main() -> None:
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(BEGIN)
    PAGE.write_text(f"{before}{BEGIN}\n\n{table()}\n\n{END}{rest.partition(END)[2]}", encoding="utf-8")


if __name__ == "__main__":
    main()
