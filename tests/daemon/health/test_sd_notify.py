"""systemd hears what it is told, and the watchdog is fed only while every task answers."""

import os
import socket
from pathlib import Path

import pytest

from regolithd.daemon.health.liveness import TaskLiveness
from regolithd.daemon.health.sd_notify import READY, notify, watchdog_period_s


def test_systemd_hears_what_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One datagram, as sd_notify(3) says."""
    path = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(path))
        listener.settimeout(10)
        monkeypatch.setenv("NOTIFY_SOCKET", str(path))
        notify(f"{READY}\nSTATUS=acquiring")
        assert listener.recv(100) == b"READY=1\nSTATUS=acquiring"


def test_without_systemd_or_with_a_dead_one_nothing_happens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The daemon runs anywhere."""
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    notify(READY)
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "nobody"))
    notify(READY)


def test_the_watchdog_is_fed_twice_as_often_as_asked_and_only_by_whom_it_concerns(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """sd_watchdog_enabled(3)."""
    monkeypatch.delenv("WATCHDOG_USEC", raising=False)
    assert watchdog_period_s() is None
    monkeypatch.setenv("WATCHDOG_USEC", "10000000")
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
    assert watchdog_period_s() == 5.0
    monkeypatch.setenv("WATCHDOG_PID", "1")
    assert watchdog_period_s() is None


def test_a_task_that_is_silent_for_too_long_is_named() -> None:
    """Each has its own patience."""
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
