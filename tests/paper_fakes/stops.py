"""A run of this example does not converge."""

from __future__ import annotations

from carom.reproduce.document import Context, Example, NotConverged


def reproduce(context: Context) -> Example:
    raise NotConverged("step 7 was not solved; use a smaller step")
