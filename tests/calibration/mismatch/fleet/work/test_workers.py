"""Workers do every task, and a worker that dies costs time, not a result."""

from __future__ import annotations

import os
import signal
from functools import partial
from typing import TYPE_CHECKING

import pytest

from regolithd.calibration.mismatch.errors import MismatchError
from regolithd.calibration.mismatch.fleet.work.workers import AllCores, DaskCluster, ThisProcess

if TYPE_CHECKING:
    from pathlib import Path


def square(number: int) -> int:
    """Return a square."""
    return number * number


def dies_first(marker: Path, number: int) -> int:
    """Kill the own process the first time; then return a square."""
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def test_this_process_does_every_task() -> None:
    """Results come with the numbers of their tasks."""
    assert dict(ThisProcess().results({n: partial(square, n) for n in range(3)})) == {0: 0, 1: 1, 2: 4}


def test_a_process_that_dies_is_replaced(tmp_path: Path) -> None:
    """All results are there, each once."""
    tasks = {n: partial(dies_first, tmp_path / "died", n) for n in range(4)}
    results = list(AllCores(2).results(tasks))
    assert sorted(results) == [(n, n * n) for n in range(4)]
    assert (tmp_path / "died").exists()


def test_processes_that_keep_dying_are_an_error(tmp_path: Path) -> None:
    """With how many recordings are left."""
    with pytest.raises(MismatchError, match="died 3 times, with 1 recordings left"):
        list(AllCores(1).results({0: partial(die, tmp_path)}))


def die(_: Path) -> None:
    """Kill the own process."""
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_scheduler_that_does_not_answer_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """One message with the address."""
    pytest.importorskip("distributed", reason="pip install 'regolithd[cluster]'")
    monkeypatch.setattr("regolithd.calibration.mismatch.fleet.work.workers.CONNECT_S", "1s")
    with pytest.raises(MismatchError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1"):
        DaskCluster("tcp://127.0.0.1:1")
