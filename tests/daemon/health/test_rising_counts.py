"""An error that lasts is told from a single one."""

from regolithd.daemon.health.rising_counts import RisingCounts

SECOND = 1_000_000_000


def fed(counts: dict[int, int], until: int) -> RisingCounts:
    """Return the counts of one name, which changes at the given seconds."""
    rising = RisingCounts()
    count = 0
    for second in range(until + 1):
        count = counts.get(second, count)
        if count:
            rising.step({"wrong-length": count}, second * SECOND)
    return rising


def test_a_count_that_rises_for_ten_seconds_lasts_until_it_has_stopped() -> None:
    """It lasts after ten seconds with short pauses, and no longer once it has paused for more than five."""
    rising = fed({0: 1, 4: 9, 8: 20, 11: 21}, 11)
    assert rising.lasting(11 * SECOND) == ("wrong-length",)
    assert rising.lasting(16 * SECOND) == ("wrong-length",)
    assert rising.lasting(17 * SECOND) == ()


def test_single_errors_do_not_last() -> None:
    """Neither one error nor one every six seconds is a lasting one."""
    assert fed({0: 1}, 12).lasting(12 * SECOND) == ()
    assert fed({second: second + 1 for second in range(0, 60, 6)}, 55).lasting(55 * SECOND) == ()
