"""The tables of a result: columns by name, rows by index or condition, read as far as they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np

from carom.arrays import Array
from carom.errors import CaromError, among, counted, did_you_mean, extra, quoted
from carom.numeric import is_whole
from carom.result.names import Names, UnknownName
from carom.result.record import Record
from carom.result.record.layout import MEANINGS

if TYPE_CHECKING:
    import pandas


V = TypeVar("V")


class NoFrame(CaromError, IndexError):
    """A frame that is not there."""


def frame_number(owner: str, frame: int, frames: int) -> int:
    """The number from 0 of one of so many frames; negative ones count from the end."""
    if not is_whole(frame) or not -frames <= frame < frames:
        allowed = f"give one of {-frames} to {frames - 1}" if frames else "there are none"
        raise NoFrame(f"{owner}: there is no frame {frame} among {counted(frames, 'frame')}; {allowed}")
    return range(frames)[int(frame)]


class Named(Mapping[str, V]):
    """Things by name, in their order; `what` is said of one of them in messages."""

    what = ""

    def __init__(self, things: Mapping[str, V]) -> None:
        self._things = dict(things)

    def __getitem__(self, name: str) -> V:
        try:
            return self._things[name]
        except KeyError:
            cure = among(str(name), list(self))
            raise UnknownName(f"no {self.what} is called {name!r}; {cure}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._things)

    def __len__(self) -> int:
        return len(self._things)

    def __repr__(self) -> str:
        return f"<{counted(len(self), self.what)}: {', '.join(self)}>"

    def _with(self, things: Mapping[str, V]) -> Self:
        """Others of the same kind."""
        found = copy(self)
        found._things = dict(things)
        return found


def _data_frame(columns: Sequence[str], read: Callable[[str], Any]) -> pandas.DataFrame:
    """Columns as a `pandas.DataFrame`; of vectors each component is a column, with _x, _y, _z, of pairs with _a, _b."""
    pandas = extra("pandas", "to_pandas needs pandas", "interop")
    flat: dict[str, Array] = {}
    for column in columns:
        values = np.asarray(read(column))
        if values.ndim == 1:
            flat[column] = values
        elif values.ndim == 2:
            letters = "xyz" if values.shape[1] == 3 else "ab"
            flat |= {f"{column}_{letter}": values[:, i] for i, letter in enumerate(letters)}
    return pandas.DataFrame(flat)


class Table:
    """Columns of equal length. `table["time"]`, `table.time`, `table.where(table.time > 1)`, `table.to_pandas()`."""

    name = ""

    def __init__(self, segments: Record, rows: Array | None = None) -> None:
        self._segments = segments
        self._chosen = rows  # indices of rows, or None for all

    @property
    def columns(self) -> list[str]:
        """Names of the columns: those of the file, and those derived from them."""
        return [*self._segments.columns(self.name), *self._derived()]

    def __getitem__(self, column: str | slice) -> Any:
        """A column by its name, or the rows of a slice; other rows are chosen by `where`."""
        if isinstance(column, slice):
            return self.where(np.arange(len(self))[column])
        if not isinstance(column, str):
            raise UnknownName(
                f"{self.name}: found {quoted(column)}; write {self.name}[2:5] or {self.name}.where(...) for rows, or the"
                f" name of a column: {', '.join(self.columns)}"
            )
        derive = self._derived().get(column)
        if derive is not None:
            return derive()
        if column not in self._segments.columns(self.name):
            raise UnknownName(
                f"{self.name} has no column {column!r}; {did_you_mean(str(column), self.columns)}"
            )
        values = self._segments.column(self.name, column)
        return values if self._chosen is None else np.asarray(values)[self._chosen]

    def __getattr__(self, column: str) -> Any:
        if column.startswith("_"):
            raise AttributeError(column)
        try:
            return self[column]
        except KeyError as error:
            raise AttributeError(str(error.args[0])) from None

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return self._all_rows() if self._chosen is None else len(self._chosen)

    def where(self, rows: Any) -> Self:
        """The rows for which a condition holds (a mask of `len(self)`), or with the given indices."""
        kept = np.arange(self._all_rows()) if self._chosen is None else self._chosen
        chosen = np.asarray(rows)
        if chosen.dtype != bool and chosen.size == 0:
            chosen = chosen.astype(np.intp)
        return self._with_rows(kept[chosen])

    def unit(self, column: str) -> str:
        """Unit of a column of the file ("1" if it has none)."""
        return self._segments.column(self.name, column).unit

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a `pandas.DataFrame`; a vector becomes three columns with _x, _y, _z."""
        return _data_frame(self.columns, self.__getitem__)

    def __repr__(self) -> str:
        return f"<{self.name}: {len(self)} rows; columns {', '.join(self.columns)}>"

    def _derived(self) -> Mapping[str, Callable[[], Any]]:
        return {}

    def _with_rows(self, rows: Array) -> Self:
        return type(self)(self._segments, rows)

    def _all_rows(self) -> int:
        return int(getattr(self._segments.rows, self.name))


