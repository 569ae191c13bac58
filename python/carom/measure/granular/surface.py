"""The shape of what lies there: the angle of a heap and the run-out of a column."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64, I64, Bool, connected
from carom.errors import CaromError, CaromWarning
from carom.measure.granular.nearest import around, middle, opened
from carom.measure.granular.shown import Measure
from carom.measure.granular.snapshot import Snapshot, Source, snapshot
from carom.numeric import is_number, is_whole
from carom.result.data import RunData
from carom.result.selection import Selection
from carom.scene.packing.neighbours import pairs, separation

_LOOSE = 0.5  # mean diameters between the surfaces of neighbours in a deposit
_APART = 0.1  # share of the balls that may be apart from a column
_MOST_PAIRS = 500_000  # of the points of a surface
_UPRIGHT = 0.7  # cosine between an axis and gravity from which it is vertical rather than horizontal
_FLAT = 6.0  # an angle is too low by this over the fourth power of the height in diameters: cones of 5 to 25 degrees
_LOW = 2.0  # height in diameters, below which that is a large part of the angle, or more than the whole
_ROUNDS = 3  # of choosing the part of a planar slope from the line fitted before


@dataclass(frozen=True, repr=False)
class HeapAngle(Measure):
    """The slope of a free surface."""

    angle: float
    """rad."""
    error: float
    """Standard error by leaving out one sector after the other (jackknife), rad; nan of a single sector."""
    inner: float
    """Angle of the nearer half of the used points (from the axis, or along the direction), rad; nan for too few points."""
    outer: float
    """Angle of the other half, rad. A straight slope has the same in both; a dome is steeper outside."""
    apex: float
    """Height at which the fitted line meets the axis (radial) or the origin (planar), m."""
    distance: F64
    """From the axis or along the direction, of the highest balls, (M,), m."""
    height: F64
    """Of their highest points, (M,), m."""
    used: Bool
    """Which of them the line was fitted to, (M,)."""

    @property
    def degrees(self) -> float:
        """The angle in degrees."""
        return float(np.degrees(self.angle))


def heap_angle(
    source: Source,
    frame: int = -1,
    *,
    shape: str = "radial",
    centre: Sequence[float] | None = None,
    direction: Sequence[float] = (1.0, 0.0, 0.0),
    sectors: int = 12,
    cell: float = 1.0,
    between: tuple[float, float] = (0.2, 0.8),
) -> HeapAngle:
    """Angle of the free surface of a heap against the horizontal.

    `shape` "radial": a heap about an axis through `centre` (by default that of the mass); "planar": a slope that falls along
    `direction`. Seen from above it is cut in cells of equal area, about `cell` mean diameters wide, and the highest ball of
    each is taken for the surface: in larger cells the highest would be higher. Balls apart from the largest group (as in
    `run_out`) do not count. The line through the highest balls is that of Theil and Sen, the median of the slopes of all
    pairs, of which a quarter may be wild. It is fitted `between` two parts of the slope (radial: of the way from the axis to
    the foot; planar: of the height, on the line), since falling grains flatten the tip (Grasselli and Herrmann, Granular
    Matter 3, 201, 2001) and the foot runs out in a tail (Alonso and Herrmann, Phys. Rev. Lett. 76, 4911, 1996). The error is
    from `sectors` about the axis (planar: strips along it). In a world that repeats itself the images nearest to the axis
    count; of a slope one period, cut where it leaves the ground free.

    Without a standard error an angle says nothing, so a floor that is nearly empty is refused; with `sectors=1` none is
    asked for, and `error` is nan.

    The foot is taken twice as far as half of the solid reaches, as in a cone: no single grain moves it. In cones of 22 to 26
    degrees cut out of random packings, 18 diameters in radius, the angle is 0.05 degrees too low on average and scatters by
    0.2, which is the stated error. Low heaps are found too flat, for balls lie on the ground in layers, and the lowest has
    no slope: by a part of the angle of `6/h^4`, h the height in mean diameters. A warning says where that is twice the error
    or more. The angle of a heap that is no cone depends on the part: compare `inner` and `outer`.

    Raises:
        CaromError: fewer than three balls side by side or on the slope; too few for a standard error; an unknown shape; a
            vertical direction.
    """
    if not (is_number(cell) and cell > 0):
        raise CaromError(f"heap_angle: cell = {cell!r}; give a number above 0, of mean diameters")
    if (
        np.ndim(between) != 1
        or len(between) != 2
        or not all(map(is_number, between))
        or between[0] >= between[1]
    ):
        raise CaromError(f"heap_angle: between = {between}; give two parts of the slope, the lower one first")
    s, _ = _deposit(_not_sheared(snapshot(source, frame)), _LOOSE)
    x, axis = opened(s.position, s.period), None
    if len(x) and shape == "radial":
        axis = _axis(s, centre)
        x = around(x, axis, _level(s))
    height = x @ s.up + s.radius
    distance, sector, aside = _seen_from_above(s.up, x, shape, axis, direction, sectors)
    if len(x) < 3 or np.ptp(distance) == 0.0:
        raise CaromError("a heap has at least three balls side by side; take another frame")
    foot, ground = 2.0 * _half(distance, s.volume), float((height - 2.0 * s.radius).min())
    width = cell * 2.0 * float(s.radius.mean())
    row = np.floor((distance - (distance.min() if shape == "planar" else 0.0)) / width)
    if shape == "planar":
        column = np.floor(aside / width)
    else:  # turns: as many cells to a ring as its length has room for
        many = np.rint(2.0 * np.pi * (row + 0.5))
        column = np.minimum(np.floor(aside * many), many - 1.0)
    _, place = np.unique(np.stack([row, column], axis=1), axis=0, return_inverse=True)
    top = _highest(place.ravel(), height)
    distance, height, sector = distance[top], height[top], sector[top]
    if shape == "planar":
        used = _on_the_line(distance, height, between)
    else:
        used = (distance >= between[0] * foot) & (distance <= between[1] * foot)
    if not _enough(distance[used]):
        raise CaromError("too few balls on the slope for a fit; give fewer sectors, or a wider `between`")
    slope, apex = _theil_sen(distance[used], height[used])
    high = (apex + max(slope * distance.min(), slope * distance.max()) - ground) / (width / cell)
    near = distance <= np.median(distance[used])
    inner, outer = (_angle(distance[k], height[k]) for k in (used & near, used & ~near))
    angles = np.array([_angle(distance[k], height[k]) for k in _leave_one_out(used, sector)])
    n = len(angles)
    if n < 2 and sectors > 1:
        raise CaromError(
            f"heap_angle: {int(used.sum())} balls are on the slope, in {len(np.unique(sector[used]))} of {sectors} sectors:"
            " too few for a standard error; take a frame with a heap, or sectors=1 for an angle without error"
        )
    error = float(np.sqrt((n - 1) / n * ((angles - angles.mean()) ** 2).sum())) if n > 1 else float("nan")
    share = _FLAT / max(1.0, high) ** 4
    off = share * abs(float(np.arctan(slope)))
    if share > 0.01 and not off <= 2.0 * error:  # also where no error is asked for
        beyond = ", twice its error or more" if n > 1 else ""
        much = f"about {np.degrees(off):.1g} degrees too flat{beyond}"
        warnings.warn(
            f"heap_angle: the heap is {high:.1f} mean diameters high, and the layer on the ground, which has no slope, makes"
            f" it {much if high >= _LOW else 'too low to tell its angle'}; take more or smaller grains",
            CaromWarning,
            stacklevel=2,
        )
    return HeapAngle(float(np.arctan(-slope)), error, inner, outer, apex, distance, height, used)


def _half(distance: F64, volume: F64) -> float:
    """The distance within which half of the solid lies, m."""
    order = np.argsort(distance)
    total = np.cumsum(volume[order])
    return float(distance[order][np.searchsorted(total, 0.5 * total[-1])])


def _on_the_line(distance: F64, height: F64, between: tuple[float, float]) -> Bool:
    """The points whose height, on the line fitted to them, lies between two parts of the whole."""
    low, high = float(np.quantile(height, 0.02)), float(height.max())
    least, most = (low + part * (high - low) for part in between)
    used = (height >= least) & (height <= most)
    for _ in range(_ROUNDS):
        if not _enough(distance[used]):
            break
        slope, apex = _theil_sen(distance[used], height[used])
        on_line = apex + slope * distance
        chosen = (on_line >= least) & (on_line <= most)
        if slope >= 0 or np.count_nonzero(chosen) < 3:
            break
        used = chosen
    return np.asarray(used)


def _enough(distance: F64) -> bool:
    """Whether a line can be fitted."""
    return len(distance) >= 3 and bool(np.ptp(distance) > 0.0)


def _angle(distance: F64, height: F64) -> float:
    """rad, positive where it falls; nan where no line can be fitted."""
    return float(np.arctan(-_theil_sen(distance, height)[0])) if _enough(distance) else float("nan")


def _not_sheared(s: Snapshot) -> Snapshot:
    """A heap leaves a part of the period free, which images that are displaced would fill."""
    if s.box is not None and s.box.sheared:
        raise CaromError(
            "heap_angle and run_out know no periodic box that is sheared; take a frame without shear"
        )
    return s


def _deposit(s: Snapshot, loose: float) -> tuple[Snapshot, int]:
    """The largest group of balls whose neighbours are nearer than `loose` mean diameters, and how many others there are."""
    there = s.present
    x, radius = s.position[there], s.radius[there]
    a, b = pairs(x, radius + loose * float(radius.mean()), s.period) if len(there) else (there, there)
    label = connected(len(there), a, b)
    main = label == np.bincount(label, minlength=1).argmax()
    return Snapshot(x[main], radius[main], gravity=s.gravity, period=s.period), int((~main).sum())


def _axis(s: Snapshot, centre: Sequence[float] | None) -> F64:
    """A point of the axis, (3,) m: the one given, or the middle of the solid."""
    if centre is None:
        return middle(s.position[s.present], s.volume[s.present], s.period)
    given = np.asarray(centre, dtype=np.float64)
    if given.shape != (3,) or not np.isfinite(given).all():
        raise CaromError(f"centre = {centre}; give a point of the axis, x, y and z in m")
    return given


def _level(s: Snapshot) -> F64 | None:
    """The period along axes that are nearly horizontal: of the others no image is nearer to an upright line."""
    return None if s.period is None else np.where(np.abs(s.up) < _UPRIGHT, s.period, 0.0)


def _seen_from_above(
    up: F64, x: F64, shape: str, axis: F64 | None, direction: Sequence[float], sectors: int
) -> tuple[F64, I64, F64]:
    """Distance of each ball from the axis or along the direction, its sector or strip, and its place across: the part of a
    turn, or m from the first strip. The axis goes through the origin if None.
    """
    if not is_whole(sectors) or sectors < 1:
        raise CaromError(f"sectors = {sectors!r}; give a whole number from 1")
    if shape not in ("radial", "planar"):
        raise CaromError(f"unknown shape {shape!r}; known: radial, planar")
    if shape == "planar":
        along, across = _horizontal(up, direction)
        aside = x @ across
        aside = aside - aside.min(initial=np.inf)
        part = aside / max(float(aside.max(initial=0.0)), 1e-300)
        return x @ along, np.minimum((part * sectors).astype(np.int64), sectors - 1), aside
    first, second = _horizontal(up, (1.0, 0.0, 0.0) if abs(up[0]) < 0.9 else (0.0, 1.0, 0.0))
    away = x if axis is None else x - axis
    u, v = away @ first, away @ second
    turn = np.arctan2(v, u) / (2.0 * np.pi) + 0.5
    return np.hypot(u, v), np.minimum((turn * sectors).astype(np.int64), sectors - 1), turn


def _horizontal(up: F64, direction: Sequence[float]) -> tuple[F64, F64]:
    """Unit vectors in the horizontal plane: along a direction, and across it."""
    given = np.asarray(direction, dtype=np.float64)
    along = given - (given @ up) * up
    if np.linalg.norm(along) < 1e-9 * np.linalg.norm(given) or not given.any():
        raise CaromError("the direction is vertical; give one along the ground")
    along /= np.linalg.norm(along)
    return along, np.cross(up, along)


def _highest(cell: I64, height: F64) -> I64:
    """The highest of each cell."""
    order = np.lexsort((height, cell))
    last = np.append(np.diff(cell[order]) != 0, True)
    return np.asarray(order[last])


def _theil_sen(x: F64, y: F64) -> tuple[float, float]:
    n = len(x)
    if n * n <= 2 * _MOST_PAIRS:
        i, j = np.triu_indices(n, 1)
    else:  # each with some others, evenly spread
        others = max(1, _MOST_PAIRS // n)
        i, k = np.divmod(np.arange(n * others), others)
        j = (i + (2 * k + 1) * n // (2 * others)) % n
    apart = np.abs(x[i] - x[j]) > 0.1 * np.ptp(x)  # neighbours say nothing of the slope
    slope = float(np.median((y[i] - y[j])[apart] / (x[i] - x[j])[apart]))
    return slope, float(np.median(y - slope * x))


def _leave_one_out(used: Bool, sector: I64) -> list[Bool]:
    """The chosen points without those of each sector in turn."""
    parts = [used & (sector != k) for k in np.unique(sector[used])]
    return [part for part in parts if np.count_nonzero(part) >= 3]


@dataclass(frozen=True, repr=False)
class RunOut(Measure):
    """How far a column has run out, and how high it was and is."""

    initial: float
    """Radius (planar: length) of the column at the start, m."""
    final: float
    """The same of the deposit, m."""
    error: float
    """Standard error of `final` from sector to sector, m."""
    initial_height: float
    """m."""
    final_height: float
    """m."""
    strays: int
    """Balls that rolled away from the deposit and do not count."""

    @property
    def ratio(self) -> float:
        """(final - initial) / initial."""
        return (self.final - self.initial) / self.initial

    @property
    def aspect(self) -> float:
        """Height over radius (or length) of the column at the start, a."""
        return self.initial_height / self.initial

    @property
    def settled(self) -> float:
        """Height of the deposit over the initial radius (or length)."""
        return self.final_height / self.initial


def run_out(
    result: RunData | Selection | tuple[Snapshot, Snapshot],
    frame: int = -1,
    *,
    start: int = 0,
    shape: str = "radial",
    centre: Sequence[float] | None = None,
    direction: Sequence[float] = (1.0, 0.0, 0.0),
    sectors: int = 12,
    loose: float = _LOOSE,
) -> RunOut:
    """Run-out of a column between two frames, or two snapshots.

    `shape` "radial": about an axis through `centre`, by default that of the mass at the start; "planar": along `direction`,
    from the rear of the column at the start. Column and deposit are the largest groups of balls at both frames in which
    neighbours are nearer than `loose` mean diameters; the front is the furthest of these balls in each of the `sectors`
    (strips), averaged over them. Images in a world that repeats itself are chosen as in `heap_angle`.

    Grains of a packing that have not fallen yet are far apart, and the group is a part of them, which a warning says: give
    a `start` at which they have settled, or a larger `loose`.

    Raises:
        CaromError: no ball is there at one of the two frames; an unknown shape; a vertical direction.
    """
    before, after = (
        result if isinstance(result, tuple) else (snapshot(result, start), snapshot(result, frame))
    )
    if not (is_number(loose) and loose >= 0):
        raise CaromError(f"run_out: loose = {loose!r}; give a number from 0, of mean diameters")
    (column, apart), (deposit, strays) = (_deposit(_not_sheared(s), loose) for s in (before, after))
    for name, s in (("start", column), ("frame", deposit)):
        if not len(s.present):
            raise CaromError(
                f"run_out: no ball is there at the frame of `{name}`; give one in which some are"
            )
    axis = _axis(column, centre) if shape == "radial" else None
    views = []
    for s, at in zip((column, deposit), _images_of_one(column, deposit, axis), strict=True):
        distance, sector, _ = _seen_from_above(s.up, at, shape, axis, direction, sectors)
        views.append((distance, sector, s.radius[s.present], at @ s.up))
    rear = 0.0
    if shape == "planar":
        distance, _, r, _ = views[0]
        rear = float((distance - r).min())
    fronts, errors = [], []
    for distance, sector, r, _ in views:
        edge = distance + r - rear
        front = np.array([edge[sector == k].max() for k in np.unique(sector)])
        fronts.append(float(front.mean()))
        errors.append(float(front.std(ddof=1) / np.sqrt(len(front))) if len(front) > 1 else float("nan"))
    ground = float((views[0][3] - views[0][2]).min())
    heights = [float((z + r).max()) - ground for _, _, r, z in views]
    if apart > _APART * (apart + len(column.present)):
        warnings.warn(
            f"run_out: {apart} of {apart + len(column.present)} balls at the frame of `start` are apart from the column;"
            " give a frame at which they have settled, or a larger `loose`",
            CaromWarning,
            stacklevel=2,
        )
    return RunOut(fronts[0], fronts[1], errors[1], heights[0], heights[1], strays)


def _images_of_one(before: Snapshot, deposit: Snapshot, axis: F64 | None) -> tuple[F64, F64]:
    """Places of the balls of a column and of its deposit, m: images nearest to the axis, or with middles near each other."""
    first, last = (opened(s.position[s.present], s.period) for s in (before, deposit))
    if axis is not None:
        return around(first, axis, _level(before)), around(last, axis, _level(deposit))
    apart = last.mean(axis=0) - first.mean(axis=0)
    return first, last + (separation(apart, deposit.period) - apart)
