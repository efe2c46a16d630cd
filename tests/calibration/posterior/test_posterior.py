"""The window, the mixture that is read out of the network, and the ONNX graph against what was trained."""

from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from regolithd.calibration.models import POSTERIOR_MODEL
from regolithd.calibration.models.onnx_session import ModelError
from regolithd.calibration.parameters import Drivetrain, Wheel
from regolithd.calibration.posterior.estimator import Buffer, PosteriorEstimator
from regolithd.calibration.posterior.mixture import PARAMETERS, unpack
from regolithd.calibration.posterior.simulated_rovers import (
    TABLE_4_CURRENT,
    draw_noise,
    draw_rovers,
    drive,
    no_noise,
    table_4_noise,
    told_scatter,
)
from regolithd.calibration.posterior.training import apply, freeze, initial, scaling, simulate
from regolithd.calibration.posterior.window import KNOWN_HIGH, CalibrationUncertainty, reduce_windows


def raw_mixture(rows: int = 3, components: int = 4) -> np.ndarray:
    """Return some raw output of a network."""
    return np.random.default_rng(0).normal(0, 0.5, (rows, components * PARAMETERS))


def test_quantiles_means_and_ranks_are_those_of_the_samples() -> None:
    """What is read out by formula is what 200 000 joint samples have."""
    mixture = unpack(raw_mixture(), np.array([8.0, 0.4, 0.3]), np.array([0.5, 0.1, 0.2]))
    samples = mixture.sample(200_000, np.random.default_rng(1))
    levels = np.array([0.05, 0.5, 0.95])
    np.testing.assert_allclose(mixture.means(), samples.mean(axis=1), rtol=0.02)
    quantiles = mixture.quantiles(levels)
    np.testing.assert_allclose(
        quantiles, np.moveaxis(np.quantile(samples, levels, axis=1), 0, -1), rtol=0.02, atol=0.01
    )
    np.testing.assert_allclose(mixture.ranks(quantiles[:, :, 1]), 0.5, atol=1e-3)


def test_an_absent_wheel_changes_nothing_but_the_count() -> None:
    """A wheel that was not measured has mask 0 and no features; the others keep theirs."""
    rng = np.random.default_rng(0)
    load, slip, torque = rng.uniform(40, 60, (1, 20, 6)), np.full((1, 20, 6), 0.03), rng.normal(0.3, 0.1, (1, 20, 6))
    whole = reduce_windows(load, slip, torque, np.full((1, 5), 0.01), 0.075)
    torque[:, :, 2] = np.nan
    part = reduce_windows(load, slip, torque, np.full((1, 5), 0.01), 0.075)
    assert part.mask.tolist() == [[1, 1, 0, 1, 1, 1]]
    np.testing.assert_array_equal(part.wheels[:, 2], 0)
    np.testing.assert_allclose(np.delete(part.wheels, 2, axis=1), np.delete(whole.wheels, 2, axis=1))


def test_median_ignores_a_momentary_drop() -> None:
    """One instant of no torque moves the mean coefficient, and not the median."""
    load, slip, torque = np.full((1, 9, 6), 50.0), np.full((1, 9, 6), 0.03), np.full((1, 9, 6), 0.3)
    torque[0, 4] = 0.0
    features = reduce_windows(load, slip, torque, np.full((1, 5), 0.01), 0.075).wheels[0, 0]
    assert features[2] == pytest.approx(0.08 * 8 / 9)
    assert features[3] == pytest.approx(0.08)


def test_the_buffer_averages_half_seconds_and_begins_anew_after_a_gap() -> None:
    """100 Hz for a second closes two half seconds; a minute's silence empties the window."""
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


def test_simulated_currents_are_as_noisy_as_the_table_says() -> None:
    """The relative standard deviation of 2000 currents of a rover is that of Table 4, drops included."""
    rng = np.random.default_rng(0)
    rovers = draw_rovers(4, rng, np.full((4, 5), 1e-6), no_load_A=0.2)
    current = drive(rovers, table_4_noise(4), 2000, rng, Drivetrain(), Wheel()).current_A
    np.testing.assert_allclose((current.std(axis=1) / current.mean(axis=1)).mean(axis=0), TABLE_4_CURRENT, rtol=0.08)


