"""Types of the values that are lists: vectors, directions, quaternions, whole numbers.

They are checked element by element, so that a message says which one is wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic_core import PydanticCustomError

from carom import units
from carom.errors import quoted
from carom.scene.assembly.vectors import norm, scaled
from carom.scene.tables.fields import ANY, POSITIVE, Bounds, Checked, Integer, Quantity, inside, refuse

T = TypeVar("T")


def each(values: Iterable[Any], check: Callable[[Any], T]) -> list[T]:
    """All `values` of a list, checked; an error says which one it is about."""
    found = []
    for place, value in enumerate(values):
        try:
            found.append(check(value))
        except PydanticCustomError as e:
            raise inside(place, e) from None
    return found


def as_list(value: Any) -> Any:
    """NumPy arrays, which come from Python, as lists; all else as it is."""
    tolist = getattr(value, "tolist", None)
    return tolist() if callable(tolist) else value


@dataclass(frozen=True)
class Vector(Checked):
    """`size` quantities of one dimension, none larger than `most` in size; stored as a tuple of floats."""

    dimension: str = "number"
    size: int = 3
    most: float | None = None
    form: str = ""
    """How one is written, where its entries are no coordinates: `[diameter, share]`."""

    def check(self, value: Any) -> tuple[float, ...]:
        value = as_list(value)
        if not isinstance(value, list | tuple) or len(value) != self.size:
            found = f"a list of {len(value)}" if isinstance(value, list | tuple) else quoted(value)
            raise refuse(f"expected a list of {self.size} numbers, found {found}", f"write {self._example()}")
        return tuple(each(value, self._item().check))

    def _item(self) -> Quantity:
        return Quantity(self.dimension, ANY if self.most is None else Bounds(ge=-self.most, le=self.most))

    def _example(self) -> str:
        si = units.DIMENSIONS[self.dimension][1]
        return self.written() + (f" in {si}, or strings with units" if si else "")

    def written(self) -> str:
        """`[x, y, z]`, for messages."""
        letters = ["w", "x", "y", "z"] if self.size == 4 else ["x", "y", "z"][: self.size]
        return self.form or f"[{', '.join(letters)}]"

    def json_schema(self) -> dict[str, Any]:
        items = self._item().json_schema()
        return {"type": "array", "items": items, "minItems": self.size, "maxItems": self.size}


@dataclass(frozen=True)
class Direction(Vector):
    """Three numbers, not all zero, kept as written (the arrays of the model hold unit vectors)."""

    example: str = "[0.0, 0.0, 1.0]"

    def check(self, value: Any) -> tuple[float, ...]:
        vector = super().check(value)
        if norm(vector) == 0:
            raise refuse("a direction must not be zero", f"write for example {self.example}")
        return vector


@dataclass(frozen=True)
class Lengths(Vector):
    """`size` lengths within `bounds`."""

    dimension: str = "length"
    bounds: Bounds = POSITIVE

    def _item(self) -> Quantity:
        return Quantity(self.dimension, self.bounds)


@dataclass(frozen=True)
class Vectors(Checked):
    """`least` to `most` vectors of one kind, as a tuple."""

    kind: Vector
    least: int
    most: int

    def check(self, value: Any) -> tuple[tuple[float, ...], ...]:
        value = as_list(value)
        if not isinstance(value, list | tuple) or not self.least <= len(value) <= self.most:
            found = f"a list of {len(value)}" if isinstance(value, list | tuple) else quoted(value)
            counts = str(self.least) if self.least == self.most else f"{self.least} to {self.most}"
            raise refuse(f"expected {counts} vectors, found {found}", f"write [{self.kind.written()}, ...]")
        return tuple(each(value, self.kind.check))

    def json_schema(self) -> dict[str, Any]:
        items = self.kind.json_schema()
        return {"type": "array", "items": items, "minItems": self.least, "maxItems": self.most}


@dataclass(frozen=True)
class BallPlace(Vector):
    """Centre and radius of a ball, the radius above 0."""

    dimension: str = "length"
    size: int = 4
    form: str = "[x, y, z, radius]"

    def check(self, value: Any) -> tuple[float, ...]:
        place = super().check(value)
        if not place[3] > 0:
            raise inside(3, refuse(f"a radius must be positive, found {place[3]:g}", "write one above 0"))
        return place


@dataclass(frozen=True)
class Tensor(Checked):
    """A tensor of inertia: the moments about the axes, or these and Jxy, Jxz, Jyz, as a tuple of 3 or 6."""

    def check(self, value: Any) -> tuple[float, ...]:
        value = as_list(value)
        if not isinstance(value, list | tuple) or len(value) not in (3, 6):
            found = f"a list of {len(value)}" if isinstance(value, list | tuple) else quoted(value)
            cure = "write [J1, J2, J3] or [Jxx, Jyy, Jzz, Jxy, Jxz, Jyz] in kg m^2"
            raise refuse(f"expected a list of 3 or 6 moments of inertia, found {found}", cure)
        return tuple(each(value, Quantity("moment of inertia").check))

    def json_schema(self) -> dict[str, Any]:
        items = Quantity("moment of inertia").json_schema()
        return {"anyOf": [{"type": "array", "items": items, "minItems": n, "maxItems": n} for n in (3, 6)]}


@dataclass(frozen=True)
class Quaternion(Vector):
    """A unit quaternion, w first; kept as written (the arrays of the model hold it normalised)."""

    size: int = 4

    def check(self, value: Any) -> tuple[float, ...]:
        q = super().check(value)
        length = norm(q)
        if abs(length - 1) > 1e-6:
            unit = ", ".join(f"{x:.9g}" for x in scaled(q)) if length > 0 else "1.0, 0.0, 0.0, 0.0"
            raise refuse(f"a unit quaternion has length 1, found {length:.9g}", f"write [{unit}]")
        return q


@dataclass(frozen=True)
class Integers(Checked):
    """`size` whole numbers, as a tuple."""

    size: int
    bounds: Bounds = ANY

    def check(self, value: Any) -> tuple[int, ...]:
        value = as_list(value)
        if not isinstance(value, list | tuple) or len(value) != self.size:
            raise refuse(
                f"expected a list of {self.size} whole numbers, found {quoted(value)}", "write such a list"
            )
        return tuple(Integer(self.bounds).check(x) for x in value)

    def json_schema(self) -> dict[str, Any]:
        items = Integer(self.bounds).json_schema()
        return {"type": "array", "items": items, "minItems": self.size, "maxItems": self.size}
