"""Parameters fitted to measurements: `carom.fit("fit.toml", "folder")`, `carom fit FIT.toml -o FOLDER`.

A `Calibration` says what is fitted to what. A search asks for points; each is some cases of one sweep, in whose folder all
points are kept. A search that is repeated asks for the same points, so an interrupted fit goes on from there.
"""

from carom.many.fit.calibration import Calibration
from carom.many.fit.points import State
from carom.many.fit.result import Fit, fit

__all__ = ["Calibration", "Fit", "State", "fit"]
