"""The posterior on the rover: buffer, intervals, probability of a decrease, errors of a model file."""

from pathlib import Path

import numpy as np
import pytest

from regolithd.calibration.models import POSTERIOR_MODEL
from regolithd.calibration.models.onnx_session import ModelError
from regolithd.calibration.posterior.estimator import Buffer, PosteriorEstimator
from regolithd.calibration.posterior.window import UNCERTAINTY_HIGH, CalibrationUncertainty


@pytest.fixture(scope="module")
def estimator() -> PosteriorEstimator:
    """Return the shipped posterior network."""
    return PosteriorEstimator()


def window(instants: int) -> np.ndarray:
    """Return a window of sandy loam under six wheels: 49 N, slip 0.025, 0.3 N·m."""
    values = np.broadcast_to(np.array([49.0, 0.025, 0.2976])[:, None, None], (3, instants, 6)).copy()
    values[2] *= np.random.default_rng(0).normal(1, 0.35, (instants, 6))
    return values


def test_the_buffer_averages_half_seconds_and_is_emptied_by_a_gap() -> None:
    """100 Hz for a second completes two half seconds; a gap longer than the window empties it."""
    buffer = Buffer(10.0)
    ones = np.ones(6)
    for k in range(101):
        buffer.add(10**12 + k * 10**7, ones * (k % 2), ones, np.where(np.arange(6) == 1, np.nan, 2.0))
    window = buffer.window()
    assert window.shape == (3, 2, 6)
    np.testing.assert_allclose(window[0], 0.5)
    assert np.isnan(window[2, :, 1]).all()
    buffer.add(2 * 10**12, ones, ones, ones)
    assert buffer.window().shape[1] == 0


def test_more_data_narrow_the_posterior_and_uncertainty_widens_it(estimator: PosteriorEstimator) -> None:
    """Ten seconds of six wheels narrow the interval of one instant; the largest uncertainty widens it again."""
    one = window(1)
    one[:, :, 1:] = np.nan
    posteriors = [
        estimator.estimate(one, CalibrationUncertainty()),
        estimator.estimate(window(20), CalibrationUncertainty()),
        estimator.estimate(window(20), CalibrationUncertainty(*UNCERTAINTY_HIGH.tolist())),
    ]
    single, full, vague = (b.cohesion_Pa.high_90 - b.cohesion_Pa.low_90 for b in posteriors if b is not None)
    assert full < single
    assert full < vague


def test_half_the_torque_gives_less_cohesion(estimator: PosteriorEstimator) -> None:
    """At the same load and slip, half the torque gives a cohesion lower by at least 30 %."""
    strong, weak = window(20), window(20)
    weak[2] /= 2
    posteriors = [estimator.estimate(each, CalibrationUncertainty()) for each in (strong, weak)]
    means = [posterior.cohesion_Pa.mean for posterior in posteriors if posterior is not None]
    assert means[1] < 0.7 * means[0]


def test_no_measurement_is_no_posterior(estimator: PosteriorEstimator) -> None:
    """An empty window, or one of NaN, has no posterior."""
    assert estimator.estimate(np.empty((3, 0, 6)), CalibrationUncertainty()) is None
    assert estimator.estimate(np.full((3, 5, 6), np.nan), CalibrationUncertainty()) is None


def test_the_probability_of_a_decrease(estimator: PosteriorEstimator) -> None:
    """At half the torque a decrease of cohesion is probable; for the same window twice its probability is one half."""
    strong, weak = window(20), window(20)
    weak[2] /= 2
    fell = estimator.fall_probability(strong, weak, CalibrationUncertainty())
    same = estimator.fall_probability(strong, strong, CalibrationUncertainty())
    assert fell is not None
    assert same is not None
    assert fell.cohesion > 0.8
    assert 0.45 < same.cohesion < 0.55
    assert estimator.fall_probability(strong, np.empty((3, 0, 6)), CalibrationUncertainty()) is None


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("absent.onnx", "no such file"),
        ("half.onnx", "damaged, or not an ONNX model"),
        ("terrain.onnx", "was trained with other inputs"),
    ],
)
def test_a_file_that_is_no_posterior_is_an_error_with_the_remedy(tmp_path: Path, name: str, message: str) -> None:
    """An absent file, a truncated one and another network are errors that name the file and the remedy."""
    shipped = POSTERIOR_MODEL.read_bytes()
    (tmp_path / "half.onnx").write_bytes(shipped[: len(shipped) // 2])
    (tmp_path / "terrain.onnx").write_bytes(POSTERIOR_MODEL.with_name("terrain.onnx").read_bytes())
    with pytest.raises(ModelError, match=rf"{name}: {message}.*Train one \(`regolithd train-posterior`\)"):
        PosteriorEstimator(tmp_path / name)
