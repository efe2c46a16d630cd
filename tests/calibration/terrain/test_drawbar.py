"""Thrust and resistance against quadrature, drawbar pull against its margin."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.calibration.paper.equations import normal_stress, shear_stress
from regolithd.calibration.parameters import SOILS, Wheel
from regolithd.calibration.terrain import wheel_soil
from regolithd.calibration.terrain.drawbar import drawbar_margin, drawbar_pull, resistance, thrust

WHEEL = Wheel()


@given(st.floats(0.05, 1.5), st.floats(100, 1e5), st.floats(100, 1e5), st.floats(0, 1e4))
def test_closed_forms_equal_the_integrals(angle: float, normal: float, shear: float, cohesion: float) -> None:
    """Thrust and resistance equal the integrals of the stresses of Eqs 4 and 5."""
    theta = np.linspace(0, angle, 20_001)
    whole = np.float64(angle)
    forward = shear_stress(theta, whole, np.float64(shear), np.float64(cohesion)) * np.cos(theta)
    backward = normal_stress(theta, whole, np.float64(normal)) * np.sin(theta)
    area = WHEEL.radius_m * WHEEL.width_m
    assert thrust(whole, np.float64(shear), cohesion, WHEEL) == pytest.approx(
        area * np.trapezoid(forward, theta), rel=1e-5
    )
    assert resistance(whole, np.float64(normal), WHEEL) == pytest.approx(area * np.trapezoid(backward, theta), rel=1e-5)


@pytest.mark.parametrize("name", SOILS)
def test_margin_is_the_pull_with_the_strength_mobilised(name: str) -> None:
    """With a shear modulus near zero the shear strength is mobilised, and drawbar pull over load equals the margin."""
    soil = SOILS[name].model_copy(update={"shear_modulus_m": 1e-6})
    angle = np.array([0.4])
    slip = np.array([0.9])
    pull = drawbar_pull(angle, slip, WHEEL, soil) / wheel_soil.carried_load(angle, slip, WHEEL, soil)
    assert pull == pytest.approx(drawbar_margin(angle, slip, WHEEL, soil), rel=1e-6)
