"""From a TOML file to the tree of tables, with every mistake in it at once."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from carom.errors import Problem, ScenarioError, nearest
from carom.scene.checks.rules import SECTIONS, Parts, check
from carom.scene.messages import Finding, Source, findings
from carom.scene.shipped import named
from carom.scene.tables import parameters
from carom.scene.tables.base import Table
from carom.scene.tables.model import REPEATED, SINGLE, Scenario, World
from carom.scene.tables.options import Run, RunBase

MOST_BYTES = 1 << 29
"""Largest scenario file that is read, 512 MiB."""


def read(
    path: str | Path, case: str | None = None, given: Mapping[str, Any] | None = None
) -> tuple[Scenario, Source]:
    """The scenario of a file. Raises `ScenarioError` for anything that is wrong with the file or in it.

    `case` and `given` (values by name) choose among its variants, see `carom.scene.tables.parameters`.
    """
    return parse(read_text(path), str(path), case, given, Path(path).absolute().parent)


def variants(path: str | Path) -> tuple[list[str], list[str]]:
    """Names of the parameters and of the cases of a file, which may be wrong in other ways."""
    return parameters.names(_toml(read_text(path), str(path)))


def cases(path: str | Path) -> list[str]:
    """Names of the cases of a file: one of them is what `Scene.from_toml(path, case=...)` takes."""
    return variants(path)[1]


def read_text(path: str | Path) -> str:
    """The text of a file, UTF-8; every reason why there is none becomes a `ScenarioError`."""
    name = str(path)

    def wrong(cause: str, cure: str) -> ScenarioError:
        return ScenarioError([Problem(name, "", cause, cure)])

    try:
        with open(path, "rb") as file:
            data = file.read(MOST_BYTES + 1)
    except FileNotFoundError:
        raise wrong("no such file", _files_beside(Path(path))) from None
    except IsADirectoryError:
        raise wrong("is a directory, not a scenario file", "name a .toml file in it") from None
    except PermissionError:
        raise wrong("may not be read", "change its permissions") from None
    except (OSError, ValueError) as e:  # ValueError: a null byte in the name
        raise wrong(f"cannot be read ({getattr(e, 'strerror', None) or e})", "check the path") from None
    if len(data) > MOST_BYTES:
        raise wrong(
            f"is larger than {MOST_BYTES >> 20} MiB", "use [[lattice]] or [[packing]] for many spheres"
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as e:
        line = data[: e.start].count(b"\n") + 1
        cause = f"is not UTF-8 text (byte {data[e.start]:#04x})"
        raise ScenarioError([Problem(name, "", cause, "save it as UTF-8", line)]) from None
    return text.replace("\r\n", "\n")


def _files_beside(path: Path) -> str:
    """A cure for a name that does not exist: the nearest scenario in the same directory, or the example of that name."""
    try:
        stems = [p.stem for p in path.parent.glob("*.toml")]
    except (OSError, ValueError):
        stems = []
    best = get_close_matches(path.stem, stems, n=1, cutoff=0.5)
    if path == Path("-"):
        return "the name of standard input is /dev/stdin"
    if best:
        return f"did you mean {path.parent / best[0]}.toml?"
    if example := named(path.as_posix()):
        return f"it comes with Carom: `carom examples copy {example[0]}` copies it to {example[0].rpartition('/')[2]}.toml"
    return "check the path"


def parse(
    text: str,
    name: str = "scenario text",
    case: str | None = None,
    given: Mapping[str, Any] | None = None,
    folder: Path | None = None,
) -> tuple[Scenario, Source]:
    """The scenario written in `text`; `name` is what messages call it. `case`, `given`: as in `read`. Files that it names
    lie in `folder`, by default in the present directory.
    """
    text = text.removeprefix("\ufeff")  # the mark of byte order, which some editors write
    raw = _toml(text, name)
    source = Source(name, text, dict(raw))  # with the tables that go now, for messages about them
    variant, formulas = parameters.substitute(raw, case, given)
    _find_files(raw, folder or Path.cwd())
    found, tree = formulas.found, None
    try:
        tree = Scenario.model_validate(raw)
    except ValidationError as e:
        invalid = [_hinted(f) for f in findings(e, Scenario, raw, {**SINGLE, **REPEATED})]
        invalid += _beyond(raw, invalid)
        found += [f for f in invalid if f.path not in formulas.damaged]
    if tree is None or found:
        raise ScenarioError(_problem(f, source) for f in found) from None
    source.case, source.parameters = variant.case, variant.values
    return tree, source


def _find_files(raw: Mapping[str, Any], folder: Path) -> None:
    """Make the names of files whole."""
    meshes = raw.get("mesh")
    for table in meshes if isinstance(meshes, list) else ():
        if isinstance(table, dict) and isinstance(table.get("file"), str):
            table["file"] = str(folder / table["file"])


def _problem(finding: Finding, source: Source) -> Problem:
    """A mistake with its place, be it in the file or in what the caller gave besides."""
    if finding.path[:1] == (parameters.GIVEN,):
        return Problem(source.name, " ".join(map(str, finding.path[1:])), finding.cause, finding.cure)
    return source.problem(finding)


def _hinted(finding: Finding) -> Finding:
    """The tables of `carom.scene.tables.parameters` are no keys of the scenario that it validates."""
    if len(finding.path) == 1 and finding.cause == "unknown key":
        best = nearest(str(finding.path[0]), parameters.SECTIONS)
        if best:
            header = "[parameters]" if best == "parameters" else "[[case]]"
            return replace(finding, cure=f"did you mean {header}?")
    return finding


MOST_PARTS = 1000
"""Most parts of a dotted key."""


def _toml(text: str, name: str) -> dict[str, Any]:
    if not text.strip():
        raise ScenarioError(
            [Problem(name, "", "is empty", "begin with one that works: `carom examples copy three_balls`", 1)]
        )
    if "\r" in text and "\n" not in text:
        cause = "its lines end in carriage returns alone (CR)"
        raise ScenarioError([Problem(name, "", cause, "save it with line ends LF or CR LF", 1)])
    for number, row in enumerate(text.split("\n"), 1):
        parts = 1 + row.partition("=")[0].count(".")
        if parts > MOST_PARTS:  # each part nests a table: memory and time grow with the square of them
            key = row.partition(".")[0].strip()
            cause = f"a key of {parts} parts"
            raise ScenarioError(
                [Problem(name, key, cause, "write the tables by their headers", number, row[:80])]
            )
    try:
        return tomllib.loads(text)
    except (
        ValueError,
        RecursionError,
    ) as e:  # ValueError: tomllib lets integers of thousands of digits through
        message = "values are nested too deeply" if isinstance(e, RecursionError) else str(e)
        at = re.search(r" \(at (?:line (\d+), column (\d+)|end of document)\)$", message)
        rows = text.split("\n")
        line = int(at[1]) if at and at[1] else len(rows) if at else 1
        if "int_max_str_digits" in message:  # Python's own limit, which knows no line
            longest = [max(map(len, re.findall(r"\d[\d_]*", row)), default=0) for row in rows]
            line = 1 + longest.index(max(longest))
            cause = f"a number of {max(longest)} digits"
            raise ScenarioError(
                [Problem(name, "", cause, "write one below 1e308, as 1.5e20", line, rows[line - 1])]
            ) from None
        if isinstance(e, RecursionError):
            line = 1 + max(range(len(rows)), key=lambda i: rows[i].count("[") + rows[i].count("{"))
        row = rows[line - 1] if line <= len(rows) else ""
        cause = f"is not TOML: {message[: at.start()] if at else message}"
        if at and at[2]:
            cause += f" at column {at[2]}"
        raise ScenarioError([Problem(name, "", cause, _syntax_cure(row, cause), line, row)]) from None


def _syntax_cure(row: str, cause: str) -> str:
    value = row.partition("=")[2].strip()
    if "overwrite" in cause or "more than once" in cause or "twice" in cause:
        return "a key or table may be given once; tables that repeat are written [[name]]"
    if re.match(r"[A-Za-z]", value):
        return f'put text and quantities in quotes: "{value.partition("#")[0].strip()}"'
    if re.match(r"[-+]?[\d.]+\s*[A-Za-z/]", value):
        return f'put a quantity with a unit in quotes: "{value.partition("#")[0].strip()}"'
    if re.match(r"[-+]?\.\d|[-+]?\d+\.(\D|$)", value):
        return "write digits on both sides of the point: 0.5, 1.0"
    if row.lstrip().startswith("["):
        return "write [name] or [[name]] on a line of its own"
    return 'write KEY = VALUE; text in quotes, lists in [ ], "#" before comments'


def _beyond(raw: Mapping[str, Any], found: list[Finding]) -> list[Finding]:
    """Mistakes between tables, looked for among the tables that could be read."""
    wrong = {f.path[:2] if len(f.path) > 1 and f.path[0] in REPEATED else f.path[:1] for f in found}
    entries: dict[str, list[tuple[int, Table]]] = {name: [] for name in SECTIONS}
    damaged = {str(path[0]) for path in wrong if path}
    broken: list[tuple[str, int, dict[str, Any]]] = []
    for name in SECTIONS:
        tables = raw.get(name, [])
        if (name,) in wrong or not isinstance(tables, list):
            continue
        for i, table in enumerate(tables):
            if (name, i) in wrong:
                broken += [(name, i, table)] if isinstance(table, dict) else []
            else:
                entries[name].append((i, REPEATED[name].model_validate(table)))
    run: RunBase | None = None
    if ("run",) not in wrong:
        run = Run.model_validate(raw.get("run", {}))
    world: World | None = None
    if ("world",) not in wrong:
        world = World.model_validate(raw.get("world", {}))
    materials = raw.get("material", [])
    lost = frozenset(
        t["name"]
        for t in (materials if isinstance(materials, list) else [])
        if isinstance(t, dict) and isinstance(t.get("name"), str)
    )
    if raw.get("packing"):  # its balls are not among these tables
        damaged.add("sphere")
    told = {f.path[:3] for f in found}
    whole = Parts(run, entries, frozenset(damaged), lost, world, broken=broken)
    return [f for f in check(whole) if f.path not in told]
