"""The compiled training against a plain one, and the shipped model against the command that makes it."""

import numpy as np
import onnxruntime
import pytest

from regolithd.calibration.models import TERRAIN_MODEL
from regolithd.calibration.models.card import read_card
from regolithd.calibration.paper import backpropagation
from regolithd.calibration.paper.perceptron import (
    OUTPUT_UNIT,
    mean_squared_error,
    nguyen_widrow,
    scale,
    sigmoid,
    unpack,
)
from regolithd.calibration.paper.training_set import TrainingSet, training_set
from regolithd.calibration.parameters import Drivetrain, Wheel


@pytest.fixture(scope="module")
def pairs() -> TrainingSet:
    """Return the 504 pairs in the order that the shipped model was trained with."""
    return training_set(Drivetrain(), Wheel(), np.random.default_rng(1))


def plain_training(pairs: TrainingSet, neurons: int, rng: np.random.Generator, epochs: int) -> float:
    """Return the MSE that the same rules reach in double precision, written with matrices."""
    low, high = pairs.inputs.min(axis=0), pairs.inputs.max(axis=0)
    first = unpack(nguyen_widrow(neurons, rng), neurons, low, high)
    x = np.column_stack([scale(pairs.inputs, low, high), np.ones(len(pairs.inputs))])
    t = pairs.outputs / OUTPUT_UNIT
    weights = [first.hidden, first.output]
    step = [np.zeros_like(w) for w in weights]
    rate = 0.01

    def error_and_gradient(hidden: np.ndarray, output: np.ndarray) -> tuple[float, list[np.ndarray]]:
        a = np.column_stack([sigmoid(x @ hidden.T), np.ones(len(x))])
        y = sigmoid(a @ output.T)
        delta = 2 * (y - t) / t.size * y * (1 - y)
        back = delta @ output[:, :-1] * a[:, :-1] * (1 - a[:, :-1])
        return float(np.mean((y - t) ** 2)), [back.T @ x, delta.T @ a]

    error, gradient = error_and_gradient(*weights)
    for _ in range(epochs):
        step = [0.9 * s - 0.1 * rate * g for s, g in zip(step, gradient, strict=True)]
        trial = [w + s for w, s in zip(weights, step, strict=True)]
        tried, tried_gradient = error_and_gradient(*trial)
        if tried > 1.04 * error:
            rate *= 0.7
            step = [np.zeros_like(w) for w in weights]
            continue
        rate *= 1.05 if tried < error else 1.0
        weights, error, gradient = trial, tried, tried_gradient
    return error


def test_compiled_training_follows_the_plain_one(pairs: TrainingSet) -> None:
    """After 150 epochs the compiled single-precision loop has the MSE of double precision with matrices."""
    ours = backpropagation.train(pairs, 20, np.random.default_rng(5), epochs=150)
    assert ours.epochs == 150
    assert ours.mse == pytest.approx(plain_training(pairs, 20, np.random.default_rng(5), 150), rel=1e-3)
    assert ours.mse == pytest.approx(mean_squared_error(ours.perceptron, pairs.inputs, pairs.outputs), rel=1e-4)


def test_training_ends_at_its_goal(pairs: TrainingSet) -> None:
    """A goal that is met before the first epoch ends the training after none."""
    assert backpropagation.train(pairs, 20, np.random.default_rng(5), goal=1.0).epochs == 0


def test_the_shipped_model_is_what_the_command_makes(pairs: TrainingSet) -> None:
    """Its card has the ranges of the 504 pairs, and its MSE is that of the best of eight trainings with its seeds."""
    session = onnxruntime.InferenceSession(TERRAIN_MODEL)
    card = read_card(session.get_modelmeta().custom_metadata_map)
    assert card.gain_Nm_per_A == pairs.gain_Nm_per_A
    np.testing.assert_allclose([v.low for v in card.inputs], pairs.inputs.min(axis=0))
    np.testing.assert_allclose([v.high for v in card.inputs], pairs.inputs.max(axis=0))
    (answer,) = session.run(None, {"inputs": pairs.inputs.astype(np.float32)})
    shipped = np.mean(((answer - pairs.outputs) / OUTPUT_UNIT) ** 2)
    seeds = np.random.SeedSequence(1).spawn(100)[:8]
    again = [backpropagation.train(pairs, 64, np.random.default_rng(seed)).mse for seed in seeds]
    assert shipped <= np.mean(again)
    assert shipped == pytest.approx(min(again), rel=0.02)
