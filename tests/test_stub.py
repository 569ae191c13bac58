"""The type stub of the compiled core tells what is there: the same names, the same parameters."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import carom
from carom import _core

STUB = ast.parse((Path(carom.__file__).parent / "_core.pyi").read_text(encoding="utf-8"))
#: Names that exist for type checkers only.
TYPES = {"Block", "F64", "I64", "U64"}


def declared() -> dict[str, ast.stmt]:
    found: dict[str, ast.stmt] = {}
    for node in STUB.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found[node.name] = node
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found[node.target.id] = node
    return {name: node for name, node in found.items() if name not in TYPES}


def parameters(node: ast.FunctionDef) -> list[str]:
    return [argument.arg for argument in node.args.posonlyargs + node.args.args]


def test_the_stub_names_all_that_is_public_and_nothing_else() -> None:
    public = {name for name in dir(_core) if not name.startswith("_")} | {"__version__"}
    assert set(declared()) == public


def test_functions_have_the_parameters_of_the_stub() -> None:
    functions = [node for node in declared().values() if isinstance(node, ast.FunctionDef)]
    assert len(functions) >= 6
    for node in functions:
        real = inspect.signature(getattr(_core, node.name)).parameters
        assert parameters(node) == list(real), node.name


def test_classes_have_the_methods_of_the_stub() -> None:
    classes = [node for node in declared().values() if isinstance(node, ast.ClassDef)]
    for node in classes:
        real = getattr(_core, node.name)
        methods = [part for part in node.body if isinstance(part, ast.FunctionDef)]
        names = {part.name for part in methods} - {"__init__"}
        assert names == {name for name in vars(real) if not name.startswith("_")}, node.name
        for part in methods:
            properties = {getattr(decorator, "id", "") for decorator in part.decorator_list}
            if part.name != "__init__" and "property" not in properties:
                assert parameters(part) == list(inspect.signature(getattr(real, part.name)).parameters), (
                    part.name
                )
