"""`python -m fuzz TARGET SECONDS [SEED]` in `tests`: goes on with one kind of input and shows what it finds."""

from __future__ import annotations

import collections
import hashlib
import sys
import tempfile
import time
from pathlib import Path

from fuzz import campaign, material
from fuzz.pool import Pool


def main() -> None:
    target, seconds = sys.argv[1], float(sys.argv[2])
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    found = Path("fuzz-findings")
    verdicts: collections.Counter[str] = collections.Counter()
    seen: collections.Counter[str] = collections.Counter()
    with tempfile.TemporaryDirectory() as scratch:
        base = material.make(Path(scratch))
        cases = campaign.cases(target, base, seed)
        begin = time.monotonic()
        with Pool(base) as pool:
            while time.monotonic() - begin < seconds:
                case = next(cases)
                verdict = pool.one(target, case)
                verdicts[verdict.kind] += 1
                if not verdict.ok:
                    last = verdict.text.splitlines()[-1] if verdict.text else ""
                    seen[f"{verdict.kind} {last[:60]}"] += 1
                    if seen[f"{verdict.kind} {last[:60]}"] <= 2:
                        found.mkdir(exist_ok=True)
                        name = f"{target}-{hashlib.sha256(case).hexdigest()[:12]}"
                        (found / name).write_bytes(case)
                        print(f"{name}: {verdict.kind}\n{verdict.text}\n", flush=True)
    print(f"{target}: {sum(verdicts.values())} cases in {time.monotonic() - begin:.0f} s: {dict(verdicts)}")
    for what, count in seen.most_common():
        print(f"  {count:6d}  {what}")


if __name__ == "__main__":
    main()
