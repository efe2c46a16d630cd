"""Workers do every task, and a worker that dies costs time, not a result."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from regolithd.calibration.mismatch.errors import MismatchError
from regolithd.calibration.mismatch.fleet.work.workers import TASKS_EACH, AllCores, DaskCluster, ThisProcess, Workers

if TYPE_CHECKING:
    from collections.abc import Callable


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
    assert dict(ThisProcess().results(range(3), lambda n: partial(square, n))) == {0: 0, 1: 1, 2: 4}


@pytest.mark.parametrize(("workers", "ahead"), [(ThisProcess(), 1), (AllCores(2), 2 * TASKS_EACH)])
def test_a_task_is_made_when_its_turn_comes(workers: Workers, ahead: int) -> None:
    """Of many tasks, which may hold long arrays, only a few for each worker are there at a time."""
    made: list[int] = []

    def task_of(number: int) -> Callable[[], int]:
        made.append(number)
        return partial(square, number)

    for done, _ in enumerate(workers.results(range(20), task_of)):
        assert len(made) <= done + ahead
    assert made == list(range(20))


def test_a_process_that_dies_is_replaced(tmp_path: Path) -> None:
    """All results are there, each once."""
    results = list(AllCores(2).results(range(9), lambda n: partial(dies_first, tmp_path / "died", n)))
    assert sorted(results) == [(n, n * n) for n in range(9)]
    assert (tmp_path / "died").exists()


def test_processes_that_keep_dying_are_an_error(tmp_path: Path) -> None:
    """With how many recordings are left."""
    with pytest.raises(MismatchError, match="died 3 times, with 1 recordings left"):
        list(AllCores(1).results([0], lambda _: partial(die, tmp_path)))


def die(_: Path) -> None:
    """Kill the own process."""
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_scheduler_that_does_not_answer_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """One message with the address."""
    pytest.importorskip("distributed", reason="pip install 'regolithd[cluster]'")
    monkeypatch.setattr("regolithd.calibration.mismatch.fleet.work.workers.CONNECT_S", "1s")
    with pytest.raises(MismatchError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1"):
        DaskCluster("tcp://127.0.0.1:1")


def waits(folder: Path, number: int) -> int:
    """Leave a file that is named by the own process, and wait for longer than any test."""
    (folder / str(os.getpid())).touch()
    time.sleep(600)
    return number


def compare_for_long(folder: Path) -> None:
    """Keep two workers at work."""
    list(AllCores(2).results(range(4), lambda n: partial(waits, folder, n)))


def is_there(process: int) -> bool:
    """Return whether a process runs: one that has ended, and that nobody waits for, does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("by", [signal.SIGKILL, signal.SIGTERM])
def test_workers_end_with_a_parent_that_is_killed(by: signal.Signals, tmp_path: Path) -> None:
    """Within seconds, also in the middle of their work."""
    code = f"import test_workers, pathlib; test_workers.compare_for_long(pathlib.Path({str(tmp_path)!r}))"
    paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    with subprocess.Popen([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": paths}) as parent:
        try:
            until(lambda: len(list(tmp_path.iterdir())) == 2)
        finally:
            parent.send_signal(by)
    workers = [int(path.name) for path in tmp_path.iterdir()]
    assert len(workers) == 2
    until(lambda: not any(map(is_there, workers)))


def until(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)
