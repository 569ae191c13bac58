"""Write `paper/impact_laws.png`, a figure of the paper: python paper/figures.py

The other one, `docs/table9.png`, is drawn by tools/table_picture.py.
"""

from __future__ import annotations

from pathlib import Path

import carom
import matplotlib
from carom.chains import chain

FILE = Path(__file__).parent / "impact_laws.png"


def main() -> None:
    matplotlib.use("agg")
    carom.compare(chain(5), laws="all").plot().savefig(FILE, dpi=160)


if __name__ == "__main__":
    main()
