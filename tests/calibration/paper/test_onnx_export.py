"""The exported ONNX model computes what the perceptron does, and its card describes it."""

import numpy as np
import onnxruntime
import pytest

from regolithd.calibration.models.card import read_card
from regolithd.calibration.paper import backpropagation
from regolithd.calibration.paper.onnx_export import export_onnx, model_card
from regolithd.calibration.paper.training_set import TrainingSet, training_set
from regolithd.calibration.parameters import Drivetrain, Wheel


@pytest.fixture(scope="module")
def pairs() -> TrainingSet:
    """Return the 504 pairs."""
    return training_set(Drivetrain(), Wheel(), np.random.default_rng(1))


def test_the_exported_model_equals_the_perceptron(pairs: TrainingSet) -> None:
    """The ONNX model, which includes the scaling, gives the same cohesion and tan φ."""
    perceptron = backpropagation.train(pairs, 20, np.random.default_rng(5), epochs=100).perceptron
    session = onnxruntime.InferenceSession(export_onnx(perceptron, pairs).SerializeToString())
    (answer,) = session.run(None, {"inputs": pairs.inputs.astype(np.float32)})
    np.testing.assert_allclose(answer, perceptron(pairs.inputs), rtol=2e-4)


def test_the_model_card_is_in_the_metadata(pairs: TrainingSet) -> None:
    """The card that is read from the model is the one made from perceptron and pairs."""
    perceptron = backpropagation.train(pairs, 5, np.random.default_rng(5), epochs=2).perceptron
    session = onnxruntime.InferenceSession(export_onnx(perceptron, pairs).SerializeToString())
    card = read_card(session.get_modelmeta().custom_metadata_map)
    assert card == model_card(perceptron, pairs)
    assert card.version.startswith("paper-3:5:2-")
