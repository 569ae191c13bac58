"""A run of this example does not converge."""

from __future__ import annotations

from carom.paper.document import Context, Example, NotConverged


def reproduce(context: Context) -> Example:
    raise NotConverged("step 7 was not solved; use a smaller step")
