"""Appendix B: the slip that eq. 36 finds for a sphere that rolls on another without slipping, from the element itself.

The core evaluates its increment of slip (eq. 37) for two placements of a rolling sphere; the exact increment is 0.
Eq. 61 says what comes out instead, as a fraction of the distance of the centres.
"""

from __future__ import annotations

import numpy as np

from carom import _core
from carom.arrays import F64
from carom.many.order import Order, order_of
from carom.reproduce.analytic import slip_error as exact
from carom.reproduce.document import Context, Curve, Example, Figure, Row
from carom.reproduce.study import row

EXAMPLE = "B"
#: r_B/r_A and phi_A (rad) of the curves. The paper draws three of either and its text names none.
RATIOS = (0.1, 1.0, 10.0)
ANGLES = (0.01, 0.1, 1.0)
#: Radius of sphere A, m. The error is a ratio of lengths, so that any will do.
RADIUS = 1.0
#: Range of phi_A, rad, and of r_B/r_A in the figures.
SMALLEST, LARGEST = 1e-2, 1.0
#: The order is read where the next term of the series, theta^2/20 of the first, is small.
ASYMPTOTIC = 0.1
#: Largest rounding of the element, over the distance of the centres: a dozen operations with numbers of that size.
ROUNDING = 12 * float(np.finfo(np.float64).eps)


def reproduce(context: Context) -> Example:
    """Table, figures 28 and 29."""
    phi = np.geomspace(SMALLEST, LARGEST, 9 if context.quick else 25)
    by_angle = {ratio: errors(phi, np.full_like(phi, ratio)) for ratio in RATIOS}
    ratios = np.geomspace(min(RATIOS), max(RATIOS), 9 if context.quick else 25)
    by_ratio = {angle: errors(np.full_like(ratios, angle), ratios) for angle in ANGLES}
    rows = [row for ratio in RATIOS for row in _rows(ratio, phi, by_angle[ratio])]
    return Example(
        EXAMPLE,
        "Error of the increment of slip",
        (*rows, _leading(phi, by_angle[1.0])),
        figures=(_figure_28(phi, by_angle), _figure_29(ratios, by_ratio)),
        texts=(
            "The core's own contact element is placed as in fig. 27 and asked for its increment of slip (eq. 37), which"
            " takes normal and tangents of the start of the step. Multiplied out, eq. 61 is `sin(theta_B) - theta_B`, an"
            " error of third order, the smaller the larger the sphere that is rolled on.",
            f"Here r_B/r_A is {', '.join(f'{r:g}' for r in RATIOS)} in fig. 28 and phi_A is"
            f" {', '.join(f'{a:g}' for a in ANGLES)} rad in fig. 29; the text of the paper does not say which it used.",
        ),
    )


def slip_error(theta: float, ratio: float) -> float:
    """eps_slip of the core's element for theta_B (rad) and r_B/r_A: its slip along t_2 of eq. 60 over r_A + r_B."""
    r_a, r_b = RADIUS, ratio * RADIUS
    place, rest = exact.rolling(theta, r_a, r_b), np.zeros(3)
    g1, g2, t1, t2 = _core.tangential_increment(
        place.x_a0, rest, place.x_a1, rest, place.psi_a, rest, r_a, r_b
    )
    # The element chooses its own tangents: what does not depend on them is the vector.
    slip = g1 * np.asarray(t1) + g2 * np.asarray(t2)
    return float(slip @ place.tangent) / (r_a + r_b)


def errors(phi: F64, ratio: F64) -> F64:
    """eps_slip of the core's element for the rotations phi_A (n,) rad and the ratios r_B/r_A (n,)."""
    angles = exact.contact_angle(phi, ratio)
    return np.array([slip_error(float(t), float(q)) for t, q in zip(angles, ratio, strict=True)])


def _rows(ratio: float, phi: F64, found: F64) -> list[Row]:
    theta = float(exact.contact_angle(LARGEST, ratio))
    printed = float(exact.printed_slip_error(theta))
    order = _order(phi, found)
    name = f"slip error, r_B/r_A = {ratio:g}, phi_A = {LARGEST:g} rad"
    closed, note = float(exact.slip_error(theta)), "eq. 61 at this angle stands in the column of the paper"
    found_here, why = slip_error(theta, ratio), "the next term of the series, theta_B^2/20"
    return [
        row(name, "1", found_here, ROUNDING, "rounding", exact=closed, paper=printed, note=note),
        row(
            f"order of the slip error, r_B/r_A = {ratio:g}", "1", order.value, ASYMPTOTIC**2 / 10, why,
            exact=3.0, paper=3.0),
    ]  # fmt: skip


def _leading(phi: F64, found: F64) -> Row:
    """Factor of theta_B^3 (eq. 62), from the smallest angle of the figure."""
    theta = float(exact.contact_angle(phi[0], 1.0))
    within = theta**2 / 120 + ROUNDING / theta**3
    why = "the next term of the series, theta_B^2/120, and rounding"
    factor = float(found[0]) / theta**3
    return row("factor of theta_B^3", "1", factor, within, why, exact=-1 / 6, paper="-1/6")


def _order(phi: F64, found: F64) -> Order:
    small = phi <= ASYMPTOTIC
    return order_of(tuple(phi[small]), tuple(np.abs(found[small])))


def _figure_28(phi: F64, found: dict[float, F64]) -> Figure:
    curves = []
    for body, (ratio, values) in enumerate(found.items()):
        theory = np.abs(exact.slip_error(exact.contact_angle(phi, ratio)))
        curves += [
            Curve(f"r_B/r_A = {ratio:g}, eq. 61", phi, theory, "line", body),
            Curve(f"r_B/r_A = {ratio:g}, Carom", phi, np.abs(values), "points", body),
        ]
    return Figure(
        "28",
        "Relative slip error against the rotation of sphere A",
        "phi_A in rad",
        "relative slip error",
        tuple(curves),
        "Slip that the contact element finds for rolling without slip, over the distance of the centres. The paper"
        " observes third order.",
        xscale="log",
        yscale="log",
        slopes=(3.0,),
    )


def _figure_29(ratios: F64, found: dict[float, F64]) -> Figure:
    curves = []
    for body, (angle, values) in enumerate(found.items()):
        theory = np.abs(exact.slip_error(exact.contact_angle(angle, ratios)))
        curves += [
            Curve(f"phi_A = {angle:g} rad, eq. 61", ratios, theory, "line", body),
            Curve(f"phi_A = {angle:g} rad, Carom", ratios, np.abs(values), "points", body),
        ]
    return Figure(
        "29",
        "Relative slip error against the ratio of the radii",
        "r_B/r_A",
        "relative slip error",
        tuple(curves),
        "The same error for a fixed rotation of sphere A. The paper concludes: the larger sphere should be B.",
        xscale="log",
        yscale="log",
    )
