"""Attributes of a scene that nobody would read: what is said of them, and where the key belongs."""

from __future__ import annotations

from carom.errors import Problem, ScenarioError, did_you_mean
from carom.scene.tables.base import Table
from carom.scene.tables.model import Record, World
from carom.scene.tables.options import Run

TABLES: dict[str, type[Table]] = {"run": Run, "record": Record, "world": World}


def is_settable(scene: type, name: str) -> bool:
    """Whether objects of this class have a property of that name that can be set."""
    found = getattr(scene, name, None)
    return isinstance(found, property) and found.fset is not None


def refusal(scene: type, name: str) -> ScenarioError:
    """What is said of an attribute that cannot be set."""
    cause, cure = "unknown attribute", ""
    if (found := getattr(scene, name, None)) is not None:
        cause, cure = "cannot be set", "add to the scene what it shall have"
        if callable(found):
            cure = f"call scene.{name}(...)"
        elif name in TABLES:
            cure = f"set keys of it, as scene.{name}.{next(iter(TABLES[name].model_fields))}"
    elif (table := next((t for t, keys in TABLES.items() if name in keys.model_fields), None)) is not None:
        cure = f"write scene.{table}.{name}"
    else:
        cure = did_you_mean(name, [*(n for n in vars(scene) if is_settable(scene, n)), *TABLES])
    return ScenarioError([Problem("scene", name, cause, cure)])
