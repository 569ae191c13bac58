"""The messages about scenarios and contact problems, as the source states them: `docs/reference/errors.md` lists them, and
the tests provoke them.

A message is written where the mistake is found, as a cause and a cure; this module reads those places in the source of
`carom.scene`, `carom.problem` and `carom solve`. `python tests/error_catalogue.py` writes the lists of the page anew.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "reference" / "errors.md"
PACKAGE = ROOT / "python" / "carom"
SCENE = (".", "assembly", "builders", "checks", "tables", "toml")
#: Calls that state a message, with the place of the cause among their arguments.
CALLS = {"Finding": 1, "refuse": 0, "wrong": 0, "Problem": 2, "formulas.refuse": 1, "self.refuse": 1}
#: The same about contact problems.
PROBLEM_CALLS = {"refuse": 1}
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
    found = _stated(
        [f for part in SCENE for f in sorted((PACKAGE / "scene" / part).glob("*.py")) if f.stem != "scene"],
        CALLS,
    )
    # More than what is found out elsewhere.
    return sorted(m for m in found if re.search(r"[a-z]{3}", m.cause))


def problem_messages() -> list[Message]:
    """The same about contact problems; some have no more to say of the cause than the value that stands there."""
    paths = [*sorted((PACKAGE / "problem").glob("*.py")), PACKAGE / "cli" / "solve.py"]
    return sorted(m for m in _stated(paths, PROBLEM_CALLS) if re.search(r"[a-z]{3}", m.cause + m.cure))


def _stated(paths: list[Path], calls: dict[str, int]) -> set[Message]:
    found = set()
    for path in paths:
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(function, ast.FunctionDef):
                found |= set(_of(function, calls))
    return found


def _of(function: ast.FunctionDef, calls: dict[str, int]) -> list[Message]:
    texts: dict[str, str] = {}
    found = []
    nodes = [node for node in ast.walk(function) if isinstance(node, ast.stmt | ast.expr)]
    for node in sorted(nodes, key=lambda node: (node.lineno, node.col_offset)):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            texts[node.targets[0].id] = _text(node.value, texts)
        elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            texts[node.target.id] = texts.get(node.target.id, FILL) + _text(node.value, texts)
        elif isinstance(node, ast.Call) and (name := _name(node.func)) in calls:
            at = calls[name]
            if len(node.args) > at + 1:
                cause, cure = (_text(arg, texts) for arg in node.args[at : at + 2])
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


#: The lists of the page by the words of their marks.
LISTS = {"messages": messages, "messages about contact problems": problem_messages}


def table(name: str) -> str:
    """A list as it stands on the page."""
    rows = [f"| {_cell(m.cause)} | {_cell(m.cure)} |" for m in LISTS[name]()]
    return "\n".join(["| message | cure |", "|---|---|", *rows])


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("[[", "\\[\\[") if text != FILL else "said with it"


def _marks(name: str) -> tuple[str, str]:
    return f"<!-- all {name} -->", f"<!-- end of all {name} -->"


def written(name: str) -> str:
    """A list that the page holds now."""
    begin, end = _marks(name)
    return PAGE.read_text(encoding="utf-8").partition(begin)[2].partition(end)[0].strip()


def main() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for name in LISTS:
        begin, end = _marks(name)
        before, _, rest = page.partition(begin)
        page = f"{before}{begin}\n\n{table(name)}\n\n{end}{rest.partition(end)[2]}"
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
