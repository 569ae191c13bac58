"""Sizes of tables and values of materials, each with its source. Change any: `replace(LAWS, cloth_friction=0.3)`."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

from pydantic_core import PydanticCustomError

from carom.errors import CaromError
from carom.scene.tables.fields import NOT_NEGATIVE
from carom.scene.tables.laws import Law, value_at
from carom.units import number

INCH = 0.0254
OUNCE = 0.028349523125

WPA = "WPA tournament table & equipment specifications (2001)"
WPBSA = "WPBSA official rules of snooker, section 1"
UMB = "UMB rules of carom billiards, chapter on equipment"
POOLTOOL = "default of pooltool (E. Kiefl)"
ALCIATORE = "D. Alciatore's list of physical properties (billiards.colostate.edu/threads/physics.html)"
MARLOW = "fit of D. Alciatore, TP A.14, to W. C. Marlow, The Physics of Pocket Billiards (1995); eq. 51 of the paper"
MATHAVAN_CUSHION = (
    "S. Mathavan, M. R. Jackson, R. M. Parkin, Proc. IMechE C 224 (2010) 1863: snooker, v < 2.5 m/s"
)


class Value(float):
    """A number in SI that knows its unit, its usual range and its source; it computes as any number does."""

    unit: str
    source: str
    low: float | None
    high: float | None

    def __new__(
        cls, value: float, unit: str, source: str, low: float | None = None, high: float | None = None
    ) -> Value:
        self = super().__new__(cls, value)
        self.unit, self.source, self.low, self.high = unit, source, low, high
        return self

    def __getnewargs__(self) -> tuple[Any, ...]:
        """What copies and pickles are made from."""
        return float(self), self.unit, self.source, self.low, self.high

    @property
    def value(self) -> float:
        """The plain number."""
        return float(self)

    def __repr__(self) -> str:
        return f"Value({self})"

    def __str__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        usual = "" if self.low is None or self.high is None else f" ({self.low:g} to {self.high:g})"
        return f"{float(self):g}{usual}{unit}: {self.source}"


EFFICIENCY = "D. Alciatore, experiment of billiards.colostate.edu/faq/cue-tip/efficiency"
TIPS: dict[str, Value] = {
    "leather": Value(0.73, "1", f"middle of {EFFICIENCY}: playing cues, tips of medium hardness", 0.71, 0.75),
    "phenolic": Value(0.84, "1", f"middle of {EFFICIENCY}: jump and break cues", 0.81, 0.87),
}
"""Restitution of cue tips against a ball, by what they are made of."""


@dataclass(frozen=True)
class Spec:
    """A kind of table with its balls. Lengths in m; the playing area is from nose to nose."""

    name: str
    length: float
    width: float
    ball_radius: float
    ball_mass: float
    nose_height: float
    corner_mouth: float = 0.0
    """Distance of the two points of a corner pocket; 0: no pockets."""
    side_mouth: float = 0.0
    corner_angle: float = math.radians(142)
    """Between nose and facing, rad."""
    side_angle: float = math.radians(104)
    corner_shelf: float = 0.0
    """From the middle of the mouth to the edge of the slate."""
    side_shelf: float = 0.0
    source: str = ""


def _pool(name: str, length: float, width: float, source: str) -> Spec:
    return Spec(
        name,
        length,
        width,
        ball_radius=2.25 * INCH / 2,
        ball_mass=6.0 * OUNCE,
        nose_height=0.635 * 2.25 * INCH,
        corner_mouth=4.5625 * INCH,
        side_mouth=5.0625 * INCH,
        corner_shelf=1.625 * INCH,
        side_shelf=0.1875 * INCH,
        source=source,
    )


TABLES: dict[str, Spec] = {
    "7ft": _pool(
        "7ft",
        78 * INCH,
        39 * INCH,
        f"area: as coin-operated tables are sold, and {POOLTOOL}; all else as of the larger tables, {WPA}",
    ),
    "8ft": _pool("8ft", 92 * INCH, 46 * INCH, WPA),
    "9ft": _pool("9ft", 100 * INCH, 50 * INCH, WPA),
    "snooker": Spec(
        "snooker",
        3.569,
        1.778,
        ball_radius=0.0525 / 2,
        ball_mass=0.142,
        nose_height=0.7 * 0.0525,
        corner_mouth=0.0889,
        side_mouth=0.105,
        corner_angle=math.radians(140),
        side_angle=math.radians(110),
        corner_shelf=0.03,
        side_shelf=0.01,
        source=f"area and ball: {WPBSA}; nose height 7/5 r: Mathavan et al. (2010); pockets: rough, the rules refer to"
        " templates, and their cushions are round where these are straight",
    ),
    "carom": Spec("carom", 2.84, 1.42, ball_radius=0.0615 / 2, ball_mass=0.21, nose_height=0.037, source=UMB),
}
"""By name."""

# WPBSA, section 1, rule 1: lines and spots of a snooker table, m, from the faces of the cushions.
BAULK, D_RADIUS, BLACK = 0.737, 0.292, 0.324
SNOOKER = ("yellow", "green", "brown", "blue", "pink", "black")
"""Snooker's coloured balls, which have spots of their own."""


