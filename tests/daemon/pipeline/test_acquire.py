"""One snapshot for each SYNC: what did not come is NaN, and every reading is counted."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.daemon.pipeline.acquire import Acquisition
from regolithd.daemon.pipeline.snapshot import Snapshot
from regolithd.drivers.devices.decoding.signals import Reading, Sync
from regolithd.drivers.devices.ground_speed import GROUND_SPEED, GROUND_SPEED_SENSOR
from regolithd.drivers.devices.load_cell import LOAD
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER, MOTOR_CURRENT, MOTOR_SPEED
from regolithd.drivers.devices.node import NodeDescription

PERIOD_NS = 500_000_000
MOTORS = tuple(NodeDescription(k + 1, MOTOR_CONTROLLER, k) for k in range(6))
PDOS = tuple(0x181 + k for k in range(6))
MS = 1_000_000


def acquisition() -> Acquisition:
    """Return the acquisition of six motor controllers."""
    return Acquisition(MOTORS, PDOS, PERIOD_NS)


def reading(node: int, time_ns: int, current: float = 0.08) -> Reading:
    """Return one motor's TPDO as a reading."""
    return Reading(time_ns, node, 0x180 + node, ((MOTOR_CURRENT, current), (MOTOR_SPEED, 400.0)))


def window(taken: Acquisition, k: int, nodes: range | tuple[int, ...] = range(1, 7)) -> list[Snapshot]:
    """Feed one SYNC and its answers; return the snapshots that closed."""
    start = k * PERIOD_NS
    items = [Sync(start), *(reading(node, start + node * MS, current=k + node / 10) for node in nodes)]
    return [snapshot for item in items if (snapshot := taken.accept(item))]


def test_the_first_window_closes_at_the_next_sync_and_later_ones_when_everybody_has_answered() -> None:
    """Which PDOs to wait for follows from the windows before."""
    taken = acquisition()
    assert window(taken, 0) == []
    first, second = window(taken, 1)
    assert (first.sequence, second.sequence) == (0, 1)
    np.testing.assert_allclose(second.motor_current_A, 1 + np.arange(1, 7) / 10)
    assert np.isnan(second.load_N).all()
    assert not second.valid.any()


def test_a_value_that_did_not_come_is_nan_and_counted_never_repeated() -> None:
    """Node 3 does not answer in the third window."""
    taken = acquisition()
    for k in range(2):
        window(taken, k)
    assert window(taken, 2, nodes=(1, 2, 4, 5, 6)) == []
    (third, *_) = window(taken, 3)
    assert np.isnan(third.motor_current_A).tolist() == [False, False, True, False, False, False]
    assert taken.counters.missing == 1


def test_a_lost_node_delays_three_snapshots_and_no_more_and_is_taken_up_again_when_it_returns() -> None:
    """A PDO that stopped coming is awaited for three windows."""
    taken = acquisition()
    for k in range(3):
        window(taken, k)
    closed = [len(window(taken, k, nodes=(1, 2, 4, 5, 6))) for k in range(3, 9)]
    assert closed == [0, 1, 1, 2, 1, 1]  # from the fourth on, each closes in its own window again
    window(taken, 9)
    again = [snapshot for k in range(10, 14) for snapshot in window(taken, k)]
    assert not np.isnan(again[-1].motor_current_A).any()


def test_the_first_answer_of_a_node_may_come_after_the_others_have_closed_the_window() -> None:
    """Node 1 boots before the others: window 1 closes with its answer, and the first answers of 2 to 6 are late."""
    taken = acquisition()
    window(taken, 0, nodes=(1,))
    (_, second) = window(taken, 1)
    assert np.isfinite(second.motor_current_A).tolist() == [True] + [False] * 5
    assert taken.counters.late == 5
    (third,) = window(taken, 2)
    assert np.isfinite(third.motor_current_A).all()


def test_an_answer_that_comes_after_the_next_sync_is_never_taken_for_a_fresh_one() -> None:
    """Node 6 answers SYNC 2 after SYNC 3, then SYNC 3, and the second answer is accepted."""
    taken = acquisition()
    for k in range(2):
        window(taken, k)
    window(taken, 2, nodes=range(1, 6))
    taken.accept(Sync(3 * PERIOD_NS))
    taken.accept(reading(6, 3 * PERIOD_NS + MS, current=2.6))  # of SYNC 2
    closed = [taken.accept(reading(node, 3 * PERIOD_NS + 9 * MS, current=3 + node / 10)) for node in range(1, 7)]
    assert closed[:-1] == [None] * 5
    third = closed[-1]
    assert third is not None
    assert third.motor_current_A[5] == pytest.approx(3.6)
    assert taken.counters.late == 1


