"""What a reader of a finished run should know before its numbers: in Python, the summary, the page and the audit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carom.result.cut_short import cut_short
from carom.result.gained import gained
from carom.result.lost_on_curves import lost_on_curves
from carom.result.shut_out import shut_out

if TYPE_CHECKING:
    from carom.result.result import Result


def remarks(result: Result) -> list[str]:
    """Each with what is wrong, what it means and what to do; none for a run that has nothing of the kind."""
    return [
        told for told in (cut_short(result), gained(result), lost_on_curves(result), shut_out(result)) if told
    ]
