"""The 504 pairs of the paper."""

import numpy as np

from regolithd.calibration.paper import equations as eq
from regolithd.calibration.paper import load_from_current as inverse
from regolithd.calibration.paper.training_set import training_set
from regolithd.calibration.parameters import Drivetrain, Wheel


def test_there_are_504_pairs_and_shuffling_keeps_them() -> None:
    """Four soils, six currents, three slips and seven sinkages make 504 pairs, in any order."""
    ordered = training_set(Drivetrain(), Wheel())
    shuffled = training_set(Drivetrain(), Wheel(), np.random.default_rng(3))
    assert ordered.inputs.shape == (504, 3)
    assert not np.array_equal(ordered.inputs, shuffled.inputs)
    rows = [np.hstack([each.inputs, each.outputs]) for each in (ordered, shuffled)]
    np.testing.assert_array_equal(*(row[np.lexsort(row.T)] for row in rows))


def test_a_pair_equals_its_integration() -> None:
    """LETE sand at 80 mA, slip 0.02 and 10 mm: stresses by Eqs 8 to 13, the load by quadrature, is a pair."""
    current, slip, sinkage, c, tangent = (np.float64(x) for x in (0.08, 0.02, 0.010, 1220, np.tan(np.radians(30.3))))
    theta = eq.contact_angle(eq.slip_sinkage(sinkage, slip), 0.075)
    shear = inverse.peak_shear_from_torque(
        inverse.torque_from_current(current, 0.0234 * 1400 * 0.49), theta, c, 0.075, 0.07
    )
    normal = inverse.peak_normal_from_shear(
        shear, eq.shear_displacement(theta, slip, 0.075), c, tangent, np.float64(0.0116)
    )
    load = eq.load_by_integration(theta, normal, shear, c, 0.075, 0.07)
    rows = training_set(Drivetrain(), Wheel()).inputs
    same = (rows[:, 1] == slip) & (rows[:, 2] == current)
    assert np.isclose(rows[same, 0], load, rtol=1e-9).sum() == 1
