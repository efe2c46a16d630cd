"""The sizing study's speed against scikit-learn's MLPRegressor, on a slice of it, one after the other on this machine.

The same pairs, scaling, sizes, epochs and activation; stochastic gradient descent with momentum 0.9 on the full batch
and an adaptive rate is the nearest solver that it has. It is timed as a user would run it: in double precision, its
threads as they are by default, one training after another; and ours as the study runs, on all cores.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.paper import sizing
from regolithd.calibration.paper.network import OUTPUT_UNIT, scale

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.calibration.paper.training_set import TrainingSet

SLICE_SIZES = (59, 64, 72, 84)


@dataclass(frozen=True, slots=True)
class Race:
    """Seconds for one epoch of one network, averaged over the slice's sizes."""

    ours_s: float
    ours_one_core_s: float
    scikit_learn_s: float
    ours_cpu_s: float
    scikit_learn_cpu_s: float

    @property
    def ratio(self) -> float:
        """How many times faster the study runs, as each is run."""
        return self.scikit_learn_s / self.ours_s

    @property
    def ratio_one_core(self) -> float:
        """The same with one core for ours."""
        return self.scikit_learn_s / self.ours_one_core_s

    @property
    def ratio_cpu(self) -> float:
        """The same in CPU time, which does not see what else the machine is doing: one core against one."""
        return self.scikit_learn_cpu_s / self.ours_cpu_s


def race(pairs: TrainingSet, folder: Path, epochs: int = 1000, trainings: int = 8) -> Race:
    """Time both on the slice: `trainings` of ours for each size, one of scikit-learn's."""
    folder.mkdir(parents=True, exist_ok=True)
    _ours(pairs, folder, 2, 2, 1)  # compiles
    threads = sizing.cores()
    ours, _ = _ours(pairs, folder, epochs, trainings, threads)
    one_core, cpu = _ours(pairs, folder, epochs, trainings, 1)
    theirs, theirs_cpu = _scikit_learn(pairs, epochs)
    return Race(ours, one_core, theirs, cpu, theirs_cpu)


def _ours(pairs: TrainingSet, folder: Path, epochs: int, trainings: int, threads: int) -> tuple[float, float]:
    """Return seconds and CPU seconds for each epoch of a training."""
    study = sizing.Study(SLICE_SIZES, trainings, epochs)
    log = folder / "race.jsonl"
    log.unlink(missing_ok=True)
    start, cpu = time.perf_counter(), time.process_time()
    outcomes = list(sizing.run(study, pairs, sizing.resume(log, study), log, threads))
    done = sum(outcome.epochs for outcome in outcomes)
    return (time.perf_counter() - start) / done, (time.process_time() - cpu) / done


def _scikit_learn(pairs: TrainingSet, epochs: int) -> tuple[float, float]:
    """Return seconds and CPU seconds for each epoch of a training."""
    from sklearn.exceptions import ConvergenceWarning  # noqa: PLC0415  # only this comparison needs it
    from sklearn.neural_network import MLPRegressor  # noqa: PLC0415

    inputs = scale(pairs.inputs, pairs.inputs.min(axis=0), pairs.inputs.max(axis=0))
    targets = pairs.outputs / OUTPUT_UNIT
    taken = []
    for neurons in SLICE_SIZES:
        model = MLPRegressor(
            hidden_layer_sizes=(neurons,),
            activation="logistic",
            solver="sgd",
            alpha=0.0,
            batch_size=len(inputs),
            learning_rate="adaptive",
            learning_rate_init=0.01,
            momentum=0.9,
            nesterovs_momentum=False,
            max_iter=epochs,
            n_iter_no_change=epochs + 1,
            tol=0.0,
            random_state=1,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            start, cpu = time.perf_counter(), time.process_time()
            model.fit(inputs, targets)
            now, cpu_now = time.perf_counter(), time.process_time()
            taken.append([(now - start) / model.n_iter_, (cpu_now - cpu) / model.n_iter_])
    wall, cpu = np.mean(taken, axis=0).tolist()
    return wall, cpu


def figures(study: sizing.Study, outcomes: list[sizing.Outcome], speed: Race) -> dict[str, float]:
    """Return the study's figures beside the paper's, one flat object."""
    summaries = sizing.summarise(outcomes)
    best = sizing.best_size(outcomes)
    return {
        "trainings": len(outcomes),
        "epochs": sum(each.epochs for each in outcomes),
        "reached_goal": sum(each.epochs < study.epochs for each in outcomes),
        "tera_operations": sizing.floating_point_operations(study) / 1e12,
        "cores": sizing.cores(),
        "microseconds_per_epoch": 1e6 * speed.ours_s,
        "microseconds_per_epoch_one_core": 1e6 * speed.ours_one_core_s,
        "scikit_learn_microseconds_per_epoch": 1e6 * speed.scikit_learn_s,
        "ratio_to_scikit_learn": speed.ratio,
        "ratio_to_scikit_learn_one_core": speed.ratio_one_core,
        "ratio_to_scikit_learn_cpu_time": speed.ratio_cpu,
        "ratio_to_scikit_learn_cpu_time_all_cores": speed.ratio_cpu * sizing.cores(),
        "best_size": best.neurons,
        "best_mean_mse": best.mean_mse,
        "paper_size": sizing.PAPER_SIZE,
        "paper_mse": sizing.PAPER_MSE,
        **{f"mean_mse_{each.neurons}": each.mean_mse for each in summaries},
        **{f"standard_error_{each.neurons}": each.standard_error for each in summaries},
    }
