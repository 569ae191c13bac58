"""What a finished run says of inflows that let nobody in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from carom.errors import counted, quoted

if TYPE_CHECKING:
    from carom.result.result import Result


def shut_out(result: Result) -> str | None:
    """That none of the balls of an inflow entered though their time came, with a cure; None if all inflows let some in.

    Fewer than all is no trouble: an inflow without a rate goes on for as long as there is room.
    """
    if not result.flows or result.outcome.failed or not result.summary:  # the last: it is still running
        return None
    events = result.events
    entered = {
        ball for ball, kind in zip(events["ball"].tolist(), events["kind"].tolist(), strict=True) if kind
    }
    told = []
    for inflow in result.scene.inflows:
        if inflow.start <= result.summary["time"] and entered.isdisjoint(inflow.ball_names()):
            told.append(f"none of {counted(inflow.count, 'ball')} of inflow {quoted(inflow.name)} entered")
    return "; ".join(told) + ": no place in the region had room for one" if told else None
