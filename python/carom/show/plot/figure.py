"""The figures that are returned: matplotlib's, and shown by a notebook also where pyplot was never imported."""

from __future__ import annotations

import io

from matplotlib.figure import Figure  # noqa: TID253 this module is imported where figures are drawn


class Drawing(Figure):
    """A matplotlib figure that a notebook shows as a picture.

    IPython knows how to show figures only from the first import of pyplot on, and told their size in words before.
    """

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()
