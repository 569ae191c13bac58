"""The same measure over many frames or many regions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, overload

import numpy as np

from carom.arrays import F64, Array
from carom.errors import CaromError
from carom.measure.granular.region import Region
from carom.measure.granular.snapshot import Snapshot, Source, snapshot
from carom.numeric import is_whole
from carom.result.data import RunData
from carom.result.selection import Selection
from carom.scene.packing.region import Box
from carom.units import number

T = TypeVar("T")


@dataclass(frozen=True)
class Series(Generic[T]):
    """What a function found at each of some frames."""

    time: F64
    """Of the frames, (F,), s."""
    interval: F64
    """From the frame before to each, (F,), s: over this time its forces are means."""
    values: tuple[T, ...]

    def __getitem__(self, name: str) -> Array:
        """An attribute of all values as one array, (F, ...)."""
        return np.array([getattr(value, name) for value in self.values])

    def mean(self, name: str | None = None) -> Any:
        """Mean over time of an attribute, or of the values themselves. A frame counts for the time since the one before."""
        found = np.array(self.values) if name is None else self[name]
        return np.tensordot(self.interval / self.interval.sum(), found, axes=1)

    def __iter__(self) -> Iterator[T]:
        return iter(self.values)

    def __len__(self) -> int:
        return len(self.values)


@dataclass(frozen=True)
class Profile(Generic[T]):
    """What a function found in each of some regions."""

    regions: tuple[Region, ...]
    values: tuple[T, ...]

    @property
    def centre(self) -> F64:
        """Centres of the regions, (K, 3), m."""
        middle = (
            0.5 * np.add(r.low, r.high) if isinstance(r, Box) else np.asarray(r.point) for r in self.regions
        )
        return np.array([*middle], dtype=np.float64).reshape(-1, 3)

    @overload
    def __getitem__(self, which: str) -> Array: ...
    @overload
    def __getitem__(self, which: int) -> T: ...
    def __getitem__(self, which: str | int) -> Array | T:
        """An attribute of all values as one array, (K, ...), or the value of one region by its number."""
        return (
            np.array([getattr(v, which) for v in self.values])
            if isinstance(which, str)
            else self.values[which]
        )

    def __iter__(self) -> Iterator[T]:
        return iter(self.values)

    def __len__(self) -> int:
        return len(self.values)


def over_frames(
    result: RunData | Selection,
    function: Callable[..., T],
    *arguments: Any,
    start: float | str = 0.0,
    stop: float | str = float("inf"),
    every: int = 1,
    **options: Any,
) -> Series[T]:
    """`function(snapshot, *arguments, **options)` at every `every`-th frame of the times from `start` to `stop`, in s or as
    `"20 ms"`.

    Frame 0 is left out: nothing is known of forces before it. An argument that is a function is called with each snapshot:
    `whole_box` for a region that follows a periodic box that deforms.

        over_frames(result, stress, box, start=1.0).mean("tensor")
    """
    times = np.asarray(result.time)
    if not len(times):
        raise CaromError("the result has no frames yet; wait until the run has written some")
    if not is_whole(every) or every < 1:
        raise CaromError(f"over_frames: every = {every!r}; 1 takes every recorded frame")
    begin, end = (
        number("over_frames", name, given, "time", infinite=True)
        for name, given in (("start", start), ("stop", stop))
    )
    slack = 1e-9 * float(times[-1])
    chosen = [k for k in range(1, len(times)) if begin - slack <= times[k] <= end + slack][::every]
    if not chosen:
        raise CaromError(f"no frames from {begin:g} s to {end:g} s; the result ends at {times[-1]:g} s")
    values = tuple(_at(snapshot(result, k), function, arguments, options) for k in chosen)
    return Series(times[chosen], times[chosen] - times[np.array(chosen) - 1], values)


def _at(s: Snapshot, function: Callable[..., T], arguments: tuple[Any, ...], options: dict[str, Any]) -> T:
    """The measure at one frame, for which arguments may be made."""

    def made(value: Any) -> Any:
        return value(s) if callable(value) else value

    return function(s, *map(made, arguments), **{key: made(value) for key, value in options.items()})


def over_regions(
    source: Source,
    function: Callable[..., T],
    regions: Iterable[Region],
    frame: int = -1,
    **options: Any,
) -> Profile[T]:
    """`function(snapshot, region=region, **options)` for each of the regions.

    profile = over_regions(result, stress, layers(box, "z", 20))
    profile.centre[:, 2], profile["pressure"]
    """
    s = snapshot(source, frame)
    regions = tuple(regions)
    return Profile(regions, tuple(function(s, region=region, **options) for region in regions))
