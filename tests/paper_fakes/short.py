"""One number agrees, one is beyond its tolerance."""

from __future__ import annotations

from carom.reproduce.document import Context, Example, Row


def reproduce(context: Context) -> Example:
    rows = (
        Row("time of contact", "s", 0.328, None, 0.3286, 1e-3, "the paper prints 3 digits", "paper"),
        Row("speed", "m/s", 1.5, None, 1.44434, 1e-3, "the paper prints 3 digits", "paper"),
    )
    return Example("5.4", "Falls short", rows)
