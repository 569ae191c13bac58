"""An example without end; says in a file that it has begun."""

from __future__ import annotations

import os
import time
from pathlib import Path

from carom.reproduce.document import Context, Example


def reproduce(context: Context) -> Example:
    Path(os.environ["CAROM_TEST_BEGUN"]).write_text(str(os.getpid()))
    time.sleep(600)
    raise AssertionError
