"""The counters of a bus."""

from __future__ import annotations

from regolithd.drivers.can.counters import BusCounters


def test_counters_are_integers_by_name() -> None:
    """The counters of error frames are beside the others, with the prefix `error_`."""
    counters = BusCounters(received=3, kernel_drops=2)
    counters.errors.update(["bus-off", "bus-off"])
    flat = counters.as_dict()
    assert (flat["received"], flat["kernel_drops"], flat["error_bus-off"]) == (3, 2, 2)
    assert "errors" not in flat
