"""What all Python tests share: random tests that repeat themselves."""

import os

from hypothesis import HealthCheck, settings

# The quick tier draws the same examples each time, so that a red run means a change of the code. Whoever sets
# CAROM_HYPOTHESIS=search looks for new ones.
_common = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow], "print_blob": True}
settings.register_profile("quick", derandomize=True, **_common)
settings.register_profile("search", max_examples=1000, **_common)
settings.load_profile(os.environ.get("CAROM_HYPOTHESIS", "quick"))
