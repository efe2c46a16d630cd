"""The checks of `make chaos` notice what they are there for."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from chaos import lost, plan, unnoticed
from chaos_faults import FAULTS, possible
from chaos_observers import MessageObserver, Snapshot, Window
from chaos_rig import Rig

from regolithd.daemon.messages.alarm import AlarmMessage

if TYPE_CHECKING:
    from collections.abc import Sequence


def snapshot(sequence: int, *, late: bool = False, session: str = "a", load_N: float | None = 50.0) -> Snapshot:
    """Return a snapshot, as the message observer keeps it."""
    values: dict[str, list[float | None]] = {"load_N": [load_N]}
    return Snapshot(session, sequence, 1000 * sequence, late, False, True, values, float(sequence))


def rig_with(snapshots: Sequence[Snapshot]) -> Rig:
    """Return a rig without processes that has received these snapshots."""
    bus: Any = SimpleNamespace(windows={}, speeds={})
    return Rig(None, None, bus, MessageObserver(0, snapshots=list(snapshots)))  # type: ignore[arg-type]


def test_what_arrives_in_order_and_complete_is_in_order() -> None:
    """Two sessions and a repetition that is marked violate nothing."""
    rig = rig_with([snapshot(0), snapshot(1), snapshot(1, late=True), snapshot(2), snapshot(0, session="b")])
    rig.check_order()
    assert rig.problems == []


@pytest.mark.parametrize(
    ("snapshots", "problem"),
    [
        ([snapshot(0), snapshot(2), snapshot(1)], "out of order"),
        ([snapshot(0), snapshot(2)], "lacks [1] of 3"),
        ([snapshot(0), snapshot(0)], "not marked"),
    ],
)
def test_disorder_holes_and_unmarked_repetitions_are_noticed(snapshots: list[Snapshot], problem: str) -> None:
    """Each is one problem that names the session."""
    rig = rig_with(snapshots)
    rig.check_order()
    assert [problem in found for found in rig.problems] == [True]


def test_what_was_queued_and_never_came_is_noticed() -> None:
    """A snapshot of the store of a killed daemon must arrive."""
    rig = rig_with([snapshot(0)])
    rig.queued = {("a", 0), ("a", 1)}
    rig.check_order()
    assert rig.problems == ["queued and lost: [('a', 1)]"]


def test_a_value_that_was_not_on_the_bus_is_noticed() -> None:
    """It is one of another SYNC, or invented; a value that is missing is neither."""
    rig = rig_with([])
    rig.bus.windows[1000] = Window(1_000_000, {("load_N", 0): {50.0}})
    rig.compare_with_bus([snapshot(1), snapshot(1, load_N=None)])
    assert rig.problems == []
    rig.compare_with_bus([snapshot(1, load_N=49.0)])
    assert "load_N of wheel 1 at 1000: 49.0 not on the bus" in rig.problems[0]


def test_missing_snapshots_are_counted_for_each_session() -> None:
    """The sequences between the first and the last that came are expected."""
    assert lost([snapshot(3), snapshot(6), snapshot(0, session="b"), snapshot(1, session="b")]) == 2
    assert lost([]) == 0


def test_a_seed_gives_the_same_faults_and_every_fault_comes() -> None:
    """The plan depends on the seed alone; each fault that this computer allows comes once before any comes again."""
    first, again, other = (plan(seed, []) for seed in (5, 5, 6))
    rounds = [next(first) for _ in possible()]
    assert rounds == [next(again) for _ in possible()]
    assert rounds != [next(other) for _ in possible()]
    assert {faults[0].name for faults, _, _ in rounds} == {fault.name for fault in possible()}


def test_an_alarm_that_was_active_already_is_heard() -> None:
    """It is published when it begins, which may have been in the round before; one that has ended is not heard."""
    observer = MessageObserver(0, others=[(1.0, "alarm/recording", {"active": True}), (1.5, "event", {"kind": "x"})])
    assert observer.heard("alarm/recording", 2.0, active=True)
    assert not observer.heard("event", 2.0, kind="x")
    observer.others.append((1.8, "alarm/recording", {"active": False}))
    assert not observer.heard("alarm/recording", 2.0, active=True)
    observer.others.append((2.1, "alarm/recording", {"active": True}))
    assert observer.heard("alarm/recording", 2.0, active=True)


def test_a_speed_that_no_longer_comes_says_nothing() -> None:
    """A drive without power stands still; one whose PDOs come is believed."""
    rig = rig_with([])
    rig.bus.speeds[1] = (0.5, time.monotonic())
    assert rig.turning()
    rig.bus.speeds[1] = (0.5, time.monotonic() - 3.0)
    assert not rig.turning()


def test_what_happens_while_no_daemon_runs_is_not_noticed_by_it() -> None:
    """A full disk beside a stopped broker is an alarm, beside a killed daemon it is not."""
    named = {fault.name: fault for fault in FAULTS}
    disk = named["disk full"]
    assert not unnoticed(disk, [disk, named["broker stopped"]])
    assert not unnoticed(disk, [disk, named["two hundred control clients"]])
    assert not unnoticed(named["daemon killed"], [named["daemon killed"], disk])
    for other in ("daemon killed", "daemon suspended", "link down"):
        assert unnoticed(disk, [named[other], disk])


def test_faults_name_messages_that_there_are() -> None:
    """A fault is heard by fields that its message has."""
    for fault in FAULTS:
        if fault.heard is not None and fault.heard[0].startswith("alarm/"):
            assert fault.heard[1].keys() <= AlarmMessage.model_fields.keys()


@pytest.mark.vcan
@pytest.mark.timeout(300)
def test_a_daemon_holds_under_a_few_faults() -> None:
    """Half a minute of faults on SocketCAN violates nothing."""
    here = Path(__file__).parent
    command = [sys.executable, here / "chaos.py", "--seconds", "25", "--seed", "4", "--figures", "/dev/shm/chaos.json"]
    path = f"{here}:{here.parent / 'bench'}:{here.parents[1] / 'src'}"
    done = subprocess.run(command, check=False, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-2000:]
