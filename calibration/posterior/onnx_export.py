"""Export of a trained posterior network to ONNX, with its metadata."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from regolithd.calibration.posterior.mixture import TARGETS
from regolithd.calibration.posterior.window import FEATURES, KNOWN

if TYPE_CHECKING:
    from regolithd.calibration.posterior.training import Parameters, Standardisation


def export_onnx(parameters: Parameters, standardisation: Standardisation, radius_m: float) -> onnx.ModelProto:
    """Return the network as one ONNX graph: wheels (N, 6, 7), mask (N, 6), known (N, 10) → mixture (N, 10 K).

    The standardisation of the inputs is part of the graph; that of the targets, the version (a hash of the weights) and
    the wheel radius [m] are in the metadata.
    """
    constants = {
        "wheels_mean": standardisation.wheels[0],
        "wheels_std": standardisation.wheels[1],
        "known_mean": standardisation.known[0],
        "known_std": standardisation.known[1],
        "six": np.array(6.0),
        "ones": np.ones((1, 6, 1)),
        **{f"{name}_{part}": np.asarray(value) for name, layer in parameters.items() for part, value in layer.items()},
    }
    initializers = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in constants.items()]
    initializers += [numpy_helper.from_array(np.array([1]), "one"), numpy_helper.from_array(np.array([2]), "two")]
    shapes: dict[str, list[str | int | None]] = {"wheels": ["N", 6, FEATURES], "mask": ["N", 6], "known": ["N", KNOWN]}
    width = int(parameters["out"]["b"].size)
    graph = helper.make_graph(
        _nodes(),
        "posterior",
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in shapes.items()],
        [helper.make_tensor_value_info("mixture", TensorProto.FLOAT, ["N", width])],
        initializers,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], producer_name="regolithd")
    model.ir_version = 9
    helper.set_model_props(model, _metadata(parameters, standardisation, radius_m))
    onnx.checker.check_model(model)
    return model


def _nodes() -> list[onnx.NodeProto]:
    """Return the nodes of the graph, from the inputs to the mixture."""
    make = helper.make_node
    return [
        make("Sub", ["wheels", "wheels_mean"], ["wheels_0"]),
        make("Div", ["wheels_0", "wheels_std"], ["wheels_1"]),
        make("Sub", ["known", "known_mean"], ["known_0"]),
        make("Div", ["known_0", "known_std"], ["known_1"]),
        make("Unsqueeze", ["known_1", "one"], ["known_2"]),
        make("Mul", ["known_2", "ones"], ["known_3"]),
        make("Concat", ["wheels_1", "known_3"], ["each"], axis=-1),
        *_dense("wheel1", "each", "hidden_1"),
        *_dense("wheel2", "hidden_1", "hidden_2"),
        make("Unsqueeze", ["mask", "two"], ["mask_1"]),
        make("Mul", ["hidden_2", "mask_1"], ["hidden_3"]),
        make("ReduceSum", ["hidden_3", "one"], ["summed"], keepdims=0),
        make("ReduceSum", ["mask", "one"], ["count"], keepdims=1),
        make("Div", ["summed", "count"], ["mean"]),
        make("Div", ["count", "six"], ["count_1"]),
        make("Concat", ["mean", "known_1", "count_1"], ["pooled"], axis=-1),
        *_dense("rover1", "pooled", "hidden_4"),
        *_dense("rover2", "hidden_4", "hidden_5"),
        make("MatMul", ["hidden_5", "out_w"], ["out_0"]),
        make("Add", ["out_0", "out_b"], ["mixture"]),
    ]


def _metadata(parameters: Parameters, standardisation: Standardisation, radius_m: float) -> dict[str, str]:
    digest = hashlib.sha256(b"".join(np.asarray(layer["w"]).tobytes() for layer in parameters.values())).hexdigest()
    targets = [
        {"name": name, "centre": float(centre), "unit": float(unit)}
        for name, centre, unit in zip(TARGETS, *standardisation.truth, strict=True)
    ]
    return {
        "regolithd.version": f"posterior-{digest[:12]}",
        "regolithd.radius_m": repr(radius_m),
        "regolithd.targets": json.dumps(targets),
    }


def _dense(layer: str, source: str, out: str) -> list[onnx.NodeProto]:
    """Return the nodes of one layer with the activation SiLU, x · sigmoid(x)."""
    return [
        helper.make_node("MatMul", [source, f"{layer}_w"], [f"{out}_product"]),
        helper.make_node("Add", [f"{out}_product", f"{layer}_b"], [f"{out}_net"]),
        helper.make_node("Sigmoid", [f"{out}_net"], [f"{out}_gate"]),
        helper.make_node("Mul", [f"{out}_net", f"{out}_gate"], [out]),
    ]
