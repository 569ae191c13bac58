"""Circles of imports in the Rust crates and in the Python package, with the names that tie them, and types of a crate that
share a name.

    python tools/circles.py [CRATE or carom ...]

A file of Rust imports another one if it names an item that the other one defines, by `use` or by a path in its code. Names
that a module only passes on (`pub use`) count for the file that defines them. Code of tests does not count. A file of Python
imports what an `import` names, also one inside a function; only those for types do not count.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CRATES, PACKAGE = ROOT / "crates", ROOT / "python" / "carom"
Module = tuple[str, ...]

COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\])*\"", re.S)
TESTS = re.compile(
    r"#\[cfg\(test\)\]\s*(?:pub(?:\([^)]*\))?\s+)?(?:mod \w+\s*\{.*?^\}|mod \w+;)", re.S | re.M
)
ITEM = re.compile(
    r"^(?:pub(?:\([^)]*\))?\s+)?(?:unsafe |const |async )*"
    r"(?:fn|struct|enum|trait|type|const|static|union|macro_rules!)\s+(\w+)",
    re.M,
)
TYPE = re.compile(r"^(?:pub(?:\([^)]*\))?\s+)?(?:unsafe )?(?:struct|enum|trait|type|union)\s+(\w+)", re.M)
USE = re.compile(r"^(pub(?:\([^)]*\))?\s+)?use\s+([^;]+);", re.M)
MOD = re.compile(r"^\s*(?:pub(?:\([^)]*\))?\s+)?mod \w+;", re.M)
PATH = re.compile(r"\b((?:crate|super|self)(?:::\w+)+)")


def leaves(tree: str) -> list[tuple[list[str], str]]:
    """The paths of a `use` tree, each with the name under which it is known."""
    tree = " ".join(tree.split())
    if (brace := tree.find("{")) < 0:
        path, _, alias = tree.partition(" as ")
        parts = path.strip().split("::")
        if parts[-1] == "self" and len(parts) > 1:
            parts.pop()
        return [(parts, alias.strip() or parts[-1])]
    head = [part for part in tree[:brace].strip().split("::") if part]
    inner, depth, start, found = tree[brace + 1 : tree.rfind("}")], 0, 0, []
    for k, letter in enumerate(inner + ","):
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            if part := inner[start:k].strip():
                found += [([*head, *rest] if rest != ["self"] else head, name) for rest, name in leaves(part)]
            start = k + 1
    return found


class Crate:
    """The modules of a crate, what each defines and passes on."""

    def __init__(self, source: Path) -> None:
        self.files: dict[Module, Path] = {}
        self.text: dict[Module, str] = {}
        for path in sorted(source.rglob("*.rs")):
            parts = path.relative_to(source).with_suffix("").parts
            module = () if parts == ("lib",) else parts[:-1] if parts[-1] == "mod" else parts
            text = TESTS.sub("", COMMENT.sub("", path.read_text(encoding="utf-8")))
            if "tests" not in parts:
                self.files[module], self.text[module] = path.relative_to(source), text
        self.items = {module: set(ITEM.findall(text)) for module, text in self.text.items()}
        self.passed: dict[Module, dict[str, list[str]]] = {}
        for module, text in self.text.items():
            self.passed[module] = {n: p for _, tree in USE.findall(text) for p, n in leaves(tree) if n != "*"}

    def namesakes(self) -> dict[str, list[Path]]:
        """Names that several types of the crate have, with the files that define them."""
        of: dict[str, list[Path]] = defaultdict(list)
        for module, text in self.text.items():
            for name in TYPE.findall(text):
                of[name].append(self.files[module])
        return {name: files for name, files in of.items() if len(files) > 1}

    def defining(self, module: Module, path: list[str], depth: int = 0) -> Module | None:
        """The module that defines what `path` names in `module`; None if it is of another crate."""
        at, names = module, list(path)
        if names[0] == "crate":
            at = ()
        elif names[0] not in ("self", "super"):
            if (*module, names[0]) not in self.text and names[0] not in self.passed[module]:
                return None
            names.insert(0, "self")
        while names and names[0] in ("crate", "self", "super"):
            at = at[:-1] if names.pop(0) == "super" else at
        while names and (*at, names[0]) in self.text:
            at = (*at, names.pop(0))
        if (
            names
            and names[0] not in self.items.get(at, set())
            and names[0] in self.passed.get(at, {})
            and depth < 9
        ):
            further = self.passed[at][names[0]]
            if at != module or further != path:
                return self.defining(at, further, depth + 1)
        return at

    def imports(self) -> dict[Module, dict[Module, set[str]]]:
        """For each module the modules that it takes names from."""
        arrows: dict[Module, dict[Module, set[str]]] = defaultdict(lambda: defaultdict(set))
        for module, text in self.text.items():
            body = MOD.sub("", USE.sub("", text))
            used = [path for _, tree in USE.findall(text) for path, _ in leaves(tree)]
            used += [path.split("::") for path in PATH.findall(body)]
            passed_on = {tuple(p) for public, tree in USE.findall(text) if public for p, _ in leaves(tree)}
            for path in used:
                other = self.defining(module, path)
                # A module that passes on what its own parts define is their shop window, and does not depend on them.
                window = tuple(path) in passed_on and not re.search(rf"\b{path[-1]}\b", body)
                if other is not None and other != module and not window:
                    arrows[module][other].add(path[-1])
        return arrows


class Package:
    """The modules of the Python package."""

    def __init__(self) -> None:
        self.files: dict[Module, Path] = {}
        self.trees: dict[Module, ast.Module] = {}
        for path in sorted(PACKAGE.rglob("*.py")):
            parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
            module = parts[:-1] if parts[-1] == "__init__" else parts
            self.files[module] = path.relative_to(PACKAGE)
            self.trees[module] = ast.parse(path.read_text(encoding="utf-8"))

    def namesakes(self) -> dict[str, list[Path]]:
        """Not asked of Python, where a class is called with its module."""
        return {}

    def imports(self) -> dict[Module, dict[Module, set[str]]]:
        """For each module the modules that it takes names from."""
        arrows: dict[Module, dict[Module, set[str]]] = defaultdict(lambda: defaultdict(set))
        for module, tree in self.trees.items():
            for statement in _when_run(tree):
                for name in statement.names:
                    path = (
                        name.name if isinstance(statement, ast.Import) else f"{statement.module}.{name.name}"
                    )
                    parts = tuple(path.split("."))
                    other = parts if parts in self.files else parts[:-1]
                    # A module is loaded after the packages that it lies in.
                    for k in range(1, len(other) + 1):
                        if other[:k] in self.files and module[:k] != other[:k]:
                            arrows[module][other[:k]].add(parts[-1])
        return arrows


def _when_run(node: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """The imports below a node, but for those that only a checker of types sees."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child
        elif not (isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"):
            yield from _when_run(child)


def circles(arrows: dict[Module, dict[Module, set[str]]]) -> list[set[Module]]:
    """Sets of modules each of which reaches all others (strongly connected components of two or more)."""
    index: dict[Module, int] = {}
    low: dict[Module, int] = {}
    stack: list[Module] = []
    found = []

    def visit(module: Module) -> None:
        index[module] = low[module] = len(index)
        stack.append(module)
        for other in arrows.get(module, {}):
            if other not in index:
                visit(other)
                low[module] = min(low[module], low[other])
            elif other in stack:
                low[module] = min(low[module], index[other])
        if low[module] == index[module]:
            part = set()
            while module not in part:
                part.add(stack.pop())
            if len(part) > 1:
                found.append(part)

    for module in list(arrows):
        if module not in index:
            visit(module)
    return found


def shortest(arrows: dict[Module, dict[Module, set[str]]], part: set[Module]) -> list[Module]:
    """The shortest way round in a circle."""
    best: list[Module] = []
    for start in part:
        before: dict[Module, Module] = {}
        queue = [start]
        while queue and start not in before:
            at = queue.pop(0)
            for other in arrows[at]:
                if other in part and other not in before:
                    before[other] = at
                    queue.append(other)
        way = [start]
        while (at := before[way[-1]]) != start:
            way.append(at)
        way = [start, *reversed(way[1:])]
        if not best or len(way) < len(best):
            best = way
    return best


def main() -> int:
    """The command."""
    count = namesakes = 0
    shelves: dict[str, Crate | Package] = {s.parent.name: Crate(s) for s in sorted(CRATES.glob("*/src"))}
    for shelf, crate in {**shelves, PACKAGE.name: Package()}.items():
        if sys.argv[1:] and shelf not in sys.argv[1:]:
            continue
        for name, files in sorted(crate.namesakes().items()):
            namesakes += 1
            print(f"{shelf}: several types are named {name}: {', '.join(map(str, files))}")
        arrows = crate.imports()
        for part in circles(arrows):
            count += 1
            way = shortest(arrows, part)
            print(f"{shelf}: a circle of {len(part)} files; the shortest way round in it:")
            for at, other in zip(way, [*way[1:], way[0]]):
                print(
                    f"    {crate.files[at]} takes {', '.join(sorted(arrows[at][other]))} from {crate.files[other]}"
                )
            if "-v" in sys.argv or len(sys.argv) > 1:
                for at in sorted(part):
                    for other in sorted(part & arrows[at].keys()):
                        print(
                            f"      {crate.files[at]} -> {crate.files[other]}: {', '.join(sorted(arrows[at][other]))}"
                        )
    print(f"{count} circles of imports, {namesakes} names of several types")
    return 1 if count + namesakes else 0


if __name__ == "__main__":
    sys.exit(main())
