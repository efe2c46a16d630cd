"""The sizing study (Sec. 2.3): 59–84 hidden neurons × 100 trainings × up to 10 000 epochs; the lowest mean MSE is best.

Each training is seeded by study, size and number, so its result does not depend on the order or the machine. Results
are appended to a log, one JSON line for each training, from which an interrupted study resumes.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from itertools import islice, product
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.paper.backpropagation import EPOCHS, train

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from regolithd.calibration.paper.training_set import TrainingSet

SIZES = tuple(range(59, 85))
TRAININGS = 100
PAPER_SIZE = 64
PAPER_MSE = 0.0251


@dataclass(frozen=True, slots=True)
class Study:
    """Settings of a study: sizes, trainings of each size, largest number of epochs, seed."""

    sizes: tuple[int, ...] = SIZES
    trainings: int = TRAININGS
    epochs: int = EPOCHS
    seed: int = 1


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of one training."""

    neurons: int
    number: int
    mse: float
    epochs: int


@dataclass(frozen=True, slots=True)
class SizeSummary:
    """Summary of all trainings of one size; MSE in units of (10 kPa, 1)."""

    neurons: int
    mean_mse: float
    standard_error: float
    lowest_mse: float


class DifferentStudyError(ValueError):
    """The log belongs to a study with other settings."""


def floating_point_operations(study: Study, pairs: int = 504) -> float:
    """Return the largest number of floating-point operations of a study.

    For each pair, hidden neuron and epoch: 14 multiply–adds (forward 3 + 2, backward 2 + 3 + 2, biases 2), which are 28
    operations, and about 20 for the sigmoid.
    """
    return float(pairs * sum(study.sizes) * study.trainings * study.epochs * (28 + 20))


def resume(log: Path, study: Study) -> list[Outcome]:
    """Return the outcomes in the log; create the log if there is none.

    Raises
    ------
    DifferentStudyError
        The log belongs to a study with other settings.
    """
    header = json.dumps(asdict(study))
    if not log.exists():
        log.parent.mkdir(parents=True, exist_ok=True)
        log.write_text(header + "\n", encoding="utf-8")
    text = log.read_text(encoding="utf-8")
    first, *lines = text.splitlines()
    if first != header:
        raise DifferentStudyError(
            f"{log} belongs to a study with other settings: {first}. Move it, or use these settings"
        )
    # A last line without a line end is incomplete: the process was killed while it wrote.
    whole = lines if text.endswith("\n") else lines[:-1]
    if whole != lines:
        log.write_text("\n".join([first, *whole]) + "\n", encoding="utf-8")
    return [Outcome(**json.loads(line)) for line in whole]


def run(study: Study, pairs: TrainingSet, done: Iterable[Outcome], log: Path, threads: int) -> Iterator[Outcome]:
    """Run the trainings that are not in `done` on `threads` threads; yield each outcome after it was logged."""
    known = {(each.neurons, each.number) for each in done}
    tasks = (task for task in product(study.sizes, range(study.trainings)) if task not in known)

    def one(neurons: int, number: int) -> Outcome:
        rng = np.random.default_rng(np.random.SeedSequence(study.seed, spawn_key=(neurons, number)))
        result = train(pairs, neurons, rng, study.epochs)
        return Outcome(neurons, number, result.mse, result.epochs)

    with log.open("a", encoding="utf-8") as file, ThreadPoolExecutor(threads) as pool:
        running: set[Future[Outcome]] = {pool.submit(one, *task) for task in islice(tasks, threads)}
        while running:
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            running |= {pool.submit(one, *task) for task in islice(tasks, len(finished))}
            for future in finished:
                outcome = future.result()
                file.write(json.dumps(asdict(outcome)) + "\n")
                file.flush()
                yield outcome


def summarise(outcomes: Iterable[Outcome]) -> list[SizeSummary]:
    """Return one summary for each size, smallest size first."""
    by_size: dict[int, list[float]] = {}
    for outcome in outcomes:
        by_size.setdefault(outcome.neurons, []).append(outcome.mse)
    return [
        SizeSummary(size, float(np.mean(mse)), float(np.std(mse) / np.sqrt(len(mse))), float(np.min(mse)))
        for size, mse in sorted(by_size.items())
    ]


def best_size(outcomes: Iterable[Outcome]) -> SizeSummary:
    """Return the size with the lowest mean MSE."""
    return min(summarise(outcomes), key=lambda summary: summary.mean_mse)


def cores() -> int:
    """Return the number of CPU cores that this process may use."""
    return len(os.sched_getaffinity(0))
