"""Type stub of the compiled core (crate `carom-py`). Nothing here knows files, names or units other than SI."""

from collections.abc import Mapping, Sequence
from typing import Any, NotRequired, TypedDict, final

import numpy as np
from numpy.typing import NDArray

# Names for types alone, which the module does not have.
F64 = NDArray[np.float64]
U64 = NDArray[np.uint64]
I64 = NDArray[np.int64]

__version__: str

class ModelError(ValueError):
    """A number of the model is unusable; `args[0]` says which and why."""

class ExpressionError(ValueError):
    """A formula cannot be read or gives no finite number; `args[0]` says where (column, from 1), why and what to write."""

@final
class Expression:
    """A formula of named variables: `+ - * / ^` (or `**`), `functions()`, `pi`. `-t^2` is `-(t^2)`, as in Python."""

    def __new__(cls, text: str) -> Expression: ...
    @staticmethod
    def functions() -> list[str]:
        """Names of all functions."""

    @property
    def variables(self) -> list[str]:
        """Names that are neither functions nor constants, in the order of their first appearance."""

    def evaluate(self, values: Mapping[str, float]) -> float:
        """Value for the named values, of which more may be given than needed; finite, or else `ExpressionError`."""

    def slope(self, x: float) -> float:
        """Derivative at `x`, from the right, of a formula of at most one variable; it need not be finite."""

class Block(TypedDict):
    """What a call of `Simulation.advance` produced. Row counts: F frames, C contact rows, S steps, I impact rows."""

    frames: dict[str, Any]
    contacts: dict[str, Any]
    impacts: dict[str, Any]
    steps: dict[str, Any]
    residuals: dict[str, Any]
    outcome: dict[str, Any] | None
    events: NotRequired[dict[str, Any]]
    transitions: NotRequired[dict[str, Any]]
    core_s: NotRequired[float]
    """Seconds of the call, by who called (`carom.run.loop`)."""

def defaults() -> dict[str, float | int | bool | str]:
    """Every option of `[run]` that is numerical, with its default: the one place where defaults are stated."""

def tangential_increment(
    x_a0: Sequence[float] | F64,
    x_b0: Sequence[float] | F64,
    x_a1: Sequence[float] | F64,
    x_b1: Sequence[float] | F64,
    psi_a: Sequence[float] | F64,
    psi_b: Sequence[float] | F64,
    r_a: float,
    r_b: float,
) -> tuple[float, float, list[float], list[float]]:
    """Incremental tangential gap of two spheres over a step (eq. 37), m, and the tangents t1, t2 of its start.

    Centres at t_n and t_{n+1}, m, spatial rotation increments, rad, radii, m. `ModelError` if the centres coincide.
    """

def choices() -> dict[str, list[str]]:
    """Admitted values of the options that are names: method, impact, solver and others."""

def impact_laws() -> dict[str, dict[str, Any]]:
    """The table of impact laws by name (`carom.scene.tables.impact_laws`)."""

def pile_overlap(tolerance: float, contacts: int) -> float:
    """Overlap over the radius that the solver of piles may leave in an island of so many contacts, by `pile_tolerance`."""

@final
class Cancel:
    """Lets another thread end a solve: `cancel` of `solve_contact_problem`."""

    def cancel(self) -> None:
        """Solves that were given this return their best iterate as soon as their method looks up."""

    @property
    def cancelled(self) -> bool: ...

def solve_contact_problem(
    indptr: I64,
    indices: I64,
    data: F64,
    q: F64,
    dimension: int,
    mu: F64,
    mu_r: F64,
    mu_s: F64,
    r0: F64 | None,
    solver: str,
    tolerance: float,
    max_iterations: int,
    time_limit: float,
    threads: int,
    cancel: Cancel | None = None,
) -> dict[str, Any]:
    """Solve `u = W r + q` for the multipliers `r` of C contacts of `dimension` d rows each (2, 3, 5, 6).

    W (d C, d C) in compressed rows `indptr` (d C + 1,), `indices`, `data` (nnz,); `q` (d C,); bounds `mu` (C,) and lengths
    `mu_r`, `mu_s` (C,), 0 where there is none; start `r0` (d C,), None: 0; `solver` of `contact_solvers()`; `max_iterations`
    0: the solver's own; `time_limit` s, infinite: none.

    Returns `r` (d C,), `converged` (as the solver sees it), `explained` (false: forces ran away), `iterations`, `wall_s`
    and `stages`: of each its `name`,
    `solver`, `iterations`, `err` (after it), `wall_s`, `why`. `ValueError` in one line for what is no problem.
    """

