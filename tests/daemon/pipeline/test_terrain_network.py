"""A terrain network that does not fit is refused with every reason; one that fits estimates six wheels in one call."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from regolithd.calibration.models.card import ModelCard, ModelCardError, Variable, read_card
from regolithd.calibration.models.onnx_session import ModelError
from regolithd.daemon.pipeline.terrain_network import TerrainModelError, TerrainNetwork

KNOWN = {
    "load_N": np.array([30.0, 40.0, 50.0, 60.0, 70.0, 90.0]),
    "slip": np.array([0.02, 0.02, np.nan, 0.02, 0.05, 0.02]),
    "motor_current_A": np.array([0.06, 0.07, 0.08, 0.04, 0.10, 0.06]),
}


def test_six_wheels_are_estimated_and_what_is_outside_the_training_range_is_marked(
    make_network: Callable[..., Path],
) -> None:
    """Wheel 3 lacks its slip; wheels 4, 5 and 6 each have one input outside."""
    terrain = TerrainNetwork(make_network()).estimate(KNOWN)
    np.testing.assert_allclose(terrain.cohesion_Pa, [3000, 4000, np.nan, 6000, 7000, 9000], rtol=1e-6)
    tangent = KNOWN["slip"] + 5 * KNOWN["motor_current_A"]
    np.testing.assert_allclose(np.tan(terrain.friction_angle_rad), tangent, rtol=1e-6)
    assert terrain.outside.tolist() == [
        [False, False, False, False, False, True],
        [False, False, False, False, True, False],
        [False, False, False, True, False, False],
    ]


def test_a_card_survives_its_metadata(card: ModelCard) -> None:
    """A model card that is written to metadata reads back equal."""
    assert read_card(card.metadata()) == card


def test_everything_wrong_with_a_card_is_reported_at_once(card: ModelCard) -> None:
    """Wrong unit, unknown name, empty range, swapped outputs, no version and no gain are six problems."""
    wrong = dataclasses.replace(
        card,
        version="",
        inputs=(Variable("load_N", "kN", 20, 80), Variable("sinkage_m", "m", 0, 1), Variable("slip", "1", 1, 1)),
        outputs=card.outputs[::-1],
        gain_Nm_per_A=0.0,
    )
    with pytest.raises(ModelCardError) as caught:
        read_card(wrong.metadata())
    assert len(caught.value.problems) == 6


def test_a_network_without_a_card_is_refused(make_network: Callable[..., Path]) -> None:
    """The error names the missing metadata."""
    with pytest.raises(TerrainModelError, match=r"network.onnx: its metadata do not fit: regolithd.inputs is missing"):
        TerrainNetwork(make_network(metadata={}))


def test_a_network_whose_layers_disagree_with_its_card_is_refused(make_network: Callable[..., Path]) -> None:
    """The model has four input columns, its card names three."""
    with pytest.raises(TerrainModelError, match=r"expected \(N, 3\) of floats"):
        TerrainNetwork(make_network(weights=np.ones((4, 2))))


def test_a_network_that_gives_no_numbers_is_refused(make_network: Callable[..., Path]) -> None:
    """A model whose result is NaN is refused when it is loaded."""
    with pytest.raises(TerrainModelError, match="no finite numbers"):
        TerrainNetwork(make_network(weights=np.full((3, 2), np.nan)))


def test_a_missing_or_broken_file_is_refused(tmp_path: Path) -> None:
    """The error names the file and what to do."""
    with pytest.raises(ModelError, match=r"absent.onnx: no such file. Train one \(`regolithd train`\)"):
        TerrainNetwork(tmp_path / "absent.onnx")
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"not a model")
    with pytest.raises(ModelError, match=r"broken.onnx: damaged, or not an ONNX model .*Train one"):
        TerrainNetwork(broken)
