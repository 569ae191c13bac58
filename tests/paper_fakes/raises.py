"""An example that cannot be computed, in the way that its name says."""

from __future__ import annotations

from carom.reproduce.document import Context, Example


def reproduce(context: Context) -> Example:
    raise ZeroDivisionError("no <b>way</b>\nout")
