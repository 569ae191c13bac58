"""The pictures of a film, one after the other."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from carom.show.film.look import Look
from carom.show.film.playback import Playback
from carom.show.film.stage import Stage

if TYPE_CHECKING:
    from carom.export.frames import Selection


def pictures(selection: Selection, look: Look) -> Iterator[NDArray[np.uint8]]:
    """All pictures, (height, width, 3) each, drawn as they are asked for."""
    playback = Playback(selection, look)
    stage = Stage(selection.result, playback, look)
    try:
        for k, time in enumerate(playback.times.tolist(), 1):
            yield stage.picture(playback.at(time))
            if look.progress is not None:
                look.progress(k, len(playback.times))
    finally:
        stage.close()
