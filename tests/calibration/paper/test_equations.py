"""The paper's closed forms (Eqs 6–10) against its integrals and worked values."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from regolithd.calibration.paper import equations as eq

angles = st.floats(0.05, 1.5).map(np.float64)
stresses = st.floats(100, 1e5).map(np.float64)
cohesions = st.floats(0, 1e4).map(np.float64)


@given(angles, stresses, stresses, cohesions)
def test_equation_6_is_the_integral_of_equations_4_and_5(theta: float, normal: float, shear: float, c: float) -> None:
    """The closed form of the load equals the integral of Eq. 2."""
    np.testing.assert_allclose(
        eq.load(theta, normal, shear, c, 0.075, 0.07),
        eq.load_by_integration(theta, normal, shear, c, 0.075, 0.07),
        rtol=1e-9,
    )


@given(angles, stresses, cohesions)
def test_equation_7_is_the_integral_of_equation_5(theta: float, shear: float, c: float) -> None:
    """The closed form of the torque equals the integral of Eq. 3."""
    np.testing.assert_allclose(
        eq.torque(theta, shear, c, 0.075, 0.07), eq.torque_by_integration(theta, shear, c, 0.075, 0.07), rtol=1e-12
    )


def test_slip_of_a_standing_wheel_is_nan() -> None:
    """Slip is NaN at standstill, and 0.025 where the hub moves 0.975 m for 1 m of rim."""
    np.testing.assert_allclose(eq.slip(np.array([0.0, 0.975]), np.array([0.0, 1 / 0.075]), 0.075), [np.nan, 0.025])


def test_sinkage_and_contact_angle_have_their_worked_values() -> None:
    """At slip 0.02 a static sinkage of 10 mm becomes 10.303 mm (Eq. 8), and cos θ_C is 1 − z/r (Eq. 9)."""
    sinkage = eq.slip_sinkage(np.float64(0.010), np.float64(0.02))
    np.testing.assert_allclose(sinkage, 0.010 * 1.02 / 0.99)
    np.testing.assert_allclose(np.cos(eq.contact_angle(sinkage, 0.075)), 1 - sinkage / 0.075)


@given(angles)
def test_shear_displacement_without_slip_is_the_rolling_wheels(theta: float) -> None:
    """Eq. 10 at slip 0 is r (θ_C − sin θ_C), and at slip 1 the arc r θ_C."""
    np.testing.assert_allclose(eq.shear_displacement(theta, np.float64(0.0), 0.075), 0.075 * (theta - np.sin(theta)))
    np.testing.assert_allclose(eq.shear_displacement(theta, np.float64(1.0), 0.075), 0.075 * theta)


@given(angles, stresses, stresses, cohesions)
def test_stresses_have_their_values_at_entry_peak_and_exit(theta: float, normal: float, shear: float, c: float) -> None:
    """Eq. 4 gives 0, σ_m and 0, Eq. 5 gives c, τ_m and 0, at the exit, θ_m and the entry."""
    at = np.array([0.0, theta / 2, theta])
    np.testing.assert_allclose(eq.normal_stress(at, theta, normal), [0, normal, 0], atol=1e-9 * normal)
    np.testing.assert_allclose(eq.shear_stress(at, theta, shear, c), [c, shear, 0], atol=1e-9 * (shear + c))
