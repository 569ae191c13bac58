"""What is asked of the cases, and what the small version is expected to do."""

from __future__ import annotations

from dataclasses import dataclass

from scenes import WHOLE, Silo

#: Grains a second through the orifices, by all codes of the article within 5 %.
RATES = {"silo-large": 23_200.0, "silo-small": 7_700.0}
RATE_OFF = 0.05
#: Their ratio, and how far it may be off.
RATIO, RATIO_OFF = 3.10, 0.1
#: Largest distance of the curve from a straight line, over all grains: twice that of the published curves.
STRAIGHT = 0.008
#: Peaks and troughs of the drum: share of the count, and time in s. A trough near zero has no share that means anything,
#: so that one per cent of the grains of its kind is allowed besides.
TURN_OFF, TURN_LATE, TURN_LEAST = 0.15, 0.15, 0.01
#: Wall time of LIGGGHTS on 24 ranks of a Threadripper 5965WX, s.
LIGGGHTS_S = {"silo-large": 5892.0, "drum": 15_855.0}
#: The small silo has few grains across its orifice; k of Beverloo's law is known to some tenths.
SMALL_RATE_OFF = 0.1


@dataclass(frozen=True)
class Check:
    """A number beside what is asked of it."""

    name: str
    value: str
    asked: str
    ok: bool


def expected_rate(name: str, case: Silo) -> float:
    """Grains a second: as published, for another orifice by the law of Beverloo, Leniger and van de Velde (1961).

    The rate grows as (D - k d)^2.5. Both published rates together give k.
    """
    widths = {key: 2 * silo.orifice for key, silo in WHOLE.items() if isinstance(silo, Silo)}
    root = (RATES["silo-large"] / RATES["silo-small"]) ** 0.4
    lost = (root * widths["silo-small"] - widths["silo-large"]) / (root - 1)
    return float(RATES[name] * ((2 * case.orifice - lost) / (widths[name] - lost)) ** 2.5)
