"""The record of a run in memory: appended by blocks as to a `Writer`, read as from `Segments`."""

from __future__ import annotations

import copy
import threading
from collections.abc import Collection, Mapping
from itertools import accumulate
from typing import Any

import numpy as np

from carom.arrays import Array
from carom.errors import CaromError
from carom.result.record.layout import ENDS, MEANINGS, SOMETIMES, TABLES, TEXTS, Meaning, Rows, count, tables
from carom.result.record.reader import Column

#: Blocks, and steps in them, that wait at most before their columns are joined: a run of single steps would otherwise hold
#: millions of small arrays, and a long one tables that are not kept.
BLOCKS, STEPS = 1000, 20_000


class Memory:
    """All that a run records, or some of its `keep` tables alone. The other arguments are those of `Writer`."""

    def __init__(self, *, keep: Collection[str] = (*TABLES, *SOMETIMES), **described: Any) -> None:
        self.first = Rows()
        self.last_frame: int | None = None  # step of the newest frame
        self.described = described
        self._keep = keep
        self._rows = Rows()
        self._parts: dict[str, dict[str, list[Array]]] = {}
        self._pending: list[Mapping[str, Any]] = []
        self._waiting = 0
        # Reading joins blocks and columns, which several threads must not do at once.
        self._lock = threading.RLock()

    def __getstate__(self) -> dict[str, Any]:
        with self._lock:
            return {name: value for name, value in vars(self).items() if name != "_lock"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _lock=threading.RLock())

    def append(self, block: Mapping[str, Any]) -> None:
        """Take over a block as `Simulation.advance` returns it; the first one fixes the columns."""
        with self._lock:
            if not self._parts:
                out = self.described.get("leave_out", ())
                self._parts = {
                    t: {name: [] for name in block[t] if (t, name) not in out} for t in tables(block)
                }
            self._pending.append(block)
            self._waiting += len(block["steps"]["step"])
            if len(steps := block["frames"]["step"]):
                self.last_frame = int(steps[-1])
            if len(self._pending) >= BLOCKS or self._waiting >= STEPS:
                self._join()

    def commit(self) -> None:
        """What was appended counts already; it is joined to the columns when somebody asks for them."""

    def _join(self) -> None:
        """Join what waits to the columns; only by who holds the lock."""
        blocks, self._pending, self._waiting = self._pending, [], 0
        if not blocks:
            return
        before = list(accumulate(map(count, blocks), initial=self._rows))
        for table, columns in self._parts.items():
            for name, joined in columns.items():
                parts = [np.asarray(block[table][name]) for block in blocks]
                if target := ENDS.get((table, name)):
                    offsets = (np.uint64(getattr(rows, target)) for rows in before)
                    parts = [np.asarray(part, np.uint64) + offset for part, offset in zip(parts, offsets)]
                if table not in self._keep:
                    parts = [part[:0] for part in parts[:1]]
                joined.append(np.concatenate(parts) if len(parts) > 1 else parts[0])
        self._rows = before[-1]

    @property
    def rows(self) -> Rows:
        """How many rows each table has."""
        with self._lock:
            self._join()
            return self._rows

    def snapshot(self) -> Memory:
        """What is here now: what is appended later is not in it."""
        with self._lock:
            self._join()
            found = copy.copy(self)
            found._pending = []  # a list of its own: both go on appending
            found._parts = {
                table: {name: list(parts) for name, parts in columns.items()}
                for table, columns in self._parts.items()
            }
            return found

    def table(self, table: str) -> dict[str, Array]:
        """All columns of a table."""
        return {name: np.asarray(self.column(table, name)) for name in self.columns(table)}

    def blocks(self) -> dict[str, dict[str, Array]]:
        """All of it as one block."""
        return {table: self.table(table) for table in self._parts}

    @property
    def attributes(self) -> Mapping[str, Any]:
        """Gravity, step, versions."""
        found: Mapping[str, Any] = self.described["attributes"]
        return found

    def columns(self, table: str) -> list[str]:
        """Names of the columns of a table; none of one that the run has not."""
        return list(self._parts.get(table, ()))

    def column(self, table: str, name: str) -> Column:
        """One column."""
        with self._lock:
            self._join()
            parts = self._parts[table][name]
            if len(parts) > 1:
                parts[:] = [np.concatenate(parts)]
            whole = parts[0]
        whole.flags.writeable = False  # shared between all who index it
        return Column([(whole, len(whole))], MEANINGS.get(f"{table}/{name}", Meaning("", "")).unit)

    def static(self, table: str) -> dict[str, Array]:
        """A table of what does not change (empty if there is none); text as an array of `str`."""
        return {
            name: np.array(values, dtype=object) if name in TEXTS else np.asarray(values)
            for name, values in sorted(self.described.get(table, {"name": []}).items())
        }

    def damage(self, place: str, cause: str) -> CaromError:
        """What is said of a table that contradicts itself."""
        return CaromError(f"the result in memory: {place} cannot be read ({cause})")

    def close(self) -> None:
        """Nothing is open."""
