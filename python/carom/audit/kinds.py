"""The kinds of laws that an audit judges, in the order of its report."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Kind:
    """A law: its name, what it says, its unit, and where its bound comes from."""

    name: str
    law: str
    unit: str
    bound: str


_ROUNDING = "rounding of the numbers involved"
_SOLVER = "8 tol_r times the root of the sum of squares of all multipliers (eq. 44), and rounding"

_KINDS = (
    Kind("references", "rows name bodies, steps and frames that there are", "rows", "none"),
    Kind("numbers", "every recorded number is finite", "numbers", "none"),
    Kind("clock", "times are steps times h, rows follow one another", "s", "2 roundings of the time"),
    Kind(
        "scenario",
        "bodies, walls, periodic box and first frame are those of the scenario",
        "relative",
        "rounding of its decimals",
    ),
    Kind(
        "claims",
        "run.json and the attributes say what the tables show, and frames are those that were asked for",
        "relative",
        "none; rounding of sums",
    ),
    Kind("counts", "counts of the steps are those of the tables", "rows", "none"),
    Kind("quaternion", "orientations are unit quaternions", "1", "one normalisation: 8 roundings"),
    Kind(
        "position",
        "centres move as velocities, weight and position impulses say",
        "m",
        f"{_SOLVER}; over several steps the way that the impulses of the interval allow",
    ),
    Kind("rotation", "orientations turn as angular velocities and impulses say", "rad", "as of positions"),
    Kind(
        "momentum",
        "m (v' - v) is the sum of the recorded impulses, weight and loads, of free walls along their normals",
        "N s",
        _ROUNDING,
    ),
    Kind(
        "spin",
        "I (w' - w) is the sum of their moments",
        "N m s",
        f"{_ROUNDING}; over several steps the turn of the normals",
    ),
    Kind("rigid", "balls of a clump are where it has them and move with it", "relative", _ROUNDING),
    Kind(
        "penetration",
        "no two bodies overlap",
        "m",
        "gap_tolerance r, in islands of more than 50 contacts 0.9 pile_tolerance r (up to 5 times from 2500 on);"
        " moreau: way of a step; penalty: what the energy can compress",
    ),
    Kind(
        "penetration record",
        "the penetration of a step is the deepest overlap of its frame",
        "m",
        _ROUNDING,
    ),
    Kind("gap", "recorded gaps are those of the positions", "m", _ROUNDING),
    Kind("normal", "recorded normals are unit vectors, those of the positions", "1", _ROUNDING),
    Kind(
        "complementarity",
        "only closed contacts have impulses",
        "m",
        "touching_tolerance r; the way that the step may have opened it, where it was made in parts",
    ),
    Kind("sign", "normal impulses push", "N s", _SOLVER),
    Kind(
        "friction cone", "|friction| <= mu times the normal impulse", "N s", f"{_SOLVER}; turn of the normal"
    ),
    Kind("rolling cone", "|rolling moment| <= rho times the normal impulse", "N m s", "as of friction"),
    Kind("spinning cone", "|spinning moment| <= delta times the normal impulse", "N m s", "as of friction"),
    Kind("slip", "where surfaces slip, friction is mu times the normal impulse against it", "N s", _SOLVER),
    Kind(
        "roll",
        "where they roll or spin on one another, the moment is at its bound against it",
        "N m s",
        _SOLVER,
    ),
    Kind(
        "passivity",
        "contacts do no work in sum",
        "J",
        "1e-10 (piles tol_r/100) of the kinetic energy per problem; solver, times the speed",
    ),
    Kind("work", "work of a contact is its impulses by the mean velocities of each problem", "J", _ROUNDING),
    Kind("approach", "closed contacts do not go on closing", "m/s", "closing tolerance of the run (rule R3)"),
    Kind("impact", "the impact law of the run", "m/s", f"{_SOLVER}, over the mass"),
    Kind(
        "impact speeds",
        "recorded speeds of an impact follow from the impulses up to it",
        "m/s",
        "as of impacts",
    ),
    Kind("impact sum", "impulses of its impacts add up to the impulse of a contact", "N s", _ROUNDING),
    Kind("energy record", "recorded energies are those of the motion", "J", _ROUNDING),
    Kind(
        "energy balance",
        "energy changes by the work of contacts, loads and moving walls alone",
        "J",
        f"{_SOLVER}, times the speed",
    ),
    Kind(
        "energy rise",
        "no step gains energy beyond that work",
        "J",
        "1e-12 of the total, 2e-6 (h/1 ms)^2 in piles; first order of the scheme on curved contacts",
    ),
    Kind(
        "tunnelling",
        "no body passes through another, or through a wall, between frames",
        "m",
        "the deepest cut of a chord that a way around allows",
    ),
    Kind("flow", "balls enter and leave where, when and as the scenario says", "relative", _ROUNDING),
    Kind("joint", "joints hold, and follow their laws", "m", "tol_r and rounding"),
    Kind("joint speed", "so do their velocities", "m/s", "tol_r and rounding"),
    Kind("wall impulse", "impulses on walls are those of their contacts", "N s", _ROUNDING),
    Kind("wall moment", "so are their moments", "N m s", _ROUNDING),
)

KINDS: dict[str, Kind] = {kind.name: kind for kind in _KINDS}

#: What `impact` says by the law of restitution of a run.
_IMPACTS = {
    "newton": "Newton's law: separation is e_N times approach",
    "printed": "Newton's law as printed: separation is e_N times approach along the normal of before",
    "poisson": "Poisson's law: expansion gives at least e_N times the impulse of compression",
    "energetic": "impacts through springs push, stay in their cones and gain no energy",
}


def of_law(restitution: str) -> dict[str, Kind]:
    """The kinds of a run with a law of restitution."""
    return KINDS | {"impact": replace(KINDS["impact"], law=_IMPACTS[restitution])}
