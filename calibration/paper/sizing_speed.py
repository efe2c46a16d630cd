"""Speed of the sizing study compared with scikit-learn's MLPRegressor, on some of its sizes, on this machine.

Both use the same pairs, scaling, sizes, epochs and activation. scikit-learn's nearest solver is gradient descent on the
full batch with momentum 0.9 and an adaptive rate. It is timed with its defaults (double precision, its own threads, one
training after another); ours as the study runs, with one thread on each core, and on one core.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.paper import sizing
from regolithd.calibration.paper.perceptron import OUTPUT_UNIT, scale

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.calibration.paper.training_set import TrainingSet

TIMED_SIZES = (59, 64, 72, 84)


@dataclass(frozen=True, slots=True)
class SpeedComparison:
    """Seconds for one epoch of one network, averaged over `TIMED_SIZES`; `_cpu_s` is CPU time, the others wall time."""

    ours_s: float
    ours_one_core_s: float
    scikit_learn_s: float
    ours_cpu_s: float
    scikit_learn_cpu_s: float

    @property
    def ratio(self) -> float:
        """Wall time of scikit-learn over ours on all cores."""
        return self.scikit_learn_s / self.ours_s

    @property
    def ratio_one_core(self) -> float:
        """Wall time of scikit-learn over ours on one core."""
        return self.scikit_learn_s / self.ours_one_core_s

    @property
    def ratio_cpu(self) -> float:
        """CPU time of scikit-learn over ours: independent of other load on the machine."""
        return self.scikit_learn_cpu_s / self.ours_cpu_s


def compare_speed(pairs: TrainingSet, folder: Path, epochs: int = 1000, trainings: int = 8) -> SpeedComparison:
    """Time `TIMED_SIZES`: `trainings` of ours for each size, one of scikit-learn's; `folder` takes the log."""
    folder.mkdir(parents=True, exist_ok=True)
    _ours(pairs, folder, 2, 2, 1)  # so that compilation is not timed
    threads = sizing.cores()
    ours, _ = _ours(pairs, folder, epochs, trainings, threads)
    one_core, cpu = _ours(pairs, folder, epochs, trainings, 1)
    theirs, theirs_cpu = _scikit_learn(pairs, epochs)
    return SpeedComparison(ours, one_core, theirs, cpu, theirs_cpu)


def _ours(pairs: TrainingSet, folder: Path, epochs: int, trainings: int, threads: int) -> tuple[float, float]:
    """Return wall and CPU seconds for one epoch of a training."""
    study = sizing.Study(TIMED_SIZES, trainings, epochs)
    log = folder / "speed.jsonl"
    log.unlink(missing_ok=True)
    start, cpu = time.perf_counter(), time.process_time()
    outcomes = list(sizing.run(study, pairs, sizing.resume(log, study), log, threads))
    done = sum(outcome.epochs for outcome in outcomes)
    return (time.perf_counter() - start) / done, (time.process_time() - cpu) / done


def _scikit_learn(pairs: TrainingSet, epochs: int) -> tuple[float, float]:
    """Return wall and CPU seconds for one epoch of a training."""
    from sklearn.exceptions import ConvergenceWarning  # noqa: PLC0415  # only this comparison needs it
    from sklearn.neural_network import MLPRegressor  # noqa: PLC0415

    inputs = scale(pairs.inputs, pairs.inputs.min(axis=0), pairs.inputs.max(axis=0))
    targets = pairs.outputs / OUTPUT_UNIT
    taken = []
    for neurons in TIMED_SIZES:
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


def figures(study: sizing.Study, outcomes: list[sizing.Outcome], speed: SpeedComparison) -> dict[str, float]:
    """Return the figures of the study and the speed comparison as one flat dictionary."""
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
