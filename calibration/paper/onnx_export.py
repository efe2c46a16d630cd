"""Export of a trained perceptron to ONNX, with the model card that the daemon reads."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from regolithd.calibration.models.card import ModelCard, Variable
from regolithd.calibration.paper.perceptron import INPUTS, OUTPUT_UNIT, OUTPUTS, Perceptron

if TYPE_CHECKING:
    from regolithd.calibration.paper.training_set import TrainingSet

OPSET = 17
IR_VERSION = 9  # the newest that onnxruntime 1.19, the oldest supported on the rover, can read


def export_onnx(perceptron: Perceptron, pairs: TrainingSet) -> onnx.ModelProto:
    """Return the perceptron as one ONNX graph: (N, 3) load, slip, current → (N, 2) cohesion, tan φ, float32."""
    slope = 2 / (perceptron.high - perceptron.low)
    hidden = perceptron.hidden[:, :INPUTS] * slope
    bias = perceptron.hidden[:, INPUTS] - perceptron.hidden[:, :INPUTS] @ (slope * perceptron.low + 1)
    constants = {
        "hidden_weights": hidden.T,
        "hidden_bias": bias,
        "output_weights": perceptron.output[:, :-1].T,
        "output_bias": perceptron.output[:, -1],
        "output_unit": OUTPUT_UNIT,
    }
    nodes = [
        helper.make_node("Gemm", ["inputs", "hidden_weights", "hidden_bias"], ["hidden_net"]),
        helper.make_node("Sigmoid", ["hidden_net"], ["hidden"]),
        helper.make_node("Gemm", ["hidden", "output_weights", "output_bias"], ["output_net"]),
        helper.make_node("Sigmoid", ["output_net"], ["scaled"]),
        helper.make_node("Mul", ["scaled", "output_unit"], ["outputs"]),
    ]
    graph = helper.make_graph(
        nodes,
        "terrain",
        [helper.make_tensor_value_info("inputs", TensorProto.FLOAT, ["N", INPUTS])],
        [helper.make_tensor_value_info("outputs", TensorProto.FLOAT, ["N", OUTPUTS])],
        [numpy_helper.from_array(value.astype(np.float32), name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="regolithd")
    model.ir_version = IR_VERSION
    helper.set_model_props(model, model_card(perceptron, pairs).metadata())
    onnx.checker.check_model(model)
    return model


def model_card(perceptron: Perceptron, pairs: TrainingSet) -> ModelCard:
    """Return the model card: names, units and ranges of the pairs, and a version that is a hash of the weights."""
    digest = hashlib.sha256(perceptron.hidden.tobytes() + perceptron.output.tobytes()).hexdigest()[:12]
    inputs = zip(("load_N", "slip", "motor_current_A"), ("N", "1", "A"), pairs.inputs.T, strict=True)
    outputs = zip(("cohesion_Pa", "tan_friction_angle"), ("Pa", "1"), pairs.outputs.T, strict=True)
    return ModelCard(
        version=f"paper-{INPUTS}:{len(perceptron.hidden)}:{OUTPUTS}-{digest}",
        inputs=tuple(_variable(*each) for each in inputs),
        outputs=tuple(_variable(*each) for each in outputs),
        gain_Nm_per_A=pairs.gain_Nm_per_A,
    )


def _variable(name: str, unit: str, values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Variable:
    return Variable(name, unit, float(values.min()), float(values.max()))