class Steps(Table):
    """One row per step."""

    name = "steps"


class _Pairs(Table):
    """A table with two bodies a row, which also has their names."""

    def __init__(self, segments: Record, names: Names, rows: Array | None = None) -> None:
        super().__init__(segments, rows)
        self._names = names

    def between(self, first: str | int, second: str | int | None = None) -> Self:
        """The rows with this body or wall, or with these two in any order.

        The name of a clump means its balls, a number what has it in the column `body`.
        """
        body = np.asarray(self["body"]).reshape(-1, 2)
        if second is None:
            return self.where(np.isin(body, self._names.numbers(first)).any(axis=1))
        a, b = (np.isin(body, numbers) for numbers in self._names.pair(first, second))
        return self.where((a & b[:, ::-1]).any(axis=1))

    def _derived(self) -> Mapping[str, Callable[[], Any]]:
        return {"pair": self._pair}

    def _pair(self) -> Array:
        """(rows, 2) names."""
        body = np.asarray(self["body"]).astype(np.int64)
        names = self._names.array
        return np.asarray(names[np.clip(body, 0, len(names) - 1)])

    def _with_rows(self, rows: Array) -> Self:
        return type(self)(self._segments, self._names, rows)


class Impacts(_Pairs):
    """One row per contact and impact problem."""

    name = "impacts"


class Impulses(_Pairs):
    """How impulses of impacts grow, by pair: `step`, `time` (s), `at` (impact problems so far), `impulse` (N s) so far.

    By laws through springs an impact has a time: `at` goes from 0 to 1 with it, from where a contact begins. Other laws
    give impulses at once: of each impact problem begin and end.
    """

    name = "impulses"

    def _derived(self) -> Mapping[str, Callable[[], Any]]:
        if not self._segments.columns(self.name):
            return _without_rows(self.name, "pair")
        return super()._derived()


