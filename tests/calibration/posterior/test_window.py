"""Features of a window: wheels without measurement, momentary drops, uncertainty, soil class."""

import numpy as np
import pytest

from regolithd.calibration.parameters import SOILS
from regolithd.calibration.posterior.window import (
    UNCERTAINTY_HIGH,
    UNCERTAINTY_LOW,
    CalibrationUncertainty,
    reduce_windows,
)


def test_a_wheel_without_measurement_is_masked() -> None:
    """A wheel without measurement has mask 0 and features 0; the features of the others do not change."""
    rng = np.random.default_rng(0)
    load, slip, torque = rng.uniform(40, 60, (1, 20, 6)), np.full((1, 20, 6), 0.03), rng.normal(0.3, 0.1, (1, 20, 6))
    whole = reduce_windows(load, slip, torque, np.full((1, 5), 0.01), 0.075)
    torque[:, :, 2] = np.nan
    part = reduce_windows(load, slip, torque, np.full((1, 5), 0.01), 0.075)
    assert part.mask.tolist() == [[1, 1, 0, 1, 1, 1]]
    np.testing.assert_array_equal(part.wheels[:, 2], 0)
    np.testing.assert_allclose(np.delete(part.wheels, 2, axis=1), np.delete(whole.wheels, 2, axis=1))


def test_median_ignores_a_momentary_drop() -> None:
    """One instant without torque changes the mean of μ, and not its median."""
    load, slip, torque = np.full((1, 9, 6), 50.0), np.full((1, 9, 6), 0.03), np.full((1, 9, 6), 0.3)
    torque[0, 4] = 0.0
    features = reduce_windows(load, slip, torque, np.full((1, 5), 0.01), 0.075).wheels[0, 0]
    assert features[2] == pytest.approx(0.08 * 8 / 9)
    assert features[3] == pytest.approx(0.08)


def test_uncertainty_is_clipped_to_the_range_of_the_training() -> None:
    """An exactly known rover has the lowest uncertainty of the training, an unknown one the highest."""
    exact, unknown = CalibrationUncertainty(0, 0, 0, 0, 0), CalibrationUncertainty(1, 1, 1, 9, 1)
    np.testing.assert_array_equal(exact.deviations(), [UNCERTAINTY_LOW])
    np.testing.assert_array_equal(unknown.deviations(), [UNCERTAINTY_HIGH])


@pytest.mark.parametrize("soil", [None, *SOILS])
def test_the_known_class_is_one_hot(soil: str | None) -> None:
    """The class of the soil is one among four zeros, and none is four zeros."""
    uncertainty = CalibrationUncertainty(soil=soil)
    ones = np.ones((1, 4, 6))
    known = reduce_windows(50 * ones, ones, ones, uncertainty.deviations(), 0.075, uncertainty.soil_index()).known
    np.testing.assert_array_equal(known[0, -4:], [float(name == soil) for name in SOILS])
