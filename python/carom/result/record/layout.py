"""The layout of `results.h5`: groups, units, and what each known column means.

The columns themselves are data: whatever the core delivers is written with its own type and shape. This table
only adds the unit and one line of explanation to those it knows, so that the file explains itself to a reader
without Carom. `docs/reference/results.md` describes the whole.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any, NamedTuple

FORMAT = 1

#: Groups of a file, in the order of the columns of `/commit`.
TABLES = ("frames", "contacts", "steps", "impacts", "residuals")

#: Groups that only some runs have: whose balls come and go, whose method has events, that keep the history of impacts.
SOMETIMES = ("events", "transitions", "impulses")

#: The column of a flat table that holds running ends into another one; they are made global on writing.
ENDS = {("frames", "contact_end"): "contacts", ("residuals", "end"): "values"}

#: The one column whose rows are not the rows of its table: histories of several contact problems, end to end.
VALUES = ("residuals", "value")

#: Groups of what does not change in a run; `walls` are there if there are others than planes, two with meshes, the last one
#: with clumps.
STATIC = ("bodies", "planes", "walls", "mesh_points", "mesh_triangles", "clumps")

#: Columns of static tables that hold text.
TEXTS = ("name", "shape", "motion", "free")


class Rows(NamedTuple):
    """How many rows of each table are whole. The last row of `/commit` is the only truth a reader may rely on."""

    frames: int = 0
    contacts: int = 0
    steps: int = 0
    impacts: int = 0
    residuals: int = 0
    values: int = 0
    events: int = 0
    transitions: int = 0
    impulses: int = 0

    def __add__(self, other: object) -> Rows:  # element by element, not concatenation
        if not isinstance(other, tuple) or len(other) != len(self):
            return NotImplemented
        return Rows(*(a + b for a, b in zip(self, other, strict=True)))


def tables(owner: Container[str]) -> tuple[str, ...]:
    """The tables of a block, of a file or of their columns."""
    return (*TABLES, *(table for table in SOMETIMES if table in owner))


def count(block: Mapping[str, Any]) -> Rows:
    """Rows of the tables of a block as `Simulation.advance` returns it."""
    counts = {table: len(block[table]["gap" if table == "contacts" else "step"]) for table in tables(block)}
    return Rows(**counts, values=len(block["residuals"]["value"]))


#: Attributes of a file that are numbers, with their shapes: finite, and the first three are there.
ATTRIBUTES: dict[str, tuple[int, ...]] = {
    "step": (),
    "every": (),
    "gravity": (3,),
    "start_step": (),
    "periodic": (3,),
    "periodic_origin": (3,),
    "box_flow": (),
    "box_gradient": (),
}
NEEDED = ("step", "every", "gravity")

#: Columns of bodies that are above 0.
POSITIVE = ("radius", "mass", "inertia")

#: Columns that a file may be without.
OPTIONAL = {"motion", "free", "free_walls", "clumps", "box", "joint_impulse", "walls", "present", "part"}

#: Axes that the text of a column names, with their lengths; others are as long as there are bodies, joints or walls.
AXES = {"xyz": 3, "wxyz": 4, "A and B": 2, "6": 6, "2": 2, "3": 3, "13": 13, "xyz and offset": 4}


class Meaning(NamedTuple):
    """Unit (SI, "1" for a count or ratio) and one line of explanation of a column, which begins with its axes if it has
    more than one.
    """

    unit: str
    text: str

    @property
    def row(self) -> tuple[int | None, ...]:
        """Shape of a row; None for an axis whose length is not always the same."""
        axes = self.text[1:].partition(")")[0].split(", ")[1:] if self.text.startswith("(") else []
        return tuple(AXES.get(axis) for axis in axes)


_MOTION = "how it moves, as JSON: laws of the time and axes of rotation, nothing where it stands"

_PART = (
    "what of a mesh is touched, -1 for other bodies; the column is there where there are meshes. It is 7 times a triangle,"
    " and of it 0 for the plane, 1 to 3 for an edge. These go from corner 0, 1 and 2 to the next; 4 to 6 are the corners"
)

MEANINGS: dict[str, Meaning] = {
    "frames/step": Meaning("1", "number of the step after which the frame was taken, 0 for the start"),
    "frames/time": Meaning("s", "time of the frame"),
    "frames/position": Meaning("m", "(frame, body, xyz) centres"),
    "frames/orientation": Meaning("1", "(frame, body, wxyz) unit quaternions, scalar part first"),
    "frames/velocity": Meaning("m/s", "(frame, body, xyz) velocities of the centres"),
    "frames/angular_velocity": Meaning("rad/s", "(frame, body, xyz) angular velocities in the world frame"),
    "frames/joint_impulse": Meaning(
        "N s, N m s",
        "(frame, joint, 6) impulse at the joint on its first body since the last frame, and couple there, world frame. The"
        " moment of the impulse about the centre is not in it",
    ),
    "frames/free_walls": Meaning(
        "m, m/s",
        "(frame, free wall, 2) displacement of each free wall along its normal since the start, and its velocity along it",
    ),
    "frames/clumps": Meaning(
        "m, 1, m/s, rad/s",
        "(frame, clump, 13) centre of mass (3), unit quaternion of the principal axes (4), velocity (3) and angular velocity"
        " (3), in the world frame. The centre of one that has left is not a number",
    ),
    "frames/box": Meaning(
        "m",
        "(frame, xyz and offset) lengths of a periodic box that deforms, 0 along axes that do not repeat. Then the"
        " displacement along axis `box_flow` of the image one up along axis `box_gradient` (attributes, 0 to 2)",
    ),
    "frames/walls": Meaning(
        "N s, N m s",
        "(frame, wall, 6) impulse on each wall since the last frame, and its moment about the wall's point as it moves."
        " World frame; planes first, then /walls",
    ),
    "frames/present": Meaning(
        "1", "(frame, body) whether the ball is there; if not, its position is not a number"
    ),
    "frames/contact_end": Meaning("1", "rows of /contacts up to and including this frame"),
    "contacts/body": Meaning(
        "1",
        "(row, A and B) body indices; B >= number of bodies is wall B - number of bodies, planes first, then /walls",
    ),
    "contacts/part": Meaning("1", _PART),
    "contacts/status": Meaning(
        "1", "0 open, 1 stick, 2 slip, at the end of the last step in which the contact was closed"
    ),
    "contacts/gap": Meaning("m", "gap at the end of the last step in which the contact was closed"),
    "contacts/normal": Meaning("1", "(row, xyz) unit normal at the end of that step, from B to A"),
    "contacts/impulse": Meaning(
        "N s", "(row, xyz) velocity-level impulse on A since the last frame, world frame"
    ),
    "contacts/moment": Meaning(
        "N m s", "(row, xyz) velocity-level rolling and spinning impulse on A since the last frame"
    ),
    "contacts/position_impulse": Meaning(
        "N s^2", "(row, xyz) position-level multiplier on A since the last frame"
    ),
    "contacts/position_moment": Meaning(
        "N m s^2", "(row, xyz) position-level rotational multiplier on A since the last frame"
    ),
    "contacts/work_normal": Meaning("J", "work of the normal impulse since the last frame"),
    "contacts/work_friction": Meaning("J", "work of sliding friction since the last frame"),
    "contacts/work_rolling": Meaning("J", "work of rolling friction since the last frame"),
    "contacts/work_spinning": Meaning("J", "work of spinning friction since the last frame"),
    "impacts/step": Meaning("1", "step in which the contact took part in an impact problem"),
    "impacts/time": Meaning("s", "time at the end of that step"),
    "impacts/problem": Meaning(
        "1", "number of the impact problem in the sequence of its step; 0: the loads that act with the impact"
    ),
    "impacts/body": Meaning(
        "1",
        "(row, A and B) body indices; B >= number of bodies is wall B - number of bodies, planes first, then /walls",
    ),
    "impacts/part": Meaning("1", _PART),
    "impacts/status": Meaning("1", "0 open, 1 stick, 2 slip"),
    "impacts/normal": Meaning("1", "(row, xyz) unit normal from B to A"),
    "impacts/impulse": Meaning("N s", "(row, xyz) impulse on A, world frame"),
    "impacts/moment": Meaning("N m s", "(row, xyz) rolling and spinning impulse on A"),
    "impacts/approach": Meaning(
        "m/s", "relative velocity along the normal before the problem: negative where the pair closes"
    ),
    "impacts/separation": Meaning("m/s", "separating speed along the normal after the problem"),
    "impacts/restitution_scale": Meaning(
        "1", "factor on the restitution by the energy safeguard, 1 if untouched"
    ),
    "steps/step": Meaning("1", "number of the step, from 1"),
    "steps/time": Meaning("s", "time at the end of the step"),
    "steps/iterations_smooth": Meaning("1", "iterations of the smooth sub-problem"),
    "steps/iterations_position": Meaning("1", "Newton iterations of the position sub-problem"),
    "steps/iterations_velocity": Meaning("1", "Newton iterations of the velocity sub-problem"),
    "steps/line_search_position": Meaning("1", "line-search trials of the position sub-problem"),
    "steps/line_search_velocity": Meaning("1", "line-search trials of the velocity sub-problem"),
    "steps/impact_problems": Meaning("1", "problems of the impact sequence"),
    "steps/sweeps_position": Meaning(
        "1", "Gauss-Seidel sweeps of the pile that needed most, position level, over all listings of pairs"
    ),
    "steps/sweeps_velocity": Meaning(
        "1", "the same at the velocity level, over the problems of the whole pile"
    ),
    "steps/contacts": Meaning(
        "1", "closed contacts; of `moreau` those of velocities, not what is only projected"
    ),
    "steps/candidates": Meaning("1", "pairs near enough to be looked at"),
    "steps/islands": Meaning("1", "groups of bodies joined by closed contacts"),
    "steps/largest_island": Meaning("1", "contacts of the largest group"),
    "steps/residual_smooth": Meaning(
        "1", "relative residual of the smooth sub-problem, 0 without loads and joints"
    ),
    "steps/residual_position": Meaning("1", "relative residual of the position sub-problem, eq. 44"),
    "steps/residual_velocity": Meaning("1", "relative residual of the velocity sub-problem, eq. 44"),
    "steps/energy_kinetic": Meaning("J", "kinetic energy, translation and rotation"),
    "steps/energy_potential": Meaning(
        "J", "potential energy of gravity, springs and, with method penalty, contacts"
    ),
    "steps/energy_work": Meaning(
        "J", "work of loads without a potential and of prescribed motion in the step"
    ),
    "steps/energy_in": Meaning("J", "energy of the balls that entered after the step"),
    "steps/energy_out": Meaning(
        "J",
        "energy of the balls and clumps that left after the step; in penalty also of the springs at what was taken away",
    ),
    "steps/entered": Meaning("1", "balls that entered after the step"),
    "steps/removed": Meaning("1", "balls that left after the step, those of clumps among them"),
    "steps/penetration": Meaning(
        "m", "deepest penetration after the step (penalty: within it), 0 if there is none"
    ),
    "steps/penetration_relative": Meaning("1", "the same over the radius of the body"),
    "steps/fallbacks": Meaning("1", "times the default solver failed and a backup was used"),
    "steps/truncated": Meaning("1", "impact sequences cut short"),
    "steps/unconverged": Meaning("1", "sub-problems accepted without convergence"),
    "steps/halvings": Meaning("1", "times the step was halved"),
    "steps/missed_impacts": Meaning("1", "contacts found overlapping while separating"),
    "steps/relisted": Meaning("1", "times a new pair was found after the position sub-problem"),
    "steps/restitution_scale": Meaning("1", "smallest factor on the restitution by the energy safeguard"),
    "steps/substeps": Meaning(
        "1",
        "sub-steps of method penalty; intervals between events; with others those of a step divided so that"
        " nothing passes through anything, else 0",
    ),
    "steps/substep_min": Meaning("s", "smallest of them, 0 if there are none"),
    "steps/handovers": Meaning("1", "how often method events handed the motion to steps of nsga"),
    "steps/stepped": Meaning("s", "time in the step that those steps made"),
    "residuals/step": Meaning("1", "step of the contact problem"),
    "residuals/level": Meaning("1", "0 smooth motion, 1 position, 2 velocity"),
    "residuals/problem": Meaning("1", "number of the contact problem in its step and level"),
    "residuals/contacts": Meaning("1", "candidate contacts of the problem, closed or not"),
    "residuals/end": Meaning("1", "end of its history in /residuals/value"),
    "residuals/value": Meaning("1", "residual norms, one per iteration, histories end to end"),
    "events/step": Meaning("1", "number of the step after which it happened"),
    "events/time": Meaning("s", "time at the end of that step"),
    "events/body": Meaning("1", "index of the ball"),
    "events/kind": Meaning("1", "1 the ball enters, 0 it leaves"),
    "transitions/step": Meaning("1", "number of the step in which it happened"),
    "transitions/time": Meaning("s", "when it happened"),
    "transitions/body": Meaning("1", "(row, 2) the ball, and the body or wall that did it, -1 if none did"),
    "transitions/kind": Meaning(
        "1",
        "0 impact, 1 slip ends, 2 roll ends, 3 spin ends, 4 edge, 5 outlet, 6 press: nsga takes over, 7 release",
    ),
    "transitions/mode": Meaning(
        "1",
        "(row, 2) of the ball before and after: 0 flight, 1 slide, 2 roll, 3 spin, 4 rest, 5 stepped, 6 gone",
    ),
    "transitions/position": Meaning("m", "(row, xyz) centre of the ball then"),
    "transitions/velocity": Meaning(
        "m/s", "(row, xyz) its velocity afterwards; of `outlet` that with which it left"
    ),
    "impulses/step": Meaning("1", "step of the impact"),
    "impulses/time": Meaning("s", "time at the end of that step"),
    "impulses/body": Meaning("1", "(row, A and B) body indices as in /impacts"),
    "impulses/at": Meaning(
        "1",
        "impact problems of the step so far; within one through springs, with the share of its time",
    ),
    "impulses/impulse": Meaning("N s", "normal impulse of the pair so far, since the first impact problem"),
    "bodies/name": Meaning("1", "names"),
    "bodies/radius": Meaning("m", "radii"),
    "bodies/mass": Meaning("kg", "masses"),
    "bodies/inertia": Meaning("kg m^2", "moments of inertia about any diameter"),
    "bodies/material": Meaning("1", "index of the material"),
    "clumps/name": Meaning("1", "names"),
    "clumps/first": Meaning("1", "index of the first of its balls, which are consecutive bodies"),
    "clumps/count": Meaning("1", "number of its balls"),
    "clumps/mass": Meaning("kg", "masses"),
    "clumps/inertia": Meaning("kg m^2", "(clump, 3) principal moments about the centre of mass"),
    "clumps/centre": Meaning("m", "(clump, xyz) centre of mass in own axes"),
    "clumps/axes": Meaning(
        "1", "(clump, wxyz) unit quaternion of the principal axes in own axes, scalar part first"
    ),
    "planes/name": Meaning("1", "names"),
    "planes/point": Meaning("m", "(plane, xyz) a point of the plane"),
    "planes/normal": Meaning("1", "(plane, xyz) unit normal, to the side where bodies live"),
    "planes/material": Meaning("1", "index of the material"),
    "planes/motion": Meaning("1", _MOTION),
    "planes/free": Meaning(
        "1", "mass, force and weight of free walls, the first ones, as JSON; nothing of others"
    ),
    "walls/name": Meaning("1", "names"),
    "walls/shape": Meaning(
        "1", "rectangle, disc, cylinder, sphere, cone or mesh; what it has not is not a number"
    ),
    "walls/point": Meaning("m", "(wall, xyz) centre; middle of the axis of a cylinder, first ring of a cone"),
    "walls/axis": Meaning(
        "1", "(wall, xyz) unit axis; of a rectangle or disc the normal, to where bodies live"
    ),
    "walls/side": Meaning("1", "(wall, xyz) unit direction of the first side of a rectangle"),
    "walls/size": Meaning("m", "(wall, 2) lengths of a rectangle along side and across it"),
    "walls/radius": Meaning("m", "radius; of a cone that of the first ring"),
    "walls/hole": Meaning("m", "radius of the hole of a disc"),
    "walls/radius_end": Meaning("m", "radius of the last ring of a cone"),
    "walls/length": Meaning("m", "length along the axis, infinite for a tube without end"),
    "walls/inside": Meaning("1", "whether bodies live inside a cylinder, sphere or cone"),
    "walls/material": Meaning("1", "index of the material"),
    "walls/motion": Meaning("1", _MOTION),
    "mesh_points/wall": Meaning("1", "which wall has the point, planes counted first"),
    "mesh_points/position": Meaning("m", "(row, xyz) where it is at the start"),
    "mesh_triangles/wall": Meaning("1", "which wall has the triangle, planes counted first"),
    "mesh_triangles/corners": Meaning(
        "1", "(row, 3) points of that wall, counted from 0, counterclockwise seen from the front"
    ),
}
