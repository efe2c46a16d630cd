"""Events of one kind and node are limited, none is uncounted, and the newest is always published."""

from hypothesis import given
from hypothesis import strategies as st

from regolithd.daemon.health.event_throttle import BURST, REFILL_PER_S, SUMMARISING_HOLD_NS, EventThrottle
from regolithd.drivers.can.bus import BusState
from regolithd.drivers.master.events import BusStateChanged, MotionStopped, NetworkEvent

SECOND_NS = 1_000_000_000


def stopped(time_ns: int, node_id: int = 1) -> MotionStopped:
    """Return an event with this time."""
    return MotionStopped(time_ns, node_id, "stopped")


def test_a_normal_rate_is_not_limited() -> None:
    """A burst, and later events at the refill rate, are all admitted."""
    throttle = EventThrottle()
    assert all(throttle.admits(stopped(k), 0) for k in range(BURST))
    pause_ns = int(SECOND_NS / REFILL_PER_S)
    assert all(throttle.admits(stopped(k), k * pause_ns) for k in range(1, 100))
    assert throttle.summaries() == []
    assert throttle.summarised(0) == ()


def test_one_node_or_kind_does_not_limit_another() -> None:
    """Each has its own bucket; an event without a node has one as well."""
    throttle = EventThrottle()
    for k in range(1000):
        throttle.admits(stopped(k), 0)
    assert throttle.admits(stopped(0, node_id=2), 0)
    assert throttle.admits(BusStateChanged(0, BusState.OFF, "off"), 0)
    assert throttle.summarised(0) == ((MotionStopped, 1),)
    assert throttle.summarised(SUMMARISING_HOLD_NS) == ()


@given(st.lists(st.tuples(st.integers(0, 300_000_000), st.integers(1, 2), st.booleans()), max_size=300))
def test_no_event_is_uncounted_or_overtaken(steps: list[tuple[int, int, bool]]) -> None:
    """Each event is published or counted; of one node they come in order, the newest last; the rate is bounded."""
    throttle = EventThrottle()
    now_ns = 0
    published: list[NetworkEvent] = []
    admitted = counted = 0
    for pause_ns, node_id, summarise in [*steps, (0, 0, True)]:
        now_ns += pause_ns
        event = stopped(now_ns, node_id)
        if node_id and throttle.admits(event, now_ns):
            published.append(event)
            admitted += 1
        for newest, withheld in throttle.summaries() if summarise else ():
            published.append(newest)
            counted += withheld
    assert admitted + counted == len(steps)
    assert counted == throttle.withheld
    for node in (1, 2):
        times = [event.time_ns for event in published if isinstance(event, MotionStopped) and event.node_id == node]
        assert times == sorted(times)
        assert times[-1:] == [event_ns for event_ns, node_id in events(steps) if node_id == node][-1:]
    assert admitted <= 2 * (BURST + now_ns / SECOND_NS * REFILL_PER_S)


def events(steps: list[tuple[int, int, bool]]) -> list[tuple[int, int]]:
    """Return time and node of each event."""
    return [(sum(pause for pause, *_ in steps[: k + 1]), node_id) for k, (_, node_id, _) in enumerate(steps)]
