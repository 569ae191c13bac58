"""From what pydantic reports to what a person reads: cause, cure, and place in the file or the call."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import takewhile
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from carom.errors import Problem, ScenarioError, did_you_mean, nearest, quoted
from carom.scene.tables.fields import OURS, exactly_one
from carom.scene.toml.lines import LineMap, Path
from carom.scene.toml.literal import literal

ALTERNATIVES = (("mass", "density"), ("balls", "rows"))
NESTED = (("motion",), ("free",), ("region",))
"""Keys whose values are tables with keys worth naming in a message."""


@dataclass(frozen=True)
class Finding:
    """Something wrong with (or worth saying about) the value at `path` of the tree, before it is given a line."""

    path: Path
    cause: str
    cure: str
    call: str = ""
    """The cure for a scene that is built in Python, where it differs."""


class Source:
    """A scenario text and how messages call it; lines are looked up only when something is wrong.

    `case` and `parameters` say which of its variants was read, `study` the values of a study whose case it is.
    """

    def __init__(self, name: str, text: str, raw: Mapping[str, Any]) -> None:
        self.name, self.text, self.raw = name, text, raw
        self.case: str | None = None
        self.parameters: Mapping[str, float] = {}
        self.study: Mapping[str, float] = {}
        self._is_text = True
        self._map: LineMap | None = None

    @property
    def lines(self) -> LineMap:
        if self._map is None:
            self._map = LineMap(self.text)
        return self._map

    def varied(self, values: Mapping[str, float], *, is_text: bool) -> Source:
        """That of a case of a study, which has `values` of its own; not `is_text`: its numbers are no longer those here."""
        found = copy.copy(self)
        found.study, found._is_text = values, is_text
        return found

    def holds(self, path: Path) -> bool:
        """Whether the table that `path` leads into was in the text (tables may have been added since)."""
        if not self._is_text:
            return False
        if len(path) < 2 or not isinstance(path[1], int):
            return True
        entries = self.raw.get(str(path[0]))
        return isinstance(entries, list) and path[1] < len(entries)

    def problem(self, finding: Finding) -> Problem:
        line = self.lines.line(finding.path)
        key = call(finding.path, self.raw)
        return Problem(self.name, key, finding.cause, finding.cure, line, self.lines.source(line))


def call(path: Path, raw: Mapping[str, Any]) -> str:
    """How a message calls a key: `run.step`, `sphere "cue" radius`, `contact "ball"-"cloth" friction`."""
    if len(path) < 2 or not isinstance(path[1], int):
        return ".".join(map(str, path[:2]))
    section, index = str(path[0]), path[1]
    entries = raw.get(section)
    entry = entries[index] if isinstance(entries, list) and index < len(entries) else None
    known = entry if isinstance(entry, Mapping) else {}
    name = next((known[key] for key in ("name", "on", "body") if isinstance(known.get(key), str)), None)
    between = known.get("between")
    if name:
        title = quoted(name)
    elif isinstance(between, list | tuple) and len(between) == 2:
        title = "-".join(map(quoted, between))
    else:
        title = f"number {index + 1}"
    inner = takewhile(lambda key: isinstance(key, str), path[2:]) if path[2:3] in NESTED else path[2:3]
    return " ".join([section, title, ".".join(map(str, inner))]).rstrip()


def findings(
    error: ValidationError, root: type[BaseModel], raw: Any, tables: Mapping[str, type[BaseModel]]
) -> list[Finding]:
    """What pydantic found, in our words. `tables`: classes of the tables inside `root`, by name."""
    found: list[Finding] = []
    broken: dict[Path, type[BaseModel]] = {}
    for item in error.errors(include_url=False):
        path: Path = item["loc"]
        owner, table_path = _owner(path, root, tables)
        if item["type"] == OURS:
            context = item["ctx"]
            found.append(Finding((*path, *context["part"]), context["cause"], context["cure"]))
        else:
            found.append(_translated(item["type"], path, item.get("input"), owner, tables, item["msg"]))
        if len(path) > len(table_path):
            broken[table_path] = owner
    # pydantic applies rules about several keys only to tables without other errors; the commonest is
    # worth having at once
    for table_path, owner in broken.items():
        table = _at(raw, table_path)
        for pair in ALTERNATIVES:
            if isinstance(table, Mapping) and set(pair) <= set(owner.model_fields):
                try:
                    exactly_one(table, *pair)
                except PydanticCustomError as wrong:
                    told = wrong.context or {}
                    found.append(Finding(table_path, str(told["cause"]), str(told["cure"])))
    return found


def _owner(
    path: Path, root: type[BaseModel], tables: Mapping[str, type[BaseModel]]
) -> tuple[type[BaseModel], Path]:
    """The class of the table that holds the last key of `path`, and the path of that table."""
    owner, depth = root, 0
    if path and path[0] in tables:
        depth = 2 if len(path) > 1 and isinstance(path[1], int) else 1
        if len(path) == depth == 1:  # the table itself is missing
            return root, ()
        owner = tables[str(path[0])]
    while len(path) > depth + 1 and (inner := nested(owner, str(path[depth]))) is not None:
        owner, depth = inner, depth + 1
    return owner, path[:depth]


def nested(owner: type[BaseModel], key: str) -> type[BaseModel] | None:
    """The class of the table that stands at a key of another (`motion` of a wall), if one does."""
    field = owner.model_fields.get(key)
    kinds = (field.annotation, *get_args(field.annotation)) if field is not None else ()
    return next((kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)), None)


def _section(owner: type[BaseModel]) -> str:
    """The name of its table in a file; empty for the file itself, and for tables in other ones."""
    return getattr(owner, "section", "")


def _dotted(path: Path, owner: type[BaseModel]) -> str:
    """The key of a table of that class, or of the tables in it: `radius`, `motion.rotation.axis`."""
    keys: list[str] = []
    inside: type[BaseModel] | None = owner
    for key in path:
        if inside is None or isinstance(key, int):
            break
        keys.append(key)
        inside = nested(inside, key)
    return ".".join(keys)


def _at(raw: Any, path: Path) -> Any:
    for key in path:
        try:
            raw = raw[key]
        except (KeyError, IndexError, TypeError):
            return None
    return raw


def _translated(
    kind: str,
    path: Path,
    value: Any,
    owner: type[BaseModel],
    tables: Mapping[str, type[BaseModel]],
    message: str,
) -> Finding:
    key = str(path[-1]) if path else ""
    if kind == "missing":
        return Finding(path, "is missing", _how_to_write(key, owner))
    if kind == "extra_forbidden":
        if not _section(owner) and (best := _table(key, value, tables)):
            return Finding(path, "unknown key", f"did you mean {_header(best)}?")
        return Finding(path, "unknown key", _unknown(key, owner, tables))
    if kind == "list_type":
        if isinstance(value, Mapping):
            return Finding(
                path, f"expected any number of tables, found [{key}]", f"write [[{key}]], with two brackets"
            )
        return Finding(path, f"expected tables, found {quoted(value)}", f"write [[{key}]] and its keys below")
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        if path and _section(owner) and nested(owner, key) is not None:
            cure = f"write {key} = {_example(owner, key)}"
            return Finding(path, f"expected a table, found {quoted(value)}", cure)
        double = isinstance(path[-1], int) if path else False
        header = f"[[{path[0]}]]" if double else f"[{key}]"
        return Finding(path, f"expected a table, found {quoted(value)}", f"write {header} and its keys below")
    return Finding(
        path, message, "`carom schema` says what is allowed, `carom examples list` names files that work"
    )


def _how_to_write(key: str, owner: type[BaseModel]) -> str:
    """`add radius = "28.575 mm" (radius r, m)`; a missing table is written `[world]`."""
    field = owner.model_fields[key]
    if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
        inner = next(iter(field.annotation.model_fields))
        return f"add [{key}] and below it {inner} = {_example(field.annotation, inner)}"
    extra = field.json_schema_extra
    unit = extra.get("unit") if isinstance(extra, dict) else None
    return f"add {key} = {_example(owner, key)} ({field.description}{f', {unit}' if unit else ''})"


def _example(owner: type[BaseModel], key: str) -> str:
    field = owner.model_fields[key]
    return literal(field.examples[0]) if field.examples else "..."


FEW = 3
"""Tables that have a key, up to which a message names them."""


def _table(key: str, value: Any, tables: Mapping[str, type[BaseModel]]) -> str | None:
    """The table that is meant where one of this name is none; None where it is a single value."""
    several = isinstance(value, list) and len(value) > 0 and all(isinstance(v, Mapping) for v in value)
    return nearest(key, list(tables)) if several or isinstance(value, Mapping) else None


def _unknown(key: str, owner: type[BaseModel], tables: Mapping[str, type[BaseModel]]) -> str:
    """Where a key belongs: in a table of this one, in a few others; and what this one takes."""
    known, section = list(owner.model_fields), _section(owner)
    if key in ("format", "title") and section:
        return f"{key} belongs at the top of the file, before the first section"
    if section and (inner := [name for name in _inner(owner) if key in name.rpartition(".")[2].split("_")]):
        return f"did you mean {' or '.join(inner)}? (known: {', '.join(known)})"
    homes = [_header(name) for name, table in tables.items() if key in table.model_fields]
    if not 0 < len(homes) <= FEW:
        return did_you_mean(key, known)
    there = f"{key} belongs in {' or '.join(homes)}"
    return f"{there}; {_header(section)} has {', '.join(known)}" if section else there


def _inner(owner: type[BaseModel]) -> Iterator[str]:
    """The keys of tables in a table, as `motion.rotation.axis`."""
    for name in owner.model_fields:
        if (table := nested(owner, name)) is not None:
            for key in (*table.model_fields, *_inner(table)):
                yield f"{name}.{key}"


def _header(name: str) -> str:
    return f"[{name}]" if name in ("run", "record", "world") else f"[[{name}]]"


def from_python(
    error: ValidationError, table: type[BaseModel], label: str, given: Mapping[str, Any]
) -> ScenarioError:
    """The error of a call such as `Scene.sphere("cue", ...)`; keys are the names of its arguments."""
    problems = []
    for finding in findings(error, table, given, {}):
        key = _dotted(finding.path, table)
        problems.append(Problem(label, key, finding.cause, finding.cure))
    return ScenarioError(problems)
