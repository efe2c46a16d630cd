"""The least-squares estimator of Iagnemma et al. is exact where its assumptions hold."""

import numpy as np
import pytest

from regolithd.calibration.paper.least_squares import least_squares
from regolithd.calibration.parameters import SOILS, Wheel
from regolithd.calibration.terrain.wheel_soil import contact_angle, shear_displacement, wheel_torque


@pytest.mark.parametrize("name", SOILS)
def test_without_noise_it_finds_the_soil(name: str) -> None:
    """Loads from 20 to 90 N, sinkage and shear modulus given: cohesion and friction angle come back."""
    soil, wheel = SOILS[name], Wheel()
    load, slip = np.linspace(20, 90, 12)[None], np.full((1, 12), 0.05)
    angle = contact_angle(load, slip, wheel, soil)
    cohesion, tangent = least_squares(
        load,
        wheel_torque(angle, slip, wheel, soil),
        angle,
        shear_displacement(angle, slip, wheel),
        np.array([[soil.shear_modulus_m]]),
        wheel,
    )
    assert cohesion[0] == pytest.approx(soil.cohesion_Pa, rel=0.01)
    assert np.degrees(np.arctan(tangent[0])) == pytest.approx(soil.friction_angle_deg, rel=0.01)