def test_the_scatter_that_is_told_does_not_tell_the_soil() -> None:
    """Over 6000 windows it goes with the noise of the current, and neither with cohesion nor with the torque at all."""
    rng = np.random.default_rng(0)
    rovers, noise = draw_rovers(6000, rng), draw_noise(6000, rng)
    told = told_scatter(rovers, noise, Drivetrain().gain_Nm_per_A, rng)
    torque = drive(rovers, no_noise(6000), 1, rng, Drivetrain(), Wheel()).torque_Nm.mean(axis=(1, 2))
    assert np.corrcoef(told, noise.current.mean(axis=1))[0, 1] > 0.4
    for of_the_soil in (np.log(rovers.soils.cohesion_Pa), rovers.soils.friction_angle_deg, torque):
        assert abs(np.corrcoef(told, of_the_soil)[0, 1]) < 3.5 / np.sqrt(6000)


def test_the_onnx_graph_is_the_trained_network() -> None:
    """ONNX, with the scaling inside, gives the same mixture parameters as the layers that are trained."""
    examples = simulate(400, np.random.default_rng(0))
    parameters, by = initial(np.random.default_rng(0)), scaling(examples)
    model = freeze(parameters, by, 0.075)
    session = onnxruntime.InferenceSession(model.SerializeToString())
    windows = examples.windows
    inputs = {"wheels": windows.wheels, "mask": windows.mask, "known": windows.known}
    (raw,) = session.run(None, {name: value.astype(np.float32) for name, value in inputs.items()})
    scaled = ((windows.wheels - by.wheels[0]) / by.wheels[1], windows.mask, (windows.known - by.known[0]) / by.known[1])
    np.testing.assert_allclose(raw, apply(parameters, *scaled), atol=1e-3)


@pytest.fixture(scope="module")
def estimator() -> PosteriorEstimator:
    """Return the posterior that ships."""
    return PosteriorEstimator()


def window(instants: int) -> np.ndarray:
    """Return a window of sandy loam under six wheels: 49 N, slip 0.025, 0.3 N·m."""
    values = np.broadcast_to(np.array([49.0, 0.025, 0.2976])[:, None, None], (3, instants, 6)).copy()
    values[2] *= np.random.default_rng(0).normal(1, 0.35, (instants, 6))
    return values


def test_more_data_narrow_the_posterior_and_less_certainty_widens_it(estimator: PosteriorEstimator) -> None:
    """Ten seconds of six wheels say more than an instant of one, and a drivetrain badly known takes it away again."""
    one = window(1)
    one[:, :, 1:] = np.nan
    posteriors = [
        estimator.estimate(one, CalibrationUncertainty()),
        estimator.estimate(window(20), CalibrationUncertainty()),
        estimator.estimate(window(20), CalibrationUncertainty(*KNOWN_HIGH.tolist())),
    ]
    single, full, vague = (b.cohesion_Pa.high_90 - b.cohesion_Pa.low_90 for b in posteriors if b is not None)
    assert full < single
    assert full < vague


def test_the_posterior_knows_sandy_loam_from_lete_sand(estimator: PosteriorEstimator) -> None:
    """At the same load and slip, half the torque means less cohesion."""
    strong, weak = window(20), window(20)
    weak[2] /= 2
    posteriors = [estimator.estimate(each, CalibrationUncertainty()) for each in (strong, weak)]
    means = [posterior.cohesion_Pa.mean for posterior in posteriors if posterior is not None]
    assert means[1] < 0.7 * means[0]


def test_no_measurement_is_no_posterior(estimator: PosteriorEstimator) -> None:
    """An empty window, or one of NaN, has nothing to say."""
    assert estimator.estimate(np.empty((3, 0, 6)), CalibrationUncertainty()) is None
    assert estimator.estimate(np.full((3, 5, 6), np.nan), CalibrationUncertainty()) is None


def test_a_fall_is_told_by_its_probability(estimator: PosteriorEstimator) -> None:
    """Half the torque at the same load and slip: cohesion fell, likely; the same window again: nobody knows."""
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
    ("name", "says"),
    [
        ("absent.onnx", "no such file"),
        ("half.onnx", "damaged, or not an ONNX model"),
        ("terrain.onnx", "was trained with other inputs"),
    ],
)
def test_a_file_that_is_no_posterior_is_refused_with_the_cure(tmp_path: Path, name: str, says: str) -> None:
    """An absent file, one that was cut off in the middle, and another network: each is named, with what to do."""
    shipped = POSTERIOR_MODEL.read_bytes()
    (tmp_path / "half.onnx").write_bytes(shipped[: len(shipped) // 2])
    (tmp_path / "terrain.onnx").write_bytes(POSTERIOR_MODEL.with_name("terrain.onnx").read_bytes())
    with pytest.raises(ModelError, match=rf"{name}: {says}.*Train one \(`regolithd train-posterior`\)"):
        PosteriorEstimator(tmp_path / name)
