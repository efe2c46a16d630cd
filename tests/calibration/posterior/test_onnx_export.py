"""The exported graph of the posterior network."""

import json

import numpy as np
import onnxruntime

from regolithd.calibration.posterior.mixture import TARGETS
from regolithd.calibration.posterior.onnx_export import export_onnx
from regolithd.calibration.posterior.training import initial_parameters, network_output, standardisation_of
from regolithd.calibration.posterior.training_examples import simulate_examples


def test_the_onnx_graph_is_the_trained_network() -> None:
    """The ONNX graph, which includes the standardisation, gives the mixture parameters of the trained layers."""
    examples = simulate_examples(400, np.random.default_rng(0))
    parameters, by = initial_parameters(np.random.default_rng(0)), standardisation_of(examples)
    model = export_onnx(parameters, by, 0.075)
    session = onnxruntime.InferenceSession(model.SerializeToString())
    windows = examples.windows
    inputs = {"wheels": windows.wheels, "mask": windows.mask, "known": windows.known}
    (raw,) = session.run(None, {name: value.astype(np.float32) for name, value in inputs.items()})
    scaled = ((windows.wheels - by.wheels[0]) / by.wheels[1], windows.mask, (windows.known - by.known[0]) / by.known[1])
    np.testing.assert_allclose(raw, network_output(parameters, *scaled), atol=1e-3)
    metadata = session.get_modelmeta().custom_metadata_map
    assert [target["name"] for target in json.loads(metadata["regolithd.targets"])] == list(TARGETS)
    assert float(metadata["regolithd.radius_m"]) == 0.075
