"""Where each key of a TOML file stands: a map from the path of a value to its line.

`tomllib` gives values without positions, so the text is read a second time, only when a message needs a line.
The text is known to be valid TOML; this scanner finds names and skips values. Paths are those of the parsed
dictionary: `("sphere", 0, "radius")` is `radius` in the first `[[sphere]]`, `("sphere", 0)` its header,
`(..., "position", 2)` the third element of an array.
"""

from __future__ import annotations

import re
import tomllib
from contextlib import suppress

Path = tuple[str | int, ...]

_BLANK = re.compile(r"[ \t]*")
_FILL = re.compile(r"(?:[ \t\r\n]+|#[^\n]*)*")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_BASIC = re.compile(r'"(?:[^"\\\n]|\\.)*"')
_LITERAL = re.compile(r"'[^'\n]*'")
_LONG_BASIC = re.compile(r'"""(?:[^\\]|\\.)*?"{3,5}', re.DOTALL)
_LONG_LITERAL = re.compile(r"'''.*?'{3,5}", re.DOTALL)
_PLAIN = re.compile(r"[^,\]}#\n]+")  # numbers, booleans and dates, which may contain a blank


class LineMap:
    """Lines (from 1) of the keys, tables and array elements of one text."""

    def __init__(self, text: str) -> None:
        self.rows = text.split("\n")
        self._lines: dict[Path, int] = {}
        with suppress(ValueError, RecursionError, IndexError):  # better a message without its exact line
            self._lines = _Scanner(text).scan()

    def line(self, path: Path) -> int:
        """The line of `path`, or of the nearest table around it that is written down (a missing key: its table)."""
        while path:
            if path in self._lines:
                return self._lines[path]
            path = path[:-1]
        return 1

    def source(self, line: int) -> str:
        """Text of a line."""
        return self.rows[line - 1].rstrip("\r") if 0 < line <= len(self.rows) else ""

    def paths(self) -> dict[Path, int]:
        """All positions."""
        return self._lines


class _Scanner:
    def __init__(self, text: str) -> None:
        self.text = text
        self.position = 0
        self.line = 1
        self.lines: dict[Path, int] = {}
        self.counts: dict[Path, int] = {}  # elements of each array of tables so far

    def scan(self) -> dict[Path, int]:
        table: Path = ()
        self.skip(_FILL)
        while self.position < len(self.text):
            if self.text[self.position] == "[":
                table = self.header()
            else:
                self.key_value(table)
            self.skip(_FILL)
        return self.lines

    def skip(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self.text, self.position)
        if match is None:
            raise ValueError(f"not understood at line {self.line}")
        self.position = match.end()
        self.line += match[0].count("\n")
        return match[0]

    def header(self) -> Path:
        repeated = self.text.startswith("[[", self.position)
        self.position += 2 if repeated else 1
        line = self.line
        *outer, last = self.keys()
        self.position += 2 if repeated else 1
        path: Path = ()
        for key in outer:
            self.lines.setdefault((*path, key), line)
            path = self.latest((*path, key))
        path = (*path, last)
        if repeated:
            self.lines.setdefault(path, line)
            self.counts[path] = self.counts.get(path, 0) + 1
        path = self.latest(path)
        self.lines[path] = line
        return path

    def latest(self, path: Path) -> Path:
        """A header below an array of tables means the last of its tables."""
        return (*path, self.counts[path] - 1) if path in self.counts else path

    def keys(self) -> list[str]:
        found = []
        while True:
            self.skip(_BLANK)
            quote = self.text[self.position]
            if quote == '"':
                found.append(str(tomllib.loads("key = " + self.skip(_BASIC))["key"]))
            elif quote == "'":
                found.append(self.skip(_LITERAL)[1:-1])
            else:
                found.append(self.skip(_BARE_KEY))
            self.skip(_BLANK)
            if self.text[self.position] != ".":
                return found
            self.position += 1

    def key_value(self, table: Path) -> None:
        line = self.line
        path = table
        for key in self.keys():
            path = (*path, key)
            self.lines.setdefault(path, line)
        self.position += 1  # the equals sign
        self.value(path)

    def value(self, path: Path) -> None:
        self.skip(_BLANK)
        start = self.text[self.position]
        if self.text.startswith('"""', self.position):
            self.skip(_LONG_BASIC)
        elif self.text.startswith("'''", self.position):
            self.skip(_LONG_LITERAL)
        elif start == '"':
            self.skip(_BASIC)
        elif start == "'":
            self.skip(_LITERAL)
        elif start == "[":
            self.array(path)
        elif start == "{":
            self.inline_table(path)
        else:
            self.skip(_PLAIN)

    def array(self, path: Path) -> None:
        self.position += 1
        self.skip(_FILL)
        place = 0
        while self.text[self.position] != "]":
            self.lines[(*path, place)] = self.line
            self.value((*path, place))
            place += 1
            self.next_item()
        self.position += 1

    def inline_table(self, path: Path) -> None:
        self.position += 1
        self.skip(_FILL)
        while self.text[self.position] != "}":
            self.key_value(path)
            self.next_item()
        self.position += 1

    def next_item(self) -> None:
        self.skip(_FILL)
        if self.text[self.position] == ",":
            self.position += 1
            self.skip(_FILL)