def test_answers_that_came_in_a_burst_across_a_sync_are_told_apart() -> None:
    """Node 6 is delayed by two SYNCs, and of its three answers only that to the newest is accepted."""
    taken = acquisition()
    for k in range(2):
        window(taken, k)
    for k in (2, 3):
        window(taken, k, nodes=range(1, 6))
    taken.accept(reading(6, 3 * PERIOD_NS + 9 * MS, current=2.6))  # of SYNC 2, and those of 3 and 4 follow
    fourth = taken.accept(Sync(4 * PERIOD_NS))
    assert fourth is not None
    assert np.isnan(fourth.motor_current_A[5])
    for node in range(1, 6):
        taken.accept(reading(node, 4 * PERIOD_NS + MS))
    taken.accept(reading(6, 4 * PERIOD_NS + 2 * MS, current=3.6))
    closed = taken.accept(reading(6, 4 * PERIOD_NS + 3 * MS, current=4.6))
    assert closed is not None
    assert closed.motor_current_A[5] == pytest.approx(4.6)


def test_a_single_answer_after_a_missing_one_is_ambiguous_for_three_windows() -> None:
    """It may be the missing one; after three windows with one answer each, the missing one counts as lost."""
    taken = acquisition()
    for k in range(2):
        window(taken, k)
    window(taken, 2, nodes=range(1, 6))
    closed = [snapshot for k in range(3, 8) for snapshot in window(taken, k)]
    known = {snapshot.sequence: bool(np.isfinite(snapshot.motor_current_A[5])) for snapshot in closed}
    assert known == {2: False, 3: False, 4: False, 5: False, 6: True, 7: True}


@given(st.lists(st.sampled_from((0, 0, 1, 1, 1, 2, 3)), max_size=80))
def test_no_answer_of_a_delayed_node_is_ever_taken_for_one_to_another_sync(released: list[int]) -> None:
    """Whatever it is delayed by, and however it catches up, short of five windows in a row with one old answer each."""
    period_ns, waiting, steady = 100 * MS, list[int](), 0
    taken = Acquisition(MOTORS, PDOS, period_ns)
    for k, count in enumerate([1, 1, 1, *released]):
        waiting.append(k)
        answers = [
            reading(6, k * period_ns + (8 + each) * MS, current=waiting.pop(0))
            for each in range(min(count, len(waiting)))
        ]
        steady = steady + 1 if len(answers) == 1 and waiting else 0
        if steady == 5:
            break
        for item in (
            Sync(k * period_ns),
            *(reading(node, k * period_ns + node * MS) for node in range(1, 6)),
            *answers,
        ):
            snapshot = taken.accept(item)
            if snapshot is not None:
                assert snapshot.motor_current_A[5] == snapshot.sequence or np.isnan(snapshot.motor_current_A[5])


def test_steady_answers_of_the_period_before_are_dropped_for_half_a_second() -> None:
    """At 100 Hz for fifty windows; then they count as answers in time after one that was lost."""
    period_ns = 10 * MS
    taken = Acquisition(MOTORS[:1], PDOS[:1], period_ns)
    for k in range(54):
        taken.accept(Sync(k * period_ns))
        if k != 1:
            taken.accept(reading(1, k * period_ns + MS))
        assert taken.counters.accepted == max(1, k - 50), k


def test_a_node_that_answers_after_five_seconds_of_silence_is_taken_at_its_newest_answer() -> None:
    """The five hundred old ones, in a burst, are dropped."""
    period_ns = 10 * MS
    taken = Acquisition(MOTORS[:1], PDOS[:1], period_ns)
    taken.accept(Sync(0))
    taken.accept(reading(1, MS))
    for k in range(1, 501):
        taken.accept(Sync(k * period_ns))
    for k in range(1, 501):
        taken.accept(reading(1, 500 * period_ns + k * 1000, current=float(k)))
    last = taken.accept(Sync(501 * period_ns))
    assert last is not None
    assert last.motor_current_A[0] == 500.0
    assert (taken.counters.accepted, taken.counters.late) == (2, 499)


def test_an_answer_outside_the_synchronous_window_is_late() -> None:
    """An answer in the last tenth of the period is late."""
    taken = acquisition()
    taken.accept(Sync(0))
    taken.accept(reading(1, int(0.95 * PERIOD_NS)))
    snapshot = taken.accept(Sync(PERIOD_NS))
    assert snapshot is not None
    assert np.isnan(snapshot.motor_current_A).all()
    assert (taken.counters.late, taken.counters.missing) == (1, 6)


def test_foreign_duplicate_and_early_readings_are_counted_and_not_taken() -> None:
    """Each is counted under its name, and of a duplicate the first is kept."""
    taken = acquisition()
    taken.accept(reading(1, 0))
    taken.accept(Sync(PERIOD_NS))
    taken.accept(reading(1, PERIOD_NS + MS, current=0.1))
    taken.accept(reading(1, PERIOD_NS + 2 * MS, current=0.2))
    taken.accept(Reading(PERIOD_NS + 3 * MS, 99, 0x1E3, ((LOAD, 1.0),)))
    snapshot = taken.accept(Sync(2 * PERIOD_NS))
    assert snapshot is not None
    assert snapshot.motor_current_A[0] == pytest.approx(0.1)
    counters = taken.counters
    assert (counters.late, counters.duplicate, counters.unexpected) == (1, 1, 1)


