"""The section `[run]`: what the numerical options of the core mean, in words and bounds.

Names and defaults come from `carom._core.defaults()` and the admitted names from `carom._core.choices()`: the
core states them once. Here each is given a unit, bounds and a sentence for the documentation. An option that
the core has and this page lacks still works (its type is that of its default); a test demands that both lists
agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import Field, create_model

from carom import _core
from carom.scene.tables.base import Table
from carom.scene.tables.fields import (
    ANY,
    NOT_NEGATIVE,
    POSITIVE,
    Bounds,
    Checked,
    Choice,
    Flag,
    Integer,
    Quantity,
    Text,
)
from carom.scene.tables.impact_laws import LAWS
from carom.scene.tables.quantities import key
from carom.units import DIMENSIONS

METHODS = tuple(_core.choices()["method"])
STEPPING = tuple(method for method in METHODS if method != "penalty")
"""Methods whose steps solve contact problems (`events` while balls press one another)."""
ALPHA = ("nsga", "events")


@dataclass(frozen=True)
class Option:
    """One numerical option: meaning, bounds, the dimension if it has a unit, and the methods that read it."""

    text: str
    bounds: Bounds = ANY
    dimension: str = "number"
    methods: tuple[str, ...] = METHODS

    @property
    def meaning(self) -> str:
        if self.methods == METHODS:
            return self.text
        [first, *more] = self.methods
        without = ", ".join(m for m in METHODS if m not in self.methods)
        return f"not {without}: {self.text}" if more else f"{first} only: {self.text}"


_FRACTION = Bounds(gt=0, lt=1)
_COUNT = Bounds(ge=1, le=1_000_000)
_COUNT_OR_NONE = Bounds(ge=0, le=1_000_000)

MOST_PROBLEMS = 100_000
"""The last problem of an impact sequence whose length is by size; that of the core (`options.rs`)."""

MOST_OVERLAP = 0.1
"""Overlap, in radii, that rigid contact does not have. Two balls that go by 0.05 radii a step, which gets no advice, overlap
by up to 0.1 at a hit in method moreau. In sound runs penalty stays below 0.04, and the other methods below 1e-3.
"""

OPTIONS: dict[str, Option] = {
    "step": Option("time step h", POSITIVE, "time"),
    "method": Option(
        "method in time; nsga is the nonsmooth generalized-alpha scheme, moreau Moreau-Jean time stepping,"
        " penalty continuous contact forces, events exact motion between impacts"
    ),
    "spectral_radius": Option(
        "rho_inf of eq. 7, damping of the highest frequencies", Bounds(ge=0, lt=1), methods=ALPHA
    ),
    "theta": Option(
        "weight of the new velocity in the step of the position", Bounds(gt=0, le=1), methods=("moreau",)
    ),
    "position_projection": Option("remove penetration after each step; velocities stay", methods=("moreau",)),
    "tolerance": Option(
        "tol_r of eq. 44, relative residual at which a sub-problem is solved", _FRACTION, methods=STEPPING
    ),
    "pile_tolerance": Option(
        "tol_r in islands of more than dense_contacts contacts", _FRACTION, methods=STEPPING
    ),
    "impact": Option("law for several impacts at once", methods=STEPPING),
    "position_friction": Option(
        "where friction of loads acts. once: loads are solved once, positions are"
        " corrected along normals. paper, as it always is by law sequence-paper: positions have a sub-problem with friction,"
        " as printed",
        methods=ALPHA,
    ),
    "solver": Option(
        "solver of the contact problems; auto chooses by the size of the island", methods=STEPPING
    ),
    "threads": Option("threads; the result has the same bits for any number", Bounds(ge=1, le=4096)),
    "contacts_per_thread": Option(
        "contacts of an island for each thread that sweeps it; the result has the same bits for any number",
        _COUNT,
        methods=STEPPING,
    ),
    "shared_contacts_per_thread": Option(
        "contacts and joints of smaller islands for each thread that shares them; the result has the"
        " same bits for any number",
        _COUNT,
        methods=STEPPING,
    ),
    "max_iterations": Option(
        "Newton iterations per sub-problem before the fallbacks begin",
        Bounds(ge=1, le=100_000),
        methods=STEPPING,
    ),
    "penalty_scale": Option("p of eq. 5 in units of 1/D_cc (rule R1)", Bounds(gt=0, lt=2), methods=STEPPING),
    "tolerance_floor": Option(
        "absolute floor of eq. 44, relative to m r (larger islands: touching_tolerance)",
        POSITIVE,
        methods=STEPPING,
    ),
    "gap_tolerance": Option(
        "largest gap of a closed contact after a solve, relative to r (an aim in larger islands)",
        _FRACTION,
        methods=STEPPING,
    ),
    "touching_tolerance": Option("gap below which a contact counts as touching, relative to r", _FRACTION),
    "proximal_shift": Option(
        "shift of the multiplier block where contacts are redundant", _FRACTION, methods=STEPPING
    ),
    "line_search": Option("halve a Newton step that does not reduce the residual", methods=STEPPING),
    "max_line_search": Option("halvings of one Newton step at most", Bounds(ge=0, le=60), methods=STEPPING),
    "max_problems": Option(
        "impact problems per island and step before a collective impact ends it; 0: by the size of the island",
        Bounds(ge=0, le=100_000),
        methods=STEPPING,
    ),
    "closing_tolerance_load": Option(
        "closing speed that counts, relative to what loads give its bodies in a step (R3); at most 1e5 times the tolerance",
        POSITIVE,
        methods=STEPPING,
    ),
    "closing_tolerance_speed": Option(
        "closing speed that counts, relative to the fastest body (R3)", POSITIVE, methods=STEPPING
    ),
    "energy_safeguard": Option(
        "scale restitution down where an impact problem would create energy (R4)", methods=STEPPING
    ),
    "impact_exponent": Option(
        "n of the springs F = k d^n of laws compliant and binary: 1.5 is Hertz, 1 linear",
        Bounds(ge=1, le=4),
        methods=STEPPING,
    ),
    "restitution_threshold": Option(
        "approach speed below which restitution is off", NOT_NEGATIVE, "speed", methods=STEPPING
    ),
    "dense_contacts": Option(
        "largest island, in contacts, that Newton's method solves with a dense, exact matrix",
        Bounds(ge=0, le=500),
        methods=STEPPING,
    ),
    "pile_contacts": Option(
        "largest island, in contacts, not solved by sweeps over spheres from the impulses of the last step",
        _COUNT_OR_NONE,
        methods=STEPPING,
    ),
    "gauss_seidel_sweeps": Option(
        "0: Newton's method alone in islands that are no piles; other numbers: other methods where it fails",
        Bounds(ge=0, le=1000),
        methods=STEPPING,
    ),
    "max_halvings": Option(
        "halvings of a step that is too fast or not solved, at most; at 4 one not solved is halved 8 times",
        Bounds(ge=0, le=20),
        methods=STEPPING,
    ),
    "penalty_law": Option(
        "damping of the contact force. exact has the restitution e_N, the others their own",
        methods=("penalty",),
    ),
    "penalty_young_modulus": Option(
        "Young's modulus of every body", POSITIVE, "pressure", methods=("penalty",)
    ),
    "penalty_poisson_ratio": Option(
        "Poisson's ratio of every body", Bounds(gt=-1, le=0.5), methods=("penalty",)
    ),
    "penalty_stiffness": Option(
        "K of every contact (N/m^n) in place of Hertz's; 0 is Hertz's", NOT_NEGATIVE, methods=("penalty",)
    ),
    "penalty_exponent": Option("n of the elastic force K d^n", Bounds(ge=1, le=4), methods=("penalty",)),
    "penalty_least_restitution": Option(
        "restitution as which laws without a finite damping at e_N = 0 read smaller ones",
        _FRACTION,
        methods=("penalty",),
    ),
    "penalty_friction": Option(
        "sliding friction; spring is a tangential spring that slips", methods=("penalty",)
    ),
    "penalty_slip_speed": Option(
        "slip speed of regularised friction; over the radius that of rolling and spinning",
        POSITIVE,
        "speed",
        methods=("penalty",),
    ),
    "penalty_resolution": Option("substeps per contact time", Bounds(ge=4, le=100_000), methods=("penalty",)),
    "pressing_step": Option(
        "longest step of nsga, which takes over while bodies press one another",
        POSITIVE,
        "time",
        methods=("events",),
    ),
    "on_nonconvergence": Option(
        "what to do with a step that could not be solved; warn goes on", methods=STEPPING
    ),
}


def kind(name: str, default: float | int | bool | str) -> Checked:
    """How values of the option `name` are checked: by its default's type and the table above."""
    option = OPTIONS.get(name, Option(""))
    if isinstance(default, bool):
        return Flag()
    if isinstance(default, int):
        return Integer(option.bounds)
    if isinstance(default, float):
        return Quantity(option.dimension, option.bounds)
    admitted = _core.choices().get(name)
    return Choice(tuple(admitted)) if admitted else Text(1)


