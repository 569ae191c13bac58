"""The keys of sizes: diameters of balls of one size or many, as `[[packing]]` and `[[inflow]]` have them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from carom.scene.packing import Sizes
from carom.scene.packing import sizes as laws
from carom.scene.tables.base import Table
from carom.scene.tables.fields import Choice, Quantity, inside, refuse
from carom.scene.tables.lists import Vector, Vectors, as_list
from carom.scene.tables.quantities import Length, key

SIZES: dict[str, tuple[str, ...]] = {
    "equal": ("diameter",),
    "uniform": ("smallest", "largest"),
    "normal": ("mean", "deviation", "smallest", "largest"),
    "lognormal": ("mean", "deviation", "smallest", "largest"),
    "table": ("classes",),
}
"""Keys that each law of sizes needs; it takes no others of them."""


@dataclass(frozen=True)
class SizeClass(Vector):
    """One class of a table of sizes: a diameter in m or with a unit, and a share."""

    size: int = 2
    form: str = "[diameter, share]"

    def check(self, value: Any) -> tuple[float, ...]:
        value = as_list(value)
        if isinstance(value, list | tuple) and value and isinstance(value[0], str):
            try:
                value = [Quantity("length").check(value[0]), *value[1:]]
            except PydanticCustomError as e:
                raise inside(0, e) from None
        return super().check(value)

    def json_schema(self) -> dict[str, Any]:
        items = [Quantity("length").json_schema(), Quantity().json_schema()]
        return {"type": "array", "prefixItems": items, "minItems": self.size, "maxItems": self.size}


CLASS = SizeClass()


class Sized(Table):
    """A table whose balls have diameters drawn from a law."""

    sizes: Annotated[str, Choice(tuple(SIZES))] = key(
        "law of the diameters: equal, uniform, normal, lognormal, table", default="equal"
    )
    diameter: Length | None = key("equal: of all balls", "m", default=None, examples=["10 mm"])
    mean: Length | None = key(
        "normal, lognormal: mean diameter, before the limits cut the law",
        "m",
        default=None,
        examples=["10 mm"],
    )
    deviation: Length | None = key(
        "normal, lognormal: standard deviation of the diameter, before the limits cut the law",
        "m",
        default=None,
        examples=["2 mm"],
    )
    smallest: Length | None = key(
        "uniform, normal, lognormal: smallest diameter", "m", default=None, examples=["6 mm"]
    )
    largest: Length | None = key(
        "uniform, normal, lognormal: largest diameter", "m", default=None, examples=["15 mm"]
    )
    classes: Annotated[tuple[tuple[float, float], ...], Vectors(CLASS, 1, 1000)] | None = key(
        "table: [diameter, share] of each class", default=None, examples=[[["5 mm", 0.7], ["10 mm", 0.3]]]
    )
    shares: Annotated[str, Choice(("number", "mass"))] = key(
        "table: what the shares are of, number or mass; they need not add up to 1", default="number"
    )

    @model_validator(mode="after")
    def _one_law(self) -> Self:
        exactly(self._sizes_given(), "sizes", self.sizes, SIZES)
        if self.smallest and self.largest and self.smallest > self.largest:
            raise refuse("smallest is above largest", "exchange them")
        for place, entry in enumerate(self.classes or ()):
            if min(entry) <= 0:
                part = "classes", place
                raise refuse(
                    "diameters and shares of the table must be positive", "leave out empty classes", part
                )
        return self

    def _sizes_given(self) -> Mapping[str, Any]:
        """The keys of sizes by name; a table that says the size in another way adds what that means."""
        return self.__dict__

    def law(self) -> Sizes:
        """The law of sizes, for `carom.packing`."""
        if self.sizes == "equal":
            return laws.Equal(self._sizes_given()["diameter"])
        if self.sizes == "table":
            diameters, shares = zip(*(self.classes or ()), strict=True)
            return laws.Table(diameters, shares, self.shares == "mass")
        limits = self.smallest or 0.0, self.largest or 0.0
        if self.sizes == "uniform":
            return laws.Uniform(*limits)
        kind = laws.Normal if self.sizes == "normal" else laws.Lognormal
        return kind(self.mean or 0.0, self.deviation or 0.0, *limits)


def exactly(given: Mapping[str, Any], key: str, kind: str, needed: Mapping[str, tuple[str, ...]]) -> None:
    """Refuses keys that a kind of region or sizes does not have, and the absence of those that it needs."""
    words = f'{key} = "{kind}"'
    missing = [name for name in needed[kind] if given.get(name) is None]
    if missing:
        raise refuse(f"{words} needs {' and '.join(missing)}", f"give {', '.join(needed[kind])}")
    others = {name for names in needed.values() for name in names} - set(needed[kind])
    stray = sorted(name for name in others if given.get(name) is not None)
    if stray:
        cure = f"remove it, or give another {key}: its keys are {', '.join(needed[kind])}"
        raise refuse(f"{words} has no key {stray[0]}", cure)
