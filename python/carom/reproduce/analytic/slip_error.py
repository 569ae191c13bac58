"""Error of the increment of slip of eq. 36 for a sphere that rolls on a fixed one (Appendix B, eqs. 54 to 62).

Sphere A rolls without slipping round the fixed sphere B by the angle theta_B. The slip is 0, but eq. 36 takes normal and
tangents of the start of the step, so that it finds a small one. As a fraction of the distance of the centres it is

    eps_slip = sin(theta_B) - theta_B,

which is what eq. 61 comes to when it is multiplied out. The error is of third order in the length of the step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from carom.arrays import F64


@dataclass(frozen=True)
class Rolling:
    """Positions of sphere A before and after it rolls by theta_B on sphere B at the origin, in the plane z = 0 (eqs.
    54-60).

    `x_a0`, `x_a1` (3,) m: centre of A at t_n and t_{n+1}. `psi_a` (3,) rad: its rotation in between. `tangent` (3,): t_2
    of t_n, along which eq. 61 measures the slip. Sphere B stays as it is.
    """

    x_a0: F64
    x_a1: F64
    psi_a: F64
    tangent: F64


def rolling(theta: float, r_a: float, r_b: float) -> Rolling:
    """The placements of Appendix B for the angle `theta` = theta_B (rad) and the radii of A and B (m)."""
    distance = r_a + r_b
    turn = total_angle(theta, r_b / r_a)
    sin, cos = np.sin(theta), np.cos(theta)
    return Rolling(
        x_a0=distance * np.array([-sin, cos, 0.0]),
        x_a1=np.array([0.0, distance, 0.0]),
        psi_a=np.array([0.0, 0.0, -float(turn)]),
        tangent=np.array([cos, sin, 0.0]),
    )


def total_angle(theta: ArrayLike, ratio: ArrayLike) -> F64:
    """phi_A, rad, the whole rotation of A for theta_B and the ratio r_B/r_A (eq. 59)."""
    return (1 + np.asarray(ratio, dtype=np.float64)) * np.asarray(theta, dtype=np.float64)


def contact_angle(phi: ArrayLike, ratio: ArrayLike) -> F64:
    """theta_B, rad, for the rotation phi_A of A and the ratio r_B/r_A (eq. 59 solved)."""
    return np.asarray(phi, dtype=np.float64) / (1 + np.asarray(ratio, dtype=np.float64))


def printed_slip_error(theta: ArrayLike) -> F64:
    """eps_slip as eq. 61 prints it. Right, but for small angles its terms cancel: use `slip_error`."""
    angle = np.asarray(theta, dtype=np.float64)
    sin, cos = np.sin(angle), np.cos(angle)
    return np.asarray(sin * (1 - cos - angle * sin) + cos * (sin - angle * cos))


def slip_error(theta: ArrayLike) -> F64:
    """eps_slip = sin(theta) - theta: eq. 61 multiplied out. Exact to rounding for small angles too.

    Below 0.3 rad the difference of two nearly equal numbers is replaced by seven terms of its series; the eighth is 1e-21
    of the first there.
    """
    angle = np.asarray(theta, dtype=np.float64)
    series = np.zeros_like(angle)
    term = -(angle**3) / 6
    for n in range(1, 8):
        series = series + term
        term = -term * angle**2 / ((2 * n + 2) * (2 * n + 3))
    return np.where(np.abs(angle) < 0.3, series, np.sin(angle) - angle)


def leading_term(theta: ArrayLike) -> F64:
    """-theta^3/6 (eq. 62)."""
    return np.asarray(-(np.asarray(theta, dtype=np.float64) ** 3) / 6)