def loads_once(options: Mapping[str, Any]) -> bool:
    """Whether a run with these options solves the loads of a step once, for velocities and positions."""
    printed = LAWS[options["impact"]].restitution == "printed"
    return options["method"] == "nsga" and not printed and options["position_friction"] == "once"


def stepping(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options of the steps that a run makes: those of `events` are of `nsga`, while balls press one another."""
    if options["method"] != "events":
        return dict(options)
    return {**options, "method": "nsga", "step": min(options["step"], options["pressing_step"])}


#: Names of the options of the core.
NAMES = tuple(_core.defaults())


class RunBase(Table):
    """The part of `[run]` that is not the core's."""

    section: ClassVar[str] = "run"

    until: Annotated[float, Quantity("time", POSITIVE)] | None = key(
        "simulated time; rounded up to a whole number of steps", "s", default=None, examples=[3.0]
    )
    step: float = Field(
        default_factory=lambda: float(_core.defaults()["step"])
    )  # checked as the others, below

    def options(self) -> dict[str, Any]:
        """The options of the core, every one with its value."""
        return {name: getattr(self, name) for name in NAMES}


def _fields() -> dict[str, Any]:
    found = {}
    for name, default in _core.defaults().items():
        option = OPTIONS.get(name, Option("(an option of the core that is not documented yet)"))
        unit = DIMENSIONS[option.dimension][1]
        field = key(option.meaning, unit, default=default, examples=[default])
        found[name] = (Annotated[type(default), kind(name, default)], field)
    return found


if TYPE_CHECKING:

    class Run(RunBase):
        """`[run]`; its further attributes are the options that `carom._core.defaults()` lists."""

        def __getattr__(self, name: str) -> Any: ...

else:
    Run = create_model(
        "Run",
        __base__=RunBase,
        __module__=__name__,
        __doc__="How to compute; keywords of `carom.simulate`.",
        **_fields(),
    )
