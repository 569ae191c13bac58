"""`carom.Sweep`: the rows of a study, and what of it failed."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import carom
from carom.arrays import Array, Bool
from carom.errors import CaromError, counted, did_you_mean, extra
from carom.files import Anchored, csv_bytes, inside, write_whole
from carom.many.sweep.origin import COLUMNS, Origin, tally
from carom.many.sweep.plot import histograms, moved, places, responses
from carom.many.threads import COUNTS
from carom.show.plot import require_matplotlib
from carom.show.plot.style import save

if TYPE_CHECKING:
    import pandas

    from carom.many.sweep.run import Progress
    from carom.many.sweep.study import Study

#: Failures that are listed.
LISTED = 1000


class Sweep:
    """One row per case. `sweep["ball3.position.x"]` is a column (cases,); `sweep.failures` lists what went wrong."""

    def __init__(self, path: Path, study: Study, table: Any, progress: Progress) -> None:
        self._anchored = Anchored(path)
        self.study = study
        self.table = table
        """A table of pyarrow, None if no case is there."""
        self.progress = progress

    @property
    def path(self) -> Path:
        """The folder: as it was given, or as a whole if the working directory is another one by now."""
        return self._anchored.path

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return [] if self.table is None else list(self.table.column_names)

    def __getitem__(self, column: str) -> Array:
        if column not in self.columns:
            raise CaromError(f"the study has no column {column!r}; {self._why(column)}")
        found = self.table[column]
        return (
            np.asarray(found.to_pylist(), dtype=object) if "string" in str(found.type) else np.asarray(found)
        )

    def _why(self, column: str) -> str:
        """Why a column is not there: it is called otherwise, or it is one of cases that are done, and all have failed."""
        if len(self) and not self.ok.any():
            first = self.failures[0]
            return (
                f"none of {counted(len(self), 'case')} is done. Case {first['case']}:"
                f" {first['outcome']}: {first['message']}"
            )
        return did_you_mean(column, self.columns)

    def label(self, column: str) -> str:
        """A column with its unit, as figures and CSV name it: `cue.velocity.x (m/s)`."""
        unit = (self.table.schema.field(column).metadata or {}).get(b"unit", b"1").decode()
        return column if unit == "1" else f"{column} ({unit})"

    def __len__(self) -> int:
        return 0 if self.table is None else int(self.table.num_rows)

    @cached_property
    def ok(self) -> Bool:
        """Which rows reached their end."""
        return np.asarray(self["outcome"] == "done") if len(self) else np.zeros(0, dtype=bool)

    @cached_property
    def origins(self) -> Mapping[Origin, int]:
        """How many rows were computed by which Carom: version of the core and identity of its build, if they are known."""
        blank = [None] * len(self)  # of tables from before the columns were written
        return tally(*(self.table[name].to_pylist() if name in self.columns else blank for name in COLUMNS))

    @property
    def parameters(self) -> list[str]:
        """Columns of what varies."""
        return list(self.study.columns)

    @cached_property
    def failures(self) -> list[dict[str, Any]]:
        """Case, id, parameters, outcome and message of those that failed."""
        if not len(self):
            return []
        rows = np.flatnonzero(~self.ok)[:LISTED].tolist()
        if not rows:
            return []
        names = ("case", "id", *self.parameters, "outcome", "message")
        return self.table.select(names).take(rows).to_pylist()  # type: ignore[no-any-return]

    @property
    def summary(self) -> Mapping[str, Any]:
        """Plain values: `sweep.json`, and the document of `carom sweep --json`."""
        state = self.progress
        return {
            "title": self.study.title,
            "directory": str(self.path),
            "table": str(self.path / "sweep.parquet"),
            "cases": self.study.cases,
            "done": int(self.ok.sum()),
            "failed": int((~self.ok).sum()),
            "missing": self.study.cases - len(self),
            "new": state.new,
            "wall_s": state.wall_s,
            "per_second": state.per_second,
            "parameters": self.parameters,
            "design": self.study.design.kind,
            "failures": self.failures,
            "carom": carom.__version__,
            "computed_by": [{**who._asdict(), "cases": cases} for who, cases in self.origins.items()],
        }

    def scene(self, case: int) -> Any:
        """The scene of a case, to simulate it again with everything recorded."""
        return copy.copy(self.study.targeting.scene(range(self.study.cases)[case]))

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a data frame."""
        extra("pandas", "to_pandas needs pandas", "interop", "; to_csv needs nothing")
        return self.table.to_pandas()

    def to_csv(self, path: str | Path | None = None, columns: Sequence[str] = ()) -> Path:
        """The table as CSV, one line per case, to `path` (by default `sweep.csv` in the folder); returns the path.

        Units stand in the headings. Counts and seeds are whole numbers, others the shortest text that reads back as the
        same bits. `columns` are those wanted, in this order; by default all. Raises `CaromError` for a column that is
        not there, and of a study without a case.
        """
        if self.table is None:
            raise CaromError(f"{self.path}: no case is there yet, so there is no table to write")
        chosen = list(columns) or self.columns
        rows = zip(*map(self._cells, chosen), strict=True)
        file = Path(path) if path is not None else self.path / "sweep.csv"
        write_whole(file, csv_bytes([map(self.label, chosen), *rows]), durable=False, parents=True)
        return file

    def _cells(self, column: str) -> list[Any]:
        """A column for CSV. All numbers of a table are floats: of counts a case that failed has none."""
        cells: list[Any] = self[column].tolist()
        seeds = [axis.name for axis in self.study.axes if axis.crossed]
        return [int(x) if x == x else x for x in cells] if column in (*COUNTS, *seeds) else cells

    def plot(
        self,
        directory: str | Path | None = None,
        columns: Sequence[str] = (),
        formats: Sequence[str] = ("png",),
    ) -> list[Path]:
        """Histograms, each of the `columns` against each parameter, and where the balls end, to `plots` in the folder.

        By default the columns of a measure, then of the places and velocities at the end those that the parameters
        explain best, and the energy. Raises `CaromError` for a column that is not there, and where no case is done.
        """
        require_matplotlib()
        if not self.ok.any():
            raise CaromError("no case reached its end, so there is nothing to draw; sweep.failures says why")
        where = Path(directory) if directory is not None else inside(self.path, "plots")
        files = save(histograms(self, columns), where, "histograms", formats)
        files += save(responses(self, columns), where, "responses", formats)
        if not columns and moved(self):
            files += save(places(self), where, "places", formats)
        return files

    def __repr__(self) -> str:
        failed = int((~self.ok).sum())
        rest = self.study.cases - len(self)
        return (
            f"<carom.Sweep {self.study.title!r}: {counted(int(self.ok.sum()), 'case')} done, {failed} failed,"
            f" {rest} missing; {len(self.columns)} columns; {self.path}>"
        )
