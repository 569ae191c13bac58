"""Whatever stands in a file, Carom uses it or refuses it in words: no traceback, panic, hang or endless allocation.

Mutations by fixed seeds, in child processes with a limit on memory and time (`tests/fuzz`). The quick tier tries a few
hundred, the long tier thousands; `python -m fuzz TARGET SECONDS` in `tests` as many as one likes.
"""

from __future__ import annotations

import base64
import itertools
import os
import random
import time
import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from carom import CaromError
from carom.result.record import Segments
from trials import Trials

from fuzz import campaign, material
from fuzz.pool import Pool

CORPUS = Path(__file__).parent / "fuzz" / "corpus"
#: Cases of each target in the quick tier: about a second each.
QUICK = {
    "scenario": 40,
    "problem": 40,
    "result": 8,
    "resume": 16,
    "checkpoint": 80,
    "state": 600,
    "expression": 1200,
}
#: Seconds of each target in the long tier.
LONG = float(os.environ.get("CAROM_FUZZ_SECONDS", "60"))


assert QUICK.keys() == set(campaign.TARGETS)


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return material.make(tmp_path_factory.mktemp("material"))


def told(case: bytes, seen: str, folder: Path) -> str:
    """What a case is reported with, whole, to be tried again: scratch folders do not last."""
    (folder / "case").write_bytes(case)
    packed = base64.b64encode(zlib.compress(case)).decode()
    return f"{seen}\nthe input, kept in {folder / 'case'}: {case[:300]!r}\nzlib, base64: {packed}"


@pytest.fixture(scope="module")
def pool(base: Path) -> Iterator[Pool]:
    with Pool(base) as pool:
        yield pool


@pytest.mark.parametrize("target", QUICK)
def test_damaged_input_is_used_or_refused(
    target: str, base: Path, pool: Pool, tmp_path: Path, trials: Trials
) -> None:
    verdicts: Counter[str] = Counter()
    for case in itertools.islice(campaign.cases(target, base, 0), QUICK[target]):
        with trials(f"damaged input used or refused: {target}"):
            verdict = pool.one(target, case)
            assert verdict.ok, told(case, f"{verdict.kind}: {verdict.text}", tmp_path)
        verdicts[verdict.kind] += 1
    # The mutations are no use if they break nothing, or everything.
    assert verdicts["refused"] >= 0.1 * QUICK[target], verdicts
    assert verdicts["taken"] >= 1, verdicts


@pytest.mark.parametrize(
    "path", sorted(CORPUS.glob("*/*")), ids=lambda path: f"{path.parent.name}-{path.name}"
)
def test_what_was_trouble_once(path: Path, pool: Pool) -> None:
    verdict = pool.one(path.parent.name, path.read_bytes())
    assert verdict.ok, f"{verdict.kind}: {verdict.text}"


@pytest.mark.long
@pytest.mark.parametrize("target", QUICK)
def test_damaged_input_for_a_minute(target: str, base: Path, tmp_path: Path, trials: Trials) -> None:
    begin = time.monotonic()
    cases = campaign.cases(target, base, random.SystemRandom().randrange(10**9))
    with Pool(base, patience=60.0) as pool:
        while time.monotonic() - begin < LONG:
            case = next(cases)
            with trials(f"damaged input used or refused: {target}"):
                verdict = pool.one(target, case)
                assert verdict.ok, told(case, f"{verdict.kind}: {verdict.text}", tmp_path)


def test_the_harness_sees_what_it_is_for(base: Path) -> None:
    with Pool(base, patience=2.0) as pool:
        assert pool.one("_crash", b"segfault").kind == "crash"
        assert pool.one("_crash", b"allocate").kind == "MemoryError", "and the next case has a new child"
        assert pool.one("_crash", b"raise").kind == "KeyError"
        assert pool.one("_crash", b"hang").kind == "hang"


def test_a_file_cut_off_while_its_writer_lived_is_refused_at_once(base: Path, tmp_path: Path) -> None:
    # HDF5 reads on for ever here, in the hope that the writer brings the rest.
    whole = bytearray((base / material.RUN / "results.h5").read_bytes())
    whole[11] = 5  # open for writing, with readers
    cut = tmp_path / "results.h5"
    cut.write_bytes(whole[: len(whole) // 2])
    begin = time.monotonic()
    with pytest.raises(CaromError, match=r"results\.h5 cannot be read .*truncated file"):
        Segments([cut])
    assert time.monotonic() - begin < 5.0