SLIPS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""At which laws of friction are looked at, m/s: shots have slips up to there."""


@dataclass(frozen=True)
class Laws:
    """Contact laws of a table. A bare number becomes a `Value` in the same unit with the source "given by the caller"."""

    # ruff: noqa: RUF009 - defaults are computed once; a `Value` is a number, which nothing changes.
    # The ranges are those of `ALCIATORE` unless said otherwise.
    ball_restitution: Value = Value(0.95, "1", POOLTOOL, 0.92, 0.98)
    ball_friction: str | float = "9.951e-3 + 0.108*exp(-1.088*v)"
    """mu of the slip speed v, m/s: 0.11 at 0.07, 0.06 at 0.7, 0.01 at 7 m/s; see `MARLOW`."""
    cloth_friction: Value = Value(0.2, "1", POOLTOOL, 0.15, 0.4)
    cloth_restitution: Value = Value(0.5, "1", ALCIATORE)
    rolling_deceleration: Value = Value(0.01, "g", POOLTOOL, 0.005, 0.015)
    """Of a rolling ball of the table's radius, over g."""
    spin_deceleration: Value = Value(10.0, "rad/s^2", f"middle of {ALCIATORE}", 5.0, 15.0)
    """Of a ball of the table's radius that spins in its place."""
    cushion_restitution: Value = Value(0.85, "1", f"the paper, section 5.6; {POOLTOOL}", 0.6, 0.9)
    """Of the speed across the rail of a ball on the bed. Laws of springs, as `compliant` and `penalty`, keep less: they load
    bed and nose at once. Mathavan's 0.98 belongs to another law, of the energy."""
    cushion_friction: Value = Value(0.14, "1", f"{MATHAVAN_CUSHION}; upper end: {POOLTOOL}", 0.14, 0.2)

    def __post_init__(self) -> None:
        for field in fields(self):
            given, usual = getattr(self, field.name), field.default
            if isinstance(usual, str) and isinstance(given, str):
                _check_friction(field.name, given)
                continue
            unit = usual.unit if isinstance(usual, Value) else "1"
            value = number("Laws", field.name, given, unit="without a unit" if unit == "1" else f"in {unit}")
            most = 1.0 if field.name.endswith("restitution") else math.inf
            if not 0 <= value <= most:
                span = "from 0 to 1" if most == 1 else "0 or more"
                raise CaromError(f"Laws: {field.name} must be {span}, found {value:g}")
            if isinstance(usual, Value) and not isinstance(given, Value):
                sourced = Value(value, unit, "given by the caller")
                object.__setattr__(self, field.name, sourced)  # the only way in a frozen dataclass

    def __str__(self) -> str:
        """A line for each value: the usual range, the unit, the source."""
        lines = []
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, str):
                value = f"{value}, v the slip speed in m/s" + (
                    f": {MARLOW}" if value == field.default else ""
                )
            lines.append(f"{field.name} = {value}")
        return "\n".join(lines)

    def rolling_radius(self, radius: float) -> float:
        """rho, m: a ball that rolls under the moment rho N slows down by 5 rho g/(7 r)."""
        return 1.4 * self.rolling_deceleration * radius

    def spinning_radius(self, radius: float, gravity: float) -> float:
        """delta, m: spin about the vertical decays by delta m g/I, I = 2/5 m r^2."""
        return 0.4 * radius * radius * self.spin_deceleration / gravity


def _check_friction(name: str, given: str) -> None:
    """Refuse a law of the slip speed that cannot be read, or is negative at one that a shot may have."""
    try:
        law = Law("v", bounds=NOT_NEGATIVE).check({"expression": given})
    except PydanticCustomError as error:
        told = error.context or {}
        raise CaromError(f"Laws: {name}: {told['cause']}; {told['cure']}") from None
    for slip in SLIPS:
        if not (mu := value_at(law, slip)) >= 0:
            raise CaromError(
                f"Laws: {name} is {mu:.4g} at a slip of {slip:g} m/s; write max(0, ...) around it"
            )


LAWS = Laws()
