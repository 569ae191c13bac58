"""`carom view`: a run as one HTML file that plays in any browser, offline.

The page is written by Python alone. Its program is three.js and our own code, bundled once
from `viewer/` at the root of the repository and kept here under `assets/`.
"""

from carom.show.viewer.page import ViewInfo, write_html

__all__ = ["ViewInfo", "write_html"]