def contact_solvers() -> list[tuple[str, str]]:
    """Names of the solvers, `auto` first, and a line on each."""

def auto_rule() -> str:
    """What `auto` does, in words, checkpoint by checkpoint."""

@final
class Simulation:
    """A model, its state and its scratch memory. The interpreter lock is released while it advances.

    `model` holds arrays: `gravity (3,)`; spheres `radius, mass, inertia (N,)`, `position, velocity, angular_velocity (N,3)`,
    `orientation (N,4)` w first, `material (N,)`; planes `plane_point, plane_normal (P,3)`, `plane_material (P,)`;
    contact laws `law_a, law_b (L,)` material indices (unordered pair), `friction, restitution, tangential_restitution,
    rolling_radius, spinning_radius (L,)`; and `options`: a dict with any keys of `defaults()` plus `step`.

    Four lists may be left out. A law in them is `("constant", x)`, `("polynomial", [c0, c1, ...])`,
    `("table", [[x, y], ...])` or `("expression", text)`, of the time t, in friction and
    restitution of the slip or approach speed v:

    - `friction_law`, `restitution_law` (L,): None, or a law in place of `friction` or `restitution`, which is 0 there
    - `joints`: `{"a": int, "b": int or -1 for the ground, "rows": [(kind, direction, arm_a, arm_b, law), ...]}`; `kind` is
      `point` (`direction . (p_a - p_b)` follows the law), `distance` (`|p_a - p_b|` does) or `rotation` (of a against b
      about `direction`, counted from the law's value at the start); `p = x + R arm`, `arm_b` of the ground is the point
    - `loads`: `{"kind": "force", "body", "force": [law, law, law], "torque": [law, law, law]}`; `{"kind": "spring", "a",
      "b", "arm_a", "arm_b", "stiffness", "damping", "rest_length"}`; `{"kind": "drag", "body", "translation", "rotation"}`;
      `{"kind": "callable", "function": f}`, `f(time, position, velocity, angular_velocity)` giving a float64 array (N,6)

    Walls are bodies N..: free planes, the other planes, then those of the list `walls` (may be left out):
    `{"shape": tuple, "point": (3,), "material": int}` with the shapes

    - `("rectangle", normal, side, [a, b])`: centre at the point, full lengths along `side` and across it
    - `("disc", normal, radius, hole)`: centre at the point; `hole` is the inner radius of a ring, 0 for none
    - `("cylinder", axis, radius, length, inside)`: centre of the axis at the point; open ends, `inf` for none
    - `("sphere", radius, inside)`: centre at the point
    - `("cone", axis, radius, radius_end, length, inside)`: `radius` at the point, `radius_end` at `length` along the axis

    Rectangles, discs, finite cylinders and cones are one-sided: a ball whose centre is deeper behind the face than its
    radius is on the other side and has no contact. Behind these come those of the list `meshes`: `{"vertices": (V,3), m,
    "triangles": (T,3), "point": (3,), "material": int}`, `point` what moments are about; where there are any, tables
    of contacts and impacts have `part`. `wall_motion` is a list of `(wall, {...})`, `wall` counted over all walls, planes
    first, meshes last, with any of

    - `"translation": [law, law, law]`, displacement from the given place, m
    - `"rotation": (axis, point, law)`, angle from the given place about a unit axis, rad; the translation takes the axis
      along
    - `"surface_velocity": (3,)`, m/s, and `"surface_rotation": (axis, point, rate)`, rad/s: motion of the material along a
      surface that stays; both turn with the wall
    - `"until"`, s: when the wall is taken away; without the key it stays

    `free_walls` is a list of `{"wall": int, "mass": kg, "velocity": m/s, "weighs": bool, "force": law}`: the first planes,
    which move along their normals, with the force of the law along them. With `"area": [side, side]` the law is a pressure
    on the area between these sides: `("period", axis)`, or `("between", wall, wall)`. Their state stands behind that of the
    balls in `state()`; frames have `free_walls (F, walls, 2)`, displacement and velocity along the normal.

    `clumps` is a list of `{"balls": (first, stop), "mass": kg, "inertia": principal moments (3,), "position": centre of
    mass, "orientation": quaternion of the principal axes, "velocity", "angular_velocity"}`: rigid bodies of successive
    balls. Frames have `clumps (F, clumps, 13)`: position, orientation, velocity, angular velocity.

    A periodic box: `periodic (3,)`, its lengths or 0, and `periodic_origin (3,)`. Where it deforms, `deformation`:
    `{"stretch": (law, law, law), "shear": law, "flow": int, "gradient": int}`, laws of the time or `None` where nothing
    changes: factors on the lengths, and the strain by which the image one up along `gradient` is displaced along `flow`.
    Velocities given are against the mean flow. Frames have `box (F, 4)`: lengths along x, y, z, or 0, and the offset of
    that image, m.

    `inflow`: list of `{"bodies": (first, count), "region": ("box", low, high) or ("disc", centre, normal, radius), "rate":
    1/s or 0, "start": s, "velocity": (3,), "spread": m/s per component, "seed": int}`, whose balls are absent until they
    enter. Clumps are bodies behind the N balls; with `"turned": True` they enter turned at random. `outlet`: list of
    `(low, high, inside)`.

    Impulses on walls are recorded if any wall has a motion or is free, or with `"record_walls": True`. With
    `"drop_impacts": True` the table of impacts stays empty, with `"every_impact": True` piles have a row in it for each
    impact problem and contact, not for each step and contact alone. With `"courses": True` blocks have a table
    `impulses`: how the impulse of each contact grows within an impact.
    """

    def __new__(cls, model: dict[str, Any]) -> Simulation: ...
    def overlaps(self, tolerance: float, most: int) -> list[tuple[int, int, float]]:
        """At most `most` pairs that overlap by more than `tolerance` r_c now, walls as they stand: `(a, b, gap)`, m."""

    @property
    def step(self) -> int: ...
    @property
    def time(self) -> float: ...
    def frame(self) -> dict[str, F64]:
        """Current `time, position, orientation, velocity, angular_velocity` as copies.

        With inflows or outlets `present (N,)` too; absent balls have a position of NaN, here and in the frames of `advance`.
        """

    def advance(self, steps: int, frame_every: int, contacts: bool, wall_limit: float) -> Block:
        """Advance by up to `steps` steps, stopping early after `wall_limit` seconds or at an outcome that is not `None`.

        A frame is taken after each step whose number is a multiple of `frame_every` (0: none).
        `frames["walls"]` (F, P, 6), where walls are recorded, has the impulse on each wall since the last frame, N s, and
        its moment about the wall's point, moved with the wall, N m s. Where balls come and go there are
        `frames["present"]` (F, N) and `events`: `step, time, body, kind`, 1 for a ball that enters, 0 for one that leaves.
        Method `events` has `transitions`: `step, time, body (X, 2), kind, mode (X, 2), position (X, 3), velocity (X, 3)`,
        as `carom.result.tables` has them.
        """

    def state(self) -> dict[str, Any]:
        """Everything that must be saved to continue bit for bit."""

    def restore(self, state: dict[str, Any]) -> None: ...
    def monitors(self) -> dict[str, Any]:
        """Totals since the start: iterations, line search, impact problems, counts, energy, penetration, advice."""

    def phases(self) -> dict[str, float]:
        """Seconds by phase, estimated from sampled steps."""

    def keep_problems(self, steps: Sequence[tuple[int, int, int]], hardest: int) -> None:
        """Keep the contact problems of the steps `first, first + stride, ...` up to `last` of each `(first, last,
        stride)`, and the `hardest` ones of all by iterations. Nothing is kept unasked.
        """

    def take_problems(self, hardest: bool) -> list[dict[str, Any]]:
        """Kept problems of the chosen steps since the last call, or the `hardest` so far; this forgets them.

        Of each, with N nodes (spheres, free walls), C contacts, J joints and R rows, 6 for each contact (N, T1, T2, R1,
        R2, S), then those of the joints: `level, step, time, part` (0, or the number of the attempt in a halved step),
        `island, index` (impact problem; 0: loads), `iterations, residual, converged, joints, worst`, `attempts` (the
        rungs of the ladder that were tried, in words);
        `spheres, mass, inertia (N,)`; `bodies (C+J,2)`; `bounds (C,3)` mu, rho, delta; `node (R,2)` of A and B, -1 for
        none, `gradient (R,2,6)` over them, `q, r (R,)`; `motion` before the problem, its `correction` u, and the `load`
        b(u) (N,6); `load_tangent_row`, `_column`, `_value` of -db/du. Measures are `gradient u + q`, linear at u.
        """

    def failing_problem(self) -> dict[str, Any] | None:
        """The contact problem that could not be solved, as `take_problems` gives it, at its last iterate."""
