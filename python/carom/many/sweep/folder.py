"""The folder of a study: parts with rows, one table of them all, and who may work in it.

sweep.parquet   one row per case, in the order of the study
sweep.json      what was computed, how fast, and what failed
parts/          rows as workers wrote them; what a second call goes by
runs/           run directories of the cases, if they are kept
plots/          figures with their numbers
"""

from __future__ import annotations

import json
import os
import time
import uuid
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from carom.arrays import Array
from carom.errors import CaromError, counted
from carom.export.parquet import require_pyarrow
from carom.files import RecordError, inside, json_bytes, lock, opened, regular, unwritable, write_whole
from carom.many.sweep import origin
from carom.many.sweep.study import Study
from carom.result.kinematics import QUANTITIES

#: Parts above which they are made one.
MOST_PARTS = 64
#: Seconds after which a file that was never renamed belongs to nobody.
SCRAP_SECONDS = 3600.0
#: Columns that every part has.
NAMED = ("id", "outcome")
UNITS = {name: unit for name, (_, unit) in QUANTITIES.items()}
#: Columns of their own; what is not here and no place, velocity or energy has no unit that is known.
OWN_UNITS = {"time": "s", "seconds": "s", "penetration_max": "m"}


class Folder:
    """The files of a study."""

    def __init__(self, path: Path, keep: bool = False) -> None:
        """With `keep` parts stay in memory, which never change: for searches, which look at them many times."""
        self.path = path
        self._kept: dict[Path, Any] | None = {} if keep else None
        self.parts = path / "parts"
        self.table_file = path / "sweep.parquet"
        self.about = path / "sweep.json"

    def run(self, name: str) -> Path:
        """The run directory of a case."""
        return inside(self.path, "runs", name)

    @contextmanager
    def driving(self) -> Iterator[None]:
        """Be the one driver of this study; a folder with anything else in it is refused."""
        try:
            if self.path.exists() and not self.parts.exists() and any(self.path.iterdir()):
                raise CaromError(f"{self.path} holds other files and no study; choose another with -o")
            inside(self.path, "parts").mkdir(parents=True, exist_ok=True)
            held = opened(self.parts / ".lock", os.O_WRONLY | os.O_APPEND | os.O_CREAT, "ab")
        except OSError as error:
            raise RecordError(f"cannot write {self.path}: {unwritable(error)}") from error
        with held:
            if not lock(held):
                raise CaromError(
                    f"{self.path} is being computed by another process; wait for it, or interrupt it first"
                )
            for scrap in self.parts.glob(".*.tmp"):
                with suppress(OSError):
                    if time.time() - scrap.stat().st_mtime > SCRAP_SECONDS:
                        scrap.unlink()
            yield

    def write_part(self, key: str, pieces: Sequence[Mapping[str, Array]]) -> None:
        """Add rows, in one move and for good."""
        arrow = require_pyarrow("a study", "cluster")
        tables = [_table(arrow, piece) for piece in pieces]
        self._write_part(key, arrow.concat_tables(tables, promote_options="permissive"))

    def _write_part(self, key: str, table: Any) -> Path:
        name = uuid.uuid4().hex[:12]
        path = self.parts / f"{key}-{name}.parquet"
        self._replace(path, table)
        return path

    def _replace(self, path: Path, table: Any) -> None:
        from pyarrow import parquet

        temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")
        try:
            with open(temporary, "wb") as file:
                parquet.write_table(table, file, compression="zstd")
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except OSError as error:
            raise RecordError(f"cannot write {path}: {unwritable(error)}") from error
        finally:
            temporary.unlink(missing_ok=True)

    def outcomes(self, pattern: str = "*") -> dict[str, str]:
        """Outcome by the name of the case, of all rows in parts whose names match."""
        found: dict[str, str] = {}
        for _, part in self._read(pattern, list(NAMED)):
            # A case that failed once and was tried again has two rows; what went well counts.
            for name, outcome in zip(part["id"].to_pylist(), part["outcome"].to_pylist(), strict=True):
                if found.get(name) != "done":
                    found[name] = outcome
        return found

    def other_study(self, study: Study) -> str:
        """Refuse a study of other parameters than those here; what to warn of if no row fits it for another reason."""
        before = self.outcomes()
        if not before or any(name in before for name in study.ids):
            return ""
        there = self._parameters()
        if there is not None and set(there) != set(study.columns):
            raise CaromError(
                f"{self.path} holds a study of other parameters: {', '.join(there)}. This one has"
                f" {', '.join(study.columns)}; choose another folder (-o DIR, in Python out), or remove that one"
            )
        return (
            f"no row in {self.path} fits this study: its scenario, options, measure or points are others. All cases are"
            f" computed, and the table replaces that of {counted(len(before), 'row')}; choose another folder to keep both"
        )

    def _parameters(self) -> list[str] | None:
        """Columns of what varies in the study that wrote the table here; None where that cannot be read."""
        try:
            found = json.loads(regular(self.about).read_text(encoding="utf-8"))["parameters"]
            return [str(name) for name in found]
        except (OSError, ValueError, KeyError, TypeError, CaromError):
            return None

    def origins(self, names: Iterable[str]) -> Counter[origin.Origin]:
        """How many of the cases of these names were computed by whom."""
        wanted = set(names)
        found: dict[str, tuple[str | None, ...]] = {}
        for _, part in self._read("*", ["id", *origin.COLUMNS]):
            blank = [None] * part.num_rows  # of parts from before the columns were written
            columns = [
                part[name].to_pylist() if name in part.column_names else blank for name in origin.COLUMNS
            ]
            found |= {row[0]: row[1:] for row in zip(part["id"].to_pylist(), *columns, strict=True)}
        rows = [row for name, row in found.items() if name in wanted]
        return origin.tally([row[0] for row in rows], [row[1] for row in rows])

    def _read(self, pattern: str, columns: list[str] | None = None) -> Iterator[tuple[Path, Any]]:
        """Whole parts, or those of the columns that they have, oldest first; one that a crash of the machine left damaged
        is as if it were not there.
        """
        arrow = require_pyarrow("a study", "cluster")
        from pyarrow import parquet

        files = sorted(
            self.parts.glob(f"{pattern}.parquet"), key=lambda path: (path.stat().st_mtime_ns, path.name)
        )
        for path in files:
            if self._kept is not None and path in self._kept:
                yield path, self._kept[path]
                continue
            try:
                with open(regular(path), "rb") as part, parquet.ParquetFile(part) as file:
                    there = file.schema_arrow.names
                    if not _as_written(arrow, file.schema_arrow):
                        continue
                    wanted = columns if columns and self._kept is None else there
                    table = file.read([name for name in wanted if name in there])
                    table.validate(full=True)
                if self._kept is not None:
                    self._kept[path] = table
                yield path, table
            except (arrow.ArrowException, OSError, CaromError):
                continue

    def gather(self, study: Study) -> Any:
        """All rows of a study as one table in the order of its cases, also written to `sweep.parquet`; None without rows."""
        arrow = require_pyarrow("a study", "cluster")
        read = list(self._read("*"))
        if not read:
            return None
        known: dict[str, tuple[Any, Path]] = {}
        for path, table in read:
            for field in table.schema:
                kind, other = known.setdefault(field.name, (field.type, path))
                if kind != field.type:
                    raise CaromError(
                        f"{path}: {field.name} is {field.type}, and {kind} in {other.name}; remove the part that is not of"
                        " this study, and the same call computes its cases again"
                    )
        whole = arrow.concat_tables([table for _, table in read], promote_options="permissive")
        if (
            len(read) > MOST_PARTS
        ):  # first the one with all rows, then without the others: rows twice do no harm
            kept = self._write_part("all", whole)
            for path, _ in read:
                if path != kept:
                    path.unlink(missing_ok=True)
        place: dict[str, int] = {}
        outcome = whole["outcome"].to_pylist()
        for row, name in enumerate(whole["id"].to_pylist()):
            if name not in place or outcome[place[name]] != "done":
                place[name] = row
        cases = [k for k, name in enumerate(study.ids) if name in place]
        table = whole.take([place[study.ids[k]] for k in cases])
        table = table.add_column(0, arrow.field("case", arrow.int64()), arrow.array(cases, arrow.int64()))
        self._replace(self.table_file, table)
        return table

    def note(self, facts: Mapping[str, Any]) -> None:
        """Replace `sweep.json`."""
        write_whole(self.about, json_bytes(facts, indent=2, default=str), durable=False)


