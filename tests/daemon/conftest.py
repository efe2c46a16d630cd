"""Fixtures of the daemon's tests: a small network with a model card, and the frames of a rover without a bus."""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from regolithd.calibration.models.card import ModelCard, Variable
from regolithd.daemon.config.configuration import Configuration
from regolithd.drivers.can.frame import Frame

START_NS = 1_700_000_000_123_456_000


@pytest.fixture
def card() -> ModelCard:
    """A model card with the paper's inputs and outputs."""
    return ModelCard(
        version="test-1",
        inputs=(
            Variable("load_N", "N", 20.0, 80.0),
            Variable("slip", "1", 0.01, 0.03),
            Variable("motor_current_A", "A", 0.05, 0.10),
        ),
        outputs=(Variable("cohesion_Pa", "Pa", 0.0, 7000.0), Variable("tan_friction_angle", "1", 0.2, 0.6)),
        gain_Nm_per_A=Configuration().drivetrain.gain_Nm_per_A,
    )


@pytest.fixture
def make_network(tmp_path: Path, card: ModelCard) -> Callable[..., Path]:
    """Return a function that writes an ONNX model: c = 100 W [Pa], tan φ = 5 I + i unless other weights are given."""
    paper = np.array([[100.0, 0.0], [0.0, 1.0], [0.0, 5.0]])

    def make(metadata: dict[str, str] | None = None, weights: np.ndarray = paper) -> Path:
        columns, outputs = weights.shape
        graph = helper.make_graph(
            [helper.make_node("MatMul", ["x", "W"], ["y"])],
            "linear",
            [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["N", columns])],
            [helper.make_tensor_value_info("y", TensorProto.FLOAT, ["N", outputs])],
            [numpy_helper.from_array(weights.astype(np.float32), "W")],
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
        helper.set_model_props(model, card.metadata() if metadata is None else metadata)
        path = tmp_path / "network.onnx"
        onnx.save(model, str(path))
        return path

    return make


@dataclass
class Drive:
    """The frames of a rover that drives straight on, with noise, at a SYNC rate of `rate_Hz`."""

    rate_Hz: float = 2.0
    seed: int = 1
    nodes_silent: frozenset[int] = frozenset()

    def frames(self, snapshots: int) -> Iterator[Frame]:
        """Yield SYNC and answers, as a kernel would hand them over; one SYNC more than there are snapshots."""
        random = np.random.default_rng(self.seed)
        for k in range(snapshots + 1):
            sync = START_NS + int(k * 1e9 / self.rate_Hz) + int(random.integers(0, 90_000))
            yield Frame(sync, 0x080, b"", sent=True)
            if k < snapshots:
                yield from self._answers(sync, random)

    def _answers(self, sync_ns: int, random: np.random.Generator) -> Iterator[Frame]:
        answers = [(node, struct.pack("<Hhi", 0x1237, int(random.normal(75, 10)), 3915)) for node in range(1, 7)]
        answers += [(node, struct.pack("<iB", int(random.normal(4900, 300)), 0)) for node in range(11, 17)]
        answers += [(21, struct.pack("<hhh", 100, -50, 0)), (22, struct.pack("<iB", 2145, 0))]
        for place, (node, data) in enumerate(answers, start=1):
            if node not in self.nodes_silent:
                yield Frame(sync_ns + 130_000 * place, 0x180 + node, data)


@pytest.fixture
def drive() -> type[Drive]:
    """Return the class that makes the frames."""
    return Drive


@pytest.fixture
def configuration(make_network: Callable[..., Path]) -> Configuration:
    """Kapvik with both body sensors, and the tiny network."""
    return Configuration.model_validate(
        {"nodes": {"inclinometer": 21, "ground_speed": 22}, "estimator": {"model": make_network()}}
    )
