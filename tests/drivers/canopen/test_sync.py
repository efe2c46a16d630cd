"""The SYNC producer's counters."""

from __future__ import annotations

import pytest

from regolithd.drivers.canopen.sync import SyncCounters


def test_jitter_is_the_standard_deviation_of_the_lateness() -> None:
    """Mean, maximum and standard deviation of three values are exact."""
    counters = SyncCounters()
    for late in (100, 200, 600):
        counters.count(late)
    assert (counters.produced, counters.worst_late_ns, counters.mean_late_ns) == (3, 600, 300.0)
    assert counters.jitter_ns == pytest.approx(216.02469)