class Contacts(_Pairs):
    """One row per frame and contact; `frame` and `time` say which frame of the run, `at(k)` gives the rows of one."""

    name = "contacts"

    def __init__(
        self,
        segments: Record,
        names: Names,
        rows: Array | None = None,
        frames: Array | None = None,
    ) -> None:
        super().__init__(segments, names, rows)
        self._frames = frames  # numbers in the run of the frames that `at` counts, or None for all

    @property
    def ends(self) -> Array:
        """Rows of each frame end here, (T,): those of frame k of the whole table are `ends[k - 1]` to `ends[k]`."""
        if self._chosen is not None:
            raise CaromError("contacts: `ends` counts rows of the whole table; of chosen rows take at(k)")
        return self._ends()

    def at(self, frame: int) -> Self:
        """Those of these contacts that are of one frame (negative counts from the end). Of a part of a result made by
        `sel`, frame k is the k-th of the part.
        """
        ends = self._ends()
        frames = np.arange(len(ends)) if self._frames is None else self._frames
        number = int(frames[frame_number("contacts", frame, len(frames))])
        start, end = int(ends[number - 1]) if number else 0, int(ends[number])
        chosen = self._chosen
        rows = np.arange(start, end) if chosen is None else chosen[(chosen >= start) & (chosen < end)]
        return self._of_frames(rows, np.array([number]))

    def of_frames(self, frames: Array) -> Self:
        """Those of several frames of the run, which `at` then counts in the order given."""
        rows = np.flatnonzero(np.isin(self._frame(), frames))
        return self._of_frames(rows if self._chosen is None else self._chosen[rows], frames)

    def _of_frames(self, rows: Array, frames: Array | None) -> Self:
        return type(self)(self._segments, self._names, rows, frames)

    def _with_rows(self, rows: Array) -> Self:
        return self._of_frames(rows, self._frames)

    def _ends(self) -> Array:
        return np.asarray(self._segments.column("frames", "contact_end")).astype(np.int64)

    def _derived(self) -> Mapping[str, Callable[[], Any]]:
        return {**super()._derived(), "frame": self._frame, "time": self._time}

    def _frame(self) -> Array:
        ends = self._ends()
        rows = np.arange(self._all_rows()) if self._chosen is None else self._chosen
        frames = np.searchsorted(ends, rows, side="right")
        if frames.size and frames.max() >= len(ends):
            raise self._segments.damage("/frames/contact_end", "contacts belong to no frame")
        return frames

    def _time(self) -> Array:
        return np.asarray(np.asarray(self._segments.column("frames", "time"))[self._frame()])


class Events(Table):
    """One row per ball that entered or left: `step`, `time`, `body`, `kind` (1 enters, 0 leaves) and its name, `ball`."""

    name = "events"

    def __init__(self, segments: Record, names: Sequence[str], rows: Array | None = None) -> None:
        super().__init__(segments, rows)
        self._names = names

    def _derived(self) -> Mapping[str, Callable[[], Any]]:
        if self._segments.columns(self.name):
            return {
                "ball": lambda: np.array([self._names[i] for i in np.asarray(self["body"])], dtype=object)
            }
        return _without_rows(self.name, "ball")

    def left(self) -> list[tuple[str, float]]:
        """Name and time (s) of each ball that left."""
        rows = zip(self["ball"], np.asarray(self["time"]), np.asarray(self["kind"]), strict=True)
        return [(str(ball), float(time)) for ball, time, kind in rows if kind == 0]

    def _with_rows(self, rows: Array) -> Self:
        return type(self)(self._segments, self._names, rows)


class Transitions(_Pairs):
    """One row per ball whose motion changed at an event of method `events`: `step`, `time` (s), `body` (the ball and what
    did it, -1 for nothing), `kind`, `mode` (before and after), `position` (m) then, `velocity` (m/s) afterwards.
    In words: `pair`, `event`, `before`, `after`.
    """

    name = "transitions"
    EVENTS = ("impact", "slip ends", "roll ends", "spin ends", "edge", "outlet", "press", "release")
    MODES = ("flight", "slide", "roll", "spin", "rest", "stepped", "gone")

    def _derived(self) -> Mapping[str, Callable[[], Any]]:
        if not self._segments.columns(self.name):  # of another method
            return _without_rows(self.name, "pair", "event", "before", "after")
        words = np.array([*self.MODES, "?"], dtype=object)
        kinds = np.array([*self.EVENTS, "?"], dtype=object)
        return {
            **super()._derived(),
            "event": lambda: kinds[np.minimum(np.asarray(self["kind"]), len(kinds) - 1)],
            "before": lambda: words[np.minimum(np.asarray(self["mode"])[:, 0], len(words) - 1)],
            "after": lambda: words[np.minimum(np.asarray(self["mode"])[:, 1], len(words) - 1)],
        }

    def _pair(self) -> Array:
        """(rows, 2) names, "" for nothing."""
        return np.where(np.asarray(self["body"]) < 0, "", super()._pair())


