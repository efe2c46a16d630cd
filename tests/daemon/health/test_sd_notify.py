"""systemd gets each notification, and task liveness names the tasks that do not report in time."""

import os
import socket
from pathlib import Path

import pytest

from regolithd.daemon.health.liveness import TaskLiveness
from regolithd.daemon.health.sd_notify import READY, notify, watchdog_period_s


def test_systemd_gets_each_notification(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One datagram is sent to the socket that NOTIFY_SOCKET names."""
    path = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(path))
        listener.settimeout(10)
        monkeypatch.setenv("NOTIFY_SOCKET", str(path))
        notify(f"{READY}\nSTATUS=acquiring")
        assert listener.recv(100) == b"READY=1\nSTATUS=acquiring"


def test_without_systemd_or_with_a_dead_one_nothing_happens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a socket, or with one that nobody reads, no error is raised."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    notify(READY)
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "nobody"))
    notify(READY)


def test_the_watchdog_is_fed_twice_as_often_as_asked_and_only_by_whom_it_concerns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The period is half of WATCHDOG_USEC, and None in a process that WATCHDOG_PID does not name."""
    monkeypatch.delenv("WATCHDOG_USEC", raising=False)
    assert watchdog_period_s() is None
    monkeypatch.setenv("WATCHDOG_USEC", "10000000")
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
    assert watchdog_period_s() == 5.0
    monkeypatch.setenv("WATCHDOG_PID", "1")
    assert watchdog_period_s() is None


def test_a_task_that_is_silent_for_too_long_is_named() -> None:
    """A task is overdue when its own timeout has passed since its last report."""
    now = 0
    liveness = TaskLiveness(lambda: now)
    liveness.expect("bus", 1.0)
    liveness.expect("recording", 3.0)
    now = 2_000_000_000
    assert liveness.overdue() == ["bus"]
    liveness.beat("bus")
    assert liveness.overdue() == []
    now = 4_000_000_000
    assert liveness.overdue() == ["bus", "recording"]
    assert liveness.ages_s() == {"bus": 2.0, "recording": 4.0}
