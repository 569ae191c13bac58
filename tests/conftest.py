"""What all Python tests share: random tests that repeat themselves, and counts of what they tried."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from trials import Trials

# The quick tier draws the same examples each time, so that a red run means a change of the code. Whoever sets
# CAROM_HYPOTHESIS=search looks for new ones.
_common = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow], "print_blob": True}
settings.register_profile("quick", derandomize=True, **_common)
settings.register_profile("search", max_examples=1000, **_common)
settings.load_profile(os.environ.get("CAROM_HYPOTHESIS", "quick"))

# tools/browser.sh puts a browser there where the machine has none.
_browser = Path(__file__).parents[1] / ".venv" / "browser" / "chromium"
if _browser.exists():
    os.environ.setdefault("CAROM_BROWSER", str(_browser))

#: Of all tests of this run.
TOTAL = Trials()


@pytest.fixture
def trials(request: pytest.FixtureRequest) -> Iterator[Trials]:
    """Counts the trials of a test: `with trials("kills survived"): ...`."""
    counted = Trials()
    yield counted
    request.node.user_properties += counted.properties()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    # Fixtures end before the last report of a test, and each report repeats the properties.
    if report.when == "teardown":
        TOTAL.add(report.user_properties)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if TOTAL.tried:
        terminalreporter.section("tried many times: held of tried")
        for line in TOTAL.lines():
            terminalreporter.line(line)
