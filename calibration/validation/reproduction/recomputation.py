"""Recomputation of the paper's results, one function for each.

Constants that the paper does not publish (r, w, κ, efficiencies) are those of `parameters`; `unpublished_constants`
varies them over plausible ranges. The traverse is synthetic: only the scatter of currents and loads and one record were
published, so every wheel is given that record's means and its own scatter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.paper import backpropagation
from regolithd.calibration.paper.training_set import TrainingSet, training_set
from regolithd.calibration.parameters import SOILS, Drivetrain, Wheel
from regolithd.calibration.validation.reproduction import published

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.calibration.paper.perceptron import Perceptron

Array = NDArray[np.float64]

ROVER_LOADS_N = (15.0, 100.0)
"""Loads of a wheel of a 30 kg rover on the slopes that it can climb [N]; on level ground 49 N."""

RANGES = {
    "radius_m": (0.060, 0.075, 0.090),
    "width_m": (0.050, 0.070, 0.090),
    "gain_factor": (0.6, 1.0, 1.4),
}
"""Plausible ranges of unpublished constants: lowest, default, highest; `gain_factor` multiplies the gain of Eq. 11."""


@dataclass(frozen=True, slots=True)
class LoadRange:
    """Loads of one soil's pairs; `possible_share` of them is within `ROVER_LOADS_N`."""

    soil: str
    lowest_N: float
    median_N: float
    highest_N: float
    possible_share: float


@dataclass(frozen=True, slots=True)
class RecordEstimate:
    """Estimate of one record: mean and standard deviation over several trained perceptrons, and their mean MSE."""

    cohesion_Pa: float
    cohesion_std_Pa: float
    angle_deg: float
    angle_std_deg: float
    mse: float


@dataclass(frozen=True, slots=True, eq=False)
class SyntheticTraverse:
    """A synthetic traverse, shape (909, 6): measurements, and the perceptron's estimates."""

    ground: str
    load_N: Array
    current_A: Array
    cohesion_Pa: Array
    angle_deg: Array


def load_ranges(pairs: TrainingSet) -> list[LoadRange]:
    """Return the range of the pairs' loads, soil by soil."""
    low, high = ROVER_LOADS_N
    found = []
    for index, name in enumerate(SOILS):
        load = pairs.inputs[pairs.soil == index, 0]
        possible = float(np.mean((load >= low) & (load <= high)))
        found.append(LoadRange(name, float(load.min()), float(np.median(load)), float(load.max()), possible))
    return found


def trained(
    drivetrain: Drivetrain, wheel: Wheel, trainings: int, seed: int = 1, tick: Callable[[], None] = lambda: None
) -> tuple[TrainingSet, list[backpropagation.Training]]:
    """Return the pairs and `trainings` perceptrons of the paper's size; `tick` is called after each."""
    pairs = training_set(drivetrain, wheel, np.random.default_rng(seed))
    done = []
    for each in np.random.SeedSequence(seed).spawn(trainings):
        done.append(backpropagation.train(pairs, published.NEURONS, np.random.default_rng(each)))
        tick()
    return pairs, done


def record_500(trainings: list[backpropagation.Training]) -> RecordEstimate:
    """Return the estimate of record 500, the only record that the paper publishes."""
    record = published.SET_500
    inputs = np.array([[record["load_N"], record["slip"], record["motor_current_A"]]])
    answers = np.vstack([training.perceptron(inputs) for training in trainings])
    angle = np.degrees(np.arctan(answers[:, 1]))
    mse = float(np.mean([training.mse for training in trainings]))
    return RecordEstimate(
        float(answers[:, 0].mean()), float(answers[:, 0].std()), float(angle.mean()), float(angle.std()), mse
    )


def unpublished_constants(
    trainings: int, tick: Callable[[], None] = lambda: None
) -> dict[tuple[str, float], RecordEstimate]:
    """Return the estimate of record 500 with each unpublished constant at either end of its range."""
    found = {}
    for name, values in RANGES.items():
        for value in (values[0], values[-1]):
            drivetrain, wheel = Drivetrain(), Wheel()
            if name == "gain_factor":
                constant = drivetrain.torque_constant_Nm_per_A * value
                drivetrain = drivetrain.model_copy(update={"torque_constant_Nm_per_A": constant})
            else:
                wheel = wheel.model_copy(update={name: value})
            found[name, value] = record_500(trained(drivetrain, wheel, trainings, tick=tick)[1])
    return found


def traverse(perceptron: Perceptron, ground: str, rng: np.random.Generator) -> SyntheticTraverse:
    """Return a synthetic traverse over `ground` with the scatter of the paper's Tables 4 and 6."""
    shape = (published.RECORDS, 6)
    record = published.SET_500
    load_std, current_std = (np.array(table[ground]) / 100 for table in (published.LOAD_RSD, published.CURRENT_RSD))
    load = record["load_N"] * np.clip(1 + load_std * rng.standard_normal(shape), 0.2, None)
    # One record in twenty has a momentary drop of current, as the paper describes; the other noise is reduced so that
    # the relative standard deviation of the whole stays as published.
    dropped = np.where(rng.random(shape) < 0.05, rng.uniform(0.2, 0.7, shape), 1.0)
    remaining_std = np.sqrt(np.clip(current_std**2 - dropped.var(), 0, None))
    current = record["motor_current_A"] / dropped.mean() * dropped * (1 + remaining_std * rng.standard_normal(shape))
    inputs = np.stack([load, np.full(shape, published.SLIP), np.clip(current, 0, None)], axis=-1)
    answers = perceptron(inputs.reshape(-1, 3)).reshape(*shape, 2)
    return SyntheticTraverse(ground, load, current, answers[..., 0], np.degrees(np.arctan(answers[..., 1])))


def relative_std(values: Array) -> Array:
    """Return the relative standard deviation of each wheel [%]."""
    return 100 * values.std(axis=0) / values.mean(axis=0)


def current_sweep(perceptron: Perceptron, currents_A: Array) -> Array:
    """Return c [Pa] and φ [°] against current at record 500's load and slip, shape (currents, 2)."""
    record = published.SET_500
    rows = np.column_stack(
        [np.full_like(currents_A, record["load_N"]), np.full_like(currents_A, record["slip"]), currents_A]
    )
    answers = perceptron(rows)
    return np.column_stack([answers[:, 0], np.degrees(np.arctan(answers[:, 1]))])