def _as_written(arrow: Any, schema: Any) -> bool:
    """Whether a table has the columns of a part: those by which rows are told, each name once, of text or numbers."""
    kinds = (arrow.string(), arrow.float64())
    told = all(schema.get_field_index(name) >= 0 and schema.field(name).type == kinds[0] for name in NAMED)
    once = len(set(schema.names)) == len(schema.names) and "case" not in schema.names
    return told and once and all(kind in kinds for kind in schema.types)


def _table(arrow: Any, columns: Mapping[str, Array]) -> Any:
    arrays, fields = [], []
    for name, values in columns.items():
        text = values.dtype == object
        arrays.append(
            arrow.array(values.tolist(), arrow.string()) if text else arrow.array(np.asarray(values, float))
        )
        unit = OWN_UNITS.get(name) or ("J" if name.startswith("energy_") else _unit_of(name))
        fields.append(arrow.field(name, arrays[-1].type, metadata={"unit": unit}))
    return arrow.Table.from_arrays(arrays, schema=arrow.schema(fields))


def _unit_of(name: str) -> str:
    """The unit of `cue.velocity.x`, at the end or (`cue.velocity.x.start`) as it was given."""
    parts = name.removesuffix(".start").split(".")
    return UNITS.get(parts[-2], "1") if len(parts) > 2 else "1"
