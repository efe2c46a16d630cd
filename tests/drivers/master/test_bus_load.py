"""The worst-case bus load."""

from __future__ import annotations

import pytest

from regolithd.drivers.master.bus_load import bus_load, frame_bits
from regolithd.drivers.virtual.rover import KAPVIK


def test_the_worst_case_bus_load() -> None:
    """Bits per frame follow the published formula, and Kapvik's fourteen nodes at 100 Hz take a fifth of 1 Mbit/s."""
    assert [frame_bits(size) for size in (0, 1, 8)] == [55, 65, 135]
    share = bus_load(KAPVIK, sync_rate_Hz=100.0, bitrate=1_000_000)
    assert share == pytest.approx((55 + 6 * 135 + 6 * 105 + 115 + 105) * 100e-6 + 65 * 80e-6)
    assert bus_load(KAPVIK, sync_rate_Hz=200.0, bitrate=125_000) > 1.0