def test_what_one_node_measures_for_the_body_stands_at_all_wheels_and_nothing_can_be_changed_later() -> None:
    """A quantity of the body has its value in all six columns, and the arrays are read-only."""
    taken = Acquisition((NodeDescription(22, GROUND_SPEED_SENSOR, None),), (0x196,), PERIOD_NS)
    taken.accept(Sync(1_234_567_891))
    taken.accept(Reading(1_235_000_000, 22, 0x196, ((GROUND_SPEED, 0.0215),)))
    snapshot = taken.accept(Sync(1_734_567_891))
    assert snapshot is not None
    assert snapshot.time_ns == 1_234_567_000  # whole microseconds, as the log has it
    assert snapshot.ground_speed_m_s.tolist() == [0.0215] * 6
    with pytest.raises(ValueError, match="read-only"):
        snapshot.load_N[0] = 1.0


def twice(taken: Acquisition, k: int) -> list[Snapshot]:
    """Feed one window in which two nodes answer with node-ID 3, with different currents."""
    closed = window(taken, k)
    return closed + [made for made in [taken.accept(reading(3, k * PERIOD_NS + 20 * MS, current=9.9))] if made]


def test_of_two_nodes_with_one_id_no_value_is_published_from_the_second_duplicate_on() -> None:
    """The others' values are; the node-ID is named, and free again once its PDO comes once for four windows."""
    taken = acquisition()
    window(taken, 0)
    window(taken, 1)
    twice(taken, 2)
    assert taken.shared_node_ids == ()
    twice(taken, 3)
    assert taken.shared_node_ids == (3,)
    for k in range(4, 7):
        last = twice(taken, k)[-1]
        assert np.isnan(last.motor_current_A).tolist() == [False, False, True, False, False, False]
    assert taken.counters.doubtful == 3
    for k in range(7, 12):
        closed = window(taken, k)
    assert taken.shared_node_ids == ()
    assert closed[-1].motor_current_A[2] == pytest.approx(11.3)


def test_a_single_duplicate_is_no_second_node() -> None:
    """A CAN controller may receive one frame twice: the first is kept, and nothing is doubtful."""
    taken = acquisition()
    window(taken, 0)
    twice(taken, 1)
    for k in range(2, 6):
        assert np.isfinite(window(taken, k)[-1].motor_current_A).all()
    assert (taken.counters.duplicate, taken.counters.doubtful, taken.shared_node_ids) == (1, 0, ())


def test_a_second_sync_producer_makes_no_snapshot_and_its_answers_no_value() -> None:
    """Once our own SYNC is known, values sampled beside a foreign one are dropped; they return when it ends."""
    taken = acquisition()

    def syncs(k: int, *, foreign: bool) -> list[Snapshot]:
        start = k * PERIOD_NS
        items = [Sync(start, sent=True), *(reading(node, start + node * MS) for node in range(1, 7))]
        if foreign:
            items += [Sync(start + 200 * MS), *(reading(node, start + (200 + node) * MS) for node in range(1, 7))]
        return [made for item in items if (made := taken.accept(item))]

    made = [snapshot for k in range(3) for snapshot in syncs(k, foreign=False)]
    disturbed = [snapshot for k in range(3, 8) for snapshot in syncs(k, foreign=True)]
    after = [snapshot for k in range(8, 14) for snapshot in syncs(k, foreign=False)]
    assert [snapshot.sequence for snapshot in (*made, *disturbed, *after)] == list(range(14))
    assert np.isfinite(disturbed[0].motor_current_A).all()  # it had closed before the foreign SYNC came
    assert all(np.isnan(snapshot.motor_current_A).all() for snapshot in disturbed[1:])
    assert np.isfinite(after[-1].motor_current_A).all()
    assert taken.shared_node_ids == ()
    assert taken.counters.doubtful == 42


@given(st.lists(st.tuples(st.integers(0, 7), st.integers(0, 20 * PERIOD_NS)), max_size=200))
def test_every_reading_is_accounted_for_whatever_the_order(events: list[tuple[int, int]]) -> None:
    """The counts add up for any order of SYNCs, readings and unknown nodes, and for times that go backwards."""
    taken = acquisition()
    snapshots = [
        snapshot
        for node, time_ns in events
        if (snapshot := taken.accept(Sync(time_ns) if node == 0 else reading(node, time_ns)))
    ]
    counters = taken.counters
    readings = sum(node != 0 for node, _ in events)
    assert counters.accepted + counters.late + counters.duplicate + counters.unexpected + counters.doubtful == readings
    assert counters.snapshots == len(snapshots)
    assert [snapshot.sequence for snapshot in snapshots] == list(range(len(snapshots)))
