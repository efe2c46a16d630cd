"""The paper's closed forms against its integrals, its inversions against what they invert, and its 504 pairs."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from regolithd.calibration.paper import equations as eq
from regolithd.calibration.paper.training_set import training_set
from regolithd.calibration.parameters import Drivetrain, Wheel

angles = st.floats(0.05, 1.5).map(np.float64)
stresses = st.floats(100, 1e5).map(np.float64)
cohesions = st.floats(0, 1e4).map(np.float64)


@given(angles, stresses, stresses, cohesions)
def test_equation_6_is_the_integral_of_equations_4_and_5(theta: float, normal: float, shear: float, c: float) -> None:
    """The closed form of the load carries what Eq. 2 integrates."""
    np.testing.assert_allclose(
        eq.load(theta, normal, shear, c, 0.075, 0.07),
        eq.load_by_integration(theta, normal, shear, c, 0.075, 0.07),
        rtol=1e-9,
    )


@given(angles, stresses, cohesions)
def test_equation_7_is_the_integral_of_equation_5(theta: float, shear: float, c: float) -> None:
    """The closed form of the torque is what Eq. 3 integrates."""
    np.testing.assert_allclose(
        eq.torque(theta, shear, c, 0.075, 0.07), eq.torque_by_integration(theta, shear, c, 0.075, 0.07), rtol=1e-12
    )


@given(angles, stresses, cohesions)
def test_equation_12_inverts_equation_7(theta: float, shear: float, c: float) -> None:
    """The shear stress comes back from its torque."""
    torque = eq.torque(theta, shear, c, 0.075, 0.07)
    np.testing.assert_allclose(eq.peak_shear_from_torque(torque, theta, c, 0.075, 0.07), shear, rtol=1e-9, atol=1e-9)


@given(stresses, st.floats(1e-4, 0.1).map(np.float64), cohesions, st.floats(0.1, 0.8).map(np.float64))
def test_equation_13_inverts_equation_1(normal: float, displacement: float, c: float, tangent: float) -> None:
    """The normal stress comes back from its shear stress."""
    shear = eq.peak_shear_stress(normal, displacement, c, tangent, 0.025)
    back = eq.peak_normal_from_shear(shear, displacement, c, tangent, 0.025)
    np.testing.assert_allclose(back, normal, rtol=1e-6)


def test_a_standing_wheel_has_no_slip_to_speak_of() -> None:
    """Slip is NaN at standstill and 0.025 where 9.75 m came of 10."""
    np.testing.assert_allclose(eq.slip(np.array([0.0, 0.975]), np.array([0.0, 1 / 0.075]), 0.075), [np.nan, 0.025])


def test_there_are_504_pairs_and_shuffling_keeps_them() -> None:
    """Four soils, six currents, three slips and seven sinkages make 504 pairs, in any order."""
    ordered = training_set(Drivetrain(), Wheel())
    shuffled = training_set(Drivetrain(), Wheel(), np.random.default_rng(3))
    assert ordered.inputs.shape == (504, 3)
    assert not np.array_equal(ordered.inputs, shuffled.inputs)
    rows = [np.hstack([each.inputs, each.outputs]) for each in (ordered, shuffled)]
    np.testing.assert_array_equal(*(row[np.lexsort(row.T)] for row in rows))


def test_a_pair_is_what_the_integrals_say() -> None:
    """LETE sand at 80 mA, slip 0.02 and 10 mm: stresses by Eqs 8 to 13, the load by quadrature, is a pair."""
    current, slip, sinkage, c, tangent = (np.float64(x) for x in (0.08, 0.02, 0.010, 1220, np.tan(np.radians(30.3))))
    theta = eq.contact_angle(eq.slip_sinkage(sinkage, slip), 0.075)
    shear = eq.peak_shear_from_torque(eq.torque_from_current(current, 0.0234 * 1400 * 0.49), theta, c, 0.075, 0.07)
    normal = eq.peak_normal_from_shear(shear, eq.shear_displacement(theta, slip, 0.075), c, tangent, np.float64(0.0116))
    load = eq.load_by_integration(theta, normal, shear, c, 0.075, 0.07)
    rows = training_set(Drivetrain(), Wheel()).inputs
    same = (rows[:, 1] == slip) & (rows[:, 2] == current)
    assert np.isclose(rows[same, 0], load, rtol=1e-9).sum() == 1
