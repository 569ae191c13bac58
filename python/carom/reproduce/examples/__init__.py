"""One module per example of the paper. `NAMES` is the list, in the paper's order; everything else follows from it."""

from __future__ import annotations

#: Section or appendix of the paper -> module of this package, which has `reproduce(context: Context) -> Example`.
NAMES = {
    "5.1": "s51",
    "5.2": "s52",
    "5.3": "s53",
    "5.4": "s54",
    "5.5": "s55",
    "5.6": "s56",
    "A": "appendix_a",
    "B": "appendix_b",
    "C": "appendix_c",
}
