"""Where the work on single recordings is done: in this process, on all of its computer's cores, or on a Dask cluster.

A worker that dies costs time, not the answer: what it was doing is done again by another.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections import deque
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait as wait_for
from typing import TYPE_CHECKING, Protocol, Self, TypeVar

from regolithd.calibration.mismatch.errors import MismatchError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

Result = TypeVar("Result")

MOST_BROKEN_POOLS = 3
"""Pools of processes that may break before it is an error (a choice: a recording that is too large breaks each)."""
DASK_RETRIES = 3
"""Failures of one recording on a cluster before it is an error (a choice)."""
CONNECT_S = "30s"
"""How long to wait for the scheduler (a choice)."""
TASKS_EACH = 2
"""Tasks that are made for each worker at a time (a choice: it does one, and the next awaits it)."""
THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""One process for each core: threads of the linear algebra would only compete."""


class Workers(Protocol):
    """Calls tasks, and yields what each returns as it comes, with its number.

    A task is made when its turn comes, and is not kept: it may hold arrays as long as its recording.
    """

    def results(
        self, numbers: Sequence[int], task_of: Callable[[int], Callable[[], Result]]
    ) -> Iterator[tuple[int, Result]]:
        """Yield (number, result) in any order; `task_of` makes the task of a number."""


class ThisProcess:
    """One task after the other, here."""

    def results(
        self, numbers: Sequence[int], task_of: Callable[[int], Callable[[], Result]]
    ) -> Iterator[tuple[int, Result]]:
        """Yield in the order of the numbers."""
        for number in numbers:
            yield number, task_of(number)()


class AllCores:
    """A process for each core of this computer."""

    def __init__(self, processes: int | None = None) -> None:
        self._processes = processes or len(os.sched_getaffinity(0))

    def results(
        self, numbers: Sequence[int], task_of: Callable[[int], Callable[[], Result]]
    ) -> Iterator[tuple[int, Result]]:
        """Yield as they come; where a process dies, what is left is done by new ones.

        Raises
        ------
        MismatchError
            When processes keep dying.
        """
        left = list(numbers)
        for _ in range(MOST_BROKEN_POOLS):
            try:
                with _one_thread_each(), self._pool() as pool:
                    for number, result in _submitted(pool, left, task_of, lambda: self._processes):
                        left.remove(number)
                        yield number, result
            except BrokenProcessPool:
                continue
            return
        raise MismatchError(
            f"worker processes died {MOST_BROKEN_POOLS} times, with {len(left)} recordings left: is there memory?"
        )

    def _pool(self) -> ProcessPoolExecutor:
        # Not forked: threads of this process (progress, linear algebra) would be copied in the middle of their work.
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self._processes, mp_context=context, initializer=_end_with_parent)


def _end_with_parent() -> None:
    """End this process as soon as its parent has ended, however that did; a pool's worker would wait for work forever.

    One that is killed closes nothing, and each worker holds both ends of the pipe that it waits at.
    """
    threading.Thread(target=_ended_with_parent, daemon=True).start()


def _ended_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait_for([parent.sentinel])
        os._exit(1)


class DaskCluster:
    """The workers of a Dask cluster; they need the same version of regolithd, and see files under the same paths.

    A context manager that closes the connection: left open, it looks for a cluster that has ended for half a minute.
    """

    def __init__(self, scheduler: str) -> None:
        try:
            from distributed import Client  # noqa: PLC0415  # the extra `cluster`
        except ImportError as error:
            raise MismatchError(
                "a Dask cluster needs the package distributed: pip install 'regolithd[cluster]'"
            ) from error
        try:
            self._client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise MismatchError(f"no Dask scheduler answers at {scheduler}: {error}") from error

    def __enter__(self) -> Self:
        """Return the workers."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the connection."""
        self._client.close()

    def results(
        self, numbers: Sequence[int], task_of: Callable[[int], Callable[[], Result]]
    ) -> Iterator[tuple[int, Result]]:
        """Yield as they come; the scheduler gives the work of a lost worker to another."""
        with self._client.get_executor(retries=DASK_RETRIES, pure=False) as pool:
            yield from _submitted(pool, numbers, task_of, self._threads)

    def _threads(self) -> int:
        """Return how many tasks the cluster does at once now: workers come and go."""
        return sum(self._client.nthreads().values())


def _submitted(
    pool: Executor,
    numbers: Sequence[int],
    task_of: Callable[[int], Callable[[], Result]],
    workers: Callable[[], int],
) -> Iterator[tuple[int, Result]]:
    """Yield results as they come, with a few tasks for each worker in the pool at a time."""
    left, running = deque(numbers), dict[Future[Result], int]()
    try:
        while left or running:
            most = TASKS_EACH * max(workers(), 1)
            while left and len(running) < most:
                number = left.popleft()
                running[pool.submit(task_of(number))] = number
            done = wait(running, return_when=FIRST_COMPLETED).done
            while done:
                future = done.pop()
                yield running.pop(future), future.result()
                del future  # and with it the result, while others are waited for
    finally:
        for future in running:
            future.cancel()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Set the environment that new processes inherit, and restore it."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None) if value is None else os.environ.update({name: value})
