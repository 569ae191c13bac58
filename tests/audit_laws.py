"""Random scenes (`audit_mixed`, `audit_random`) by the impact laws beside `sequence`, for the auditor.

python tests/audit_laws.py poisson 130       # tries so many seeds of each, and says which were found at fault
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path

import audit_mixed
import audit_random
import audit_scenes
import carom
from carom import audit


def main() -> None:
    """Tries the scenes of `nsga` by a law: `LAW COUNT`."""
    law, count = sys.argv[1], int(sys.argv[2])
    tried = accused = 0
    warnings.simplefilter("ignore", carom.CaromWarning)
    for source in (audit_mixed, audit_random):
        for seed in range(count):
            scene, options = source.scene(seed)
            if options["method"] != "nsga":
                continue
            with tempfile.TemporaryDirectory() as scratch:
                path = Path(scratch) / "run"
                with suppress(carom.RunFailed):  # what was done until then is judged
                    audit_scenes.run(scene, path, source.UNTIL, **{**options, "impact": law})
                report = audit.check(path)
            tried += 1
            if not report.ok:
                accused += 1
                print(f"{source.__name__}, seed {seed}, {options}: {report.findings}", flush=True)
    print(f"{law}: {tried} scenes tried, {accused} found at fault")


if __name__ == "__main__":
    main()
