"""Errors of the paper, one entry for each: what is printed, what is meant, and by which rows it shows.

A row that shows an error names its `key` (`Row.erratum`). An error of words only has no row. Slips in the equations of
the method that any reader corrects while reading are listed in Appendix A of the page.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Erratum:
    """`where` in the paper, the example that it belongs to, and what is wrong with the reason."""

    key: str
    where: str
    example: str
    told: str


ERRATA = (
    Erratum(
        "eq. 46",
        "eq. 46",
        "5.1",
        "the angular velocity of B for t > t_lim has the factor 4 I/k where k/(4 I) is right. As printed it jumps at t_lim.",
    ),
    Erratum(
        "eq. 47",
        "eq. 47",
        "5.1",
        "the angle of B for t > t_lim has the wrong sign in its first term and a k too many in the bracket. As printed it"
        " jumps at t_lim, and its derivative is not the angular velocity.",
    ),
    Erratum(
        "order",
        "section 5.1, fig. 4",
        "5.1",
        "a linear rate is reported. Forces are continuous here and nothing impacts: the generalized-alpha scheme keeps its"
        " second order.",
    ),
    Erratum(
        "eq. 63",
        "section 5.2 with eq. 63",
        "5.2",
        "eq. 63 is compared with balls on a cloth, with a locked axis and with mu_b = 0.2. It holds for two balls that"
        " nothing else touches, that turn freely and slip to the end of the hit. The cloth pushes back on the object ball,"
        " the lock turns the slip. Above mu_b = 2/(7 (1 + e) cos phi) the slip ends within the hit.",
    ),
    Erratum(
        "eq. 64",
        "eq. 64",
        "5.2",
        "v_y - R w_x is printed where v_y + R w_x is right: as printed, a rolling ball would slip at twice its speed.",
    ),
    Erratum(
        "sliding",
        "section 5.2, fig. 7",
        "5.2",
        'the cue ball is said to impact "in pure rolling motion" and, in the text on energy, to be "initially in sliding'
        ' movement". Only if it slides first, then rolls, then hits, can both be true, as the runs here assume.',
    ),
    Erratum(
        "eq. 50",
        "section 5.3 with eq. 50",
        "5.3",
        "eq. 50 leaves out the table, on which a rolling cue ball presses the object ball. Its reaction turns friction"
        " towards the vertical and makes the throw smaller.",
    ),
    Erratum(
        "axis",
        "section 5.3",
        "5.3",
        "the shot goes along x, and its rolling spin is called w_x. A ball that rolls along x turns about y; in eq. 50 and"
        " here w_x stands for the spin of roll.",
    ),
    Erratum(
        "caption",
        "caption of fig. 12",
        "5.3",
        "R w_xCB/v = 0.9 is printed where R w_zCB/v = 0.9 is meant: w_xCB is 0.5 w_roll, so R w_xCB/v = 0.5.",
    ),
    Erratum(
        "energy",
        "eqs. 16, 24 and 43",
        "5.5",
        "the velocity before an impact is taken along the normal of t_n, the one after it along that of t_{n+1}. Between"
        " them the normal turns, and energy grows to first order in h, where the paper reports no spurious energy.",
    ),
)
BY_KEY = {erratum.key: erratum for erratum in ERRATA}