def _without_rows(table: str, *derived: str) -> Mapping[str, Callable[[], Any]]:
    """The columns of a table of which nothing could happen in the run."""
    names = [key.partition("/")[2] for key in MEANINGS if key.startswith(f"{table}/")]
    return dict.fromkeys((*names, *derived), lambda: np.zeros(0))


class Residuals(Table):
    """One row per recorded contact problem; `history(step)` gives the residual norms of its iterations."""

    name = "residuals"
    LEVELS: ClassVar[Mapping[str, int]] = {"smooth": 0, "position": 1, "velocity": 2}

    @property
    def columns(self) -> list[str]:
        """Names of the columns; the histories themselves are not rows and come from `history`."""
        return [c for c in super().columns if c not in ("end", "value")]

    def history(self, step: int, level: str | None = None) -> list[Array]:
        """Residual norms per iteration, an array for each problem of a step, of one level or of all."""
        if level is not None and level not in self.LEVELS:
            raise UnknownName(f"no level is called {level!r}; known: {', '.join(self.LEVELS)}")
        chosen = np.asarray(self["step"]) == step
        if level is not None:
            chosen &= np.asarray(self["level"]) == self.LEVELS[level]
        ends = np.concatenate([[0], np.asarray(self._segments.column("residuals", "end"))]).astype(np.int64)
        rows = np.arange(self._all_rows()) if self._chosen is None else self._chosen
        values = self._segments.column("residuals", "value")
        return [np.asarray(values[ends[r] : ends[r + 1]]) for r in rows[chosen]]


class Energy:
    """Energies after every step, (S,), J: columns of the table of steps, or of some of its rows."""

    def __init__(self, steps: Steps) -> None:
        self._steps = steps

    def __repr__(self) -> str:
        if not len(self.time):
            return "<energy: no steps>"
        return f"<energy of {len(self.time)} steps: total {self.total[0]:.6g} J to {self.total[-1]:.6g} J>"

    @cached_property
    def time(self) -> Array:
        """Times at the end of the steps, s."""
        return self._read("time")

    @cached_property
    def kinetic(self) -> Array:
        """Kinetic energy of translation and rotation."""
        return self._read("energy_kinetic")

    @cached_property
    def potential(self) -> Array:
        """Potential energy of gravity."""
        return self._read("energy_potential")

    @property
    def total(self) -> Array:
        """Kinetic and potential energy."""
        return np.asarray(self.kinetic + self.potential)

    def to_pandas(self) -> pandas.DataFrame:
        """A row per step with `time` (s), `kinetic`, `potential` and `total` (J), as a `pandas.DataFrame`."""
        return _data_frame(("time", "kinetic", "potential", "total"), partial(getattr, self))

    def _read(self, column: str) -> Array:
        return np.asarray(self._steps[column])


class Static:
    """A small table that does not change in a run: `bodies["radius"]`, `bodies.radius`."""

    def __init__(self, columns: Mapping[str, Array]) -> None:
        self._columns = dict(columns)

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return list(self._columns)

    def __getitem__(self, column: str) -> Array:
        if column not in self.columns:
            raise UnknownName(f"no column {column!r}; {did_you_mean(str(column), self.columns)}")
        return self._columns[column]

    def __getattr__(self, column: str) -> Array:
        if column.startswith("_"):
            raise AttributeError(column)
        try:
            return self[column]
        except KeyError as error:
            raise AttributeError(str(error.args[0])) from None

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a `pandas.DataFrame`; a vector becomes three columns with _x, _y, _z."""
        return _data_frame(self.columns, self.__getitem__)

    def __contains__(self, column: object) -> bool:
        return column in self._columns

    def __len__(self) -> int:
        return len(self._columns["name"])

    def __repr__(self) -> str:
        return f"<{len(self)} rows; columns {', '.join(self.columns)}>"
