"""A curve of the evidence: mean residuals in bins of a covariate, with their standard error."""

from __future__ import annotations

import numpy as np
import pytest
from law_problem import SPEED, P

from regolithd.calibration.mismatch.inference.evidence import _curves_over
from regolithd.calibration.mismatch.signal.noise_models.noise import NoiseModel

NOISE = NoiseModel(np.array([0.1, 0.2, 0.3, 0.4]), 5.0)


def test_a_curve_has_what_was_before_and_what_is_left() -> None:
    """Over the wheels that are asked for; the error is the noise's, its autocorrelation included."""
    couplings = {"offset": np.ones(SPEED.shape), "drag": np.full(SPEED.shape, 2.0)}
    offset, curve = _curves_over(P, "wheel_speed", couplings, (SPEED, -SPEED / 2), NOISE, [1, 3])
    assert offset.coupling == "offset"
    np.testing.assert_allclose(offset.before, offset.at)
    assert (curve.covariate, curve.coupling, curve.wheels) == ("wheel_speed", "drag", (2, 4))
    np.testing.assert_allclose(curve.before, 2 * curve.at)
    np.testing.assert_allclose(curve.after, -curve.at)
    of_one = np.sqrt(0.5 * (0.2**2 + 0.4**2) * 5.0)
    readings = SPEED[:, [1, 3]].size
    assert len(curve.at) == 24
    np.testing.assert_allclose(np.sum((of_one / curve.standard_error) ** 2), readings)


@pytest.mark.parametrize(("name", "wheels"), [("wheel_speed", []), ("direction", [0])])
def test_there_is_no_curve_of_too_little(name: str, wheels: list[int]) -> None:
    """Neither without readings nor over a covariate that has two values."""
    assert _curves_over(P, name, {"drag": SPEED}, (SPEED, SPEED), NOISE, wheels) == []
