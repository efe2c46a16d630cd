"""Eqs 11–14: each inversion against what it inverts."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from regolithd.calibration.paper import equations as eq
from regolithd.calibration.paper import load_from_current as inverse

angles = st.floats(0.05, 1.5).map(np.float64)
stresses = st.floats(100, 1e5).map(np.float64)
cohesions = st.floats(0, 1e4).map(np.float64)


@given(angles, stresses, cohesions)
def test_equation_12_inverts_equation_7(theta: float, shear: float, c: float) -> None:
    """The shear stress comes back from its torque."""
    torque = eq.torque(theta, shear, c, 0.075, 0.07)
    np.testing.assert_allclose(
        inverse.peak_shear_from_torque(torque, theta, c, 0.075, 0.07), shear, rtol=1e-9, atol=1e-9
    )


@given(stresses, st.floats(1e-4, 0.1).map(np.float64), cohesions, st.floats(0.1, 0.8).map(np.float64))
def test_equation_13_inverts_equation_1(normal: float, displacement: float, c: float, tangent: float) -> None:
    """The normal stress comes back from its shear stress."""
    shear = eq.peak_shear_stress(normal, displacement, c, tangent, 0.025)
    back = inverse.peak_normal_from_shear(shear, displacement, c, tangent, 0.025)
    np.testing.assert_allclose(back, normal, rtol=1e-6)


def test_equation_11_multiplies_by_the_gain() -> None:
    """80 mA at 16.05 N·m/A are 1.284 N·m."""
    np.testing.assert_allclose(inverse.torque_from_current(np.float64(0.080), 16.05), 1.284)
