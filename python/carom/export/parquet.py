"""Tables as Parquet (zstd), for pandas, polars, R and the like; the unit of a column is in its metadata."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from carom.errors import extra
from carom.export.atomic import whole_file
from carom.export.frames import Selection
from carom.export.tables import Columns, Sheet, written

#: Rows of a group: pieces are collected until there are so many.
GROUP = 200_000


def write(selection: Selection, directory: Path) -> list[Path]:
    """`frames.parquet` and a file for every other table that has rows."""
    require_pyarrow("the format parquet")
    return written(selection, directory, "parquet", _write, _is_same)


def require_pyarrow(what: str, name: str = "export") -> Any:
    """The module `pyarrow` with `pyarrow.parquet`."""
    extra("pyarrow.parquet", f"{what} needs pyarrow", name)
    return extra("pyarrow", f"{what} needs pyarrow", name)


def _write(sheet: Sheet, path: Path) -> None:
    import pyarrow as arrow
    from pyarrow import parquet

    # Opened here: the name of a file may be no text, which pyarrow refuses.
    with whole_file(path) as temporary, open(temporary, "wb") as file:
        writer = None
        try:
            for columns in _grouped(sheet):
                table = as_arrow(columns, sheet.units)
                if writer is None:
                    writer = parquet.ParquetWriter(file, table.schema, compression="zstd")
                writer.write_table(table.cast(writer.schema))
            if writer is None:
                empty = arrow.table({name: arrow.array([], arrow.float64()) for name in sheet.units})
                writer = parquet.ParquetWriter(file, empty.schema)
        finally:
            if writer is not None:
                writer.close()


def _is_same(sheet: Sheet, path: Path) -> bool:
    import pyarrow as arrow
    from pyarrow import parquet

    try:
        with open(path, "rb") as file:
            return list(parquet.read_schema(file).names) == list(sheet.units)
    except (OSError, arrow.ArrowException):
        return False


def as_arrow(columns: Columns, units: Mapping[str, str]) -> Any:
    """A table of pyarrow with the units as metadata of its fields."""
    import pyarrow as arrow

    arrays, fields = [], []
    for name, unit in units.items():
        values = columns[name]
        array = (
            arrow.array(values.tolist(), arrow.string()) if values.dtype == object else arrow.array(values)
        )
        arrays.append(array)
        fields.append(arrow.field(name, array.type, metadata={"unit": unit}))
    return arrow.Table.from_arrays(arrays, schema=arrow.schema(fields))


def _grouped(sheet: Sheet) -> Iterator[dict[str, Any]]:
    kept: list[Columns] = []
    rows = 0
    for piece in sheet.pieces():
        kept.append(piece)
        rows += len(next(iter(piece.values())))
        if rows >= GROUP:
            yield {name: np.concatenate([p[name] for p in kept]) for name in sheet.units}
            kept, rows = [], 0
    if kept:
        yield {name: np.concatenate([p[name] for p in kept]) for name in sheet.units}
