"""The scanner finds the line of every key of every TOML text that `tomllib` reads."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from carom.scene.toml.lines import LineMap
from hypothesis import given
from hypothesis import strategies as st

TEXT = '''\
# comment with [brackets] and = signs
top = "x # not a comment" # comment
a.b."c d" = 1

[run]                 # header
until = 3.0
long = """
[not.a.header]
key = 1 \\
""""
literal = \'\'\'
[[no]]
\'\'\'
when = 1979-05-27 07:32:00

[ "quoted key" . 'other' ]
x = { y = 1, z.w = [1, 2], "k" = {} }

[[sphere]]
name = "one"
position = [
    0.0,  # x, with ] in a comment
    "1 m",

    2.0,
]
[[sphere]]
name = "two"
[sphere.sub]
deep = true
[[sphere.items]]
q = 1
[[sphere.items]]
q = 2
[[sphere]]
inline = [ { a = 1 }, { a = 2,
} ] # not TOML 1.0, so removed below
last = "\\u0041 \\" quoted"
'''.replace("{ a = 2,\n}", "\n{ a = 2 }")


@pytest.mark.parametrize(
    ("path", "row"),
    [
        (("top",), "top ="),
        (("a",), "a.b."),
        (("a", "b", "c d"), "a.b."),
        (("run",), "[run]"),
        (("run", "until"), "until"),
        (("run", "long"), "long"),
        (("run", "literal"), "literal"),
        (("run", "when"), "when"),
        (("quoted key", "other"), "[ "),
        (("quoted key", "other", "x", "z", "w"), "x = {"),
        (("sphere", 0), "[[sphere]]"),
        (("sphere", 0, "name"), 'name = "one"'),
        (("sphere", 0, "position"), "position = ["),
        (("sphere", 0, "position", 1), '    "1 m"'),
        (("sphere", 0, "position", 2), "    2.0,"),
        (("sphere", 1, "name"), 'name = "two"'),
        (("sphere", 1, "sub", "deep"), "deep"),
        (("sphere", 1, "items", 1, "q"), "q = 2"),
        (("sphere", 2, "inline", 1, "a"), "{ a = 2 }"),
        (("sphere", 2, "last"), "last"),
        (("sphere", 1, "missing"), "[[sphere]]"),
        (("nowhere", "missing"), "# comment"),
    ],
)
def test_lines_of_a_text_with_everything(path: tuple[str | int, ...], row: str) -> None:
    tomllib.loads(TEXT)
    lines = LineMap(TEXT)
    assert lines.source(lines.line(path)).startswith(row)


def test_second_table_of_the_same_name_has_its_own_line() -> None:
    lines = LineMap(TEXT)
    assert lines.line(("sphere", 0)) < lines.line(("sphere", 0, "position", 2)) < lines.line(("sphere", 1))


def paths(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if path:
        yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from paths(inner, (*path, key))


KEYS = st.text(min_size=0, max_size=4) | st.sampled_from(["a", "b", "sphere", "[x]", "a.b", "=", "#"])
SCALARS = (
    st.integers(-9, 9)
    | st.booleans()
    | st.text(max_size=8)
    | st.floats(allow_nan=False)
    | st.dates()
    | st.datetimes()
)
VALUES = st.recursive(
    SCALARS, lambda v: st.lists(v, max_size=3) | st.dictionaries(KEYS, v, max_size=3), max_leaves=12
)


@given(st.dictionaries(KEYS, VALUES, max_size=5), st.booleans())
def test_every_path_of_any_document_is_found(document: dict[str, Any], multiline: bool) -> None:
    text = tomli_w.dumps(document, multiline_strings=multiline)
    found = LineMap(text).paths()
    for path in paths(tomllib.loads(text)):
        assert path in found
        row = text.split("\n")[found[path] - 1]
        assert row.strip()


@pytest.mark.parametrize(
    "path", sorted((Path(__file__).parent.parent / "scenarios").rglob("*.toml")), ids=lambda p: p.stem
)
def test_shipped_scenarios_are_scanned_whole(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    lines = LineMap(text)
    for place in paths(tomllib.loads(text)):
        row = lines.source(lines.line(place))
        key = next(k for k in reversed(place) if isinstance(k, str))
        # An element of an array has a line of its own where it begins one.
        assert key in row or (isinstance(place[-1], int) and row.strip())


@given(st.text(max_size=60))
def test_text_that_is_not_toml_does_no_harm(text: str) -> None:
    LineMap(text).line(("a", 0, "b"))
