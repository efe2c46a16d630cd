"""Soils as arrays against single soils, and the prior distribution."""

import numpy as np
import pytest

from regolithd.calibration.parameters import SOILS, Wheel
from regolithd.calibration.terrain import wheel_soil
from regolithd.calibration.terrain.soils import draw_soils, soils_from

WHEEL = Wheel()


def test_soils_in_one_array_equal_single_soils() -> None:
    """The contact angle of four soils in one array is that of each alone."""
    load, slip = np.linspace(10, 80, 6), np.full(6, 0.03)
    together = wheel_soil.contact_angle(load, slip, WHEEL, soils_from(list(SOILS.values())).per_wheel())
    alone = [wheel_soil.contact_angle(load, slip, WHEEL, soil) for soil in SOILS.values()]
    np.testing.assert_allclose(together, alone, rtol=1e-9)


def test_take_selects_soils_by_mask_and_by_index() -> None:
    """A mask and the indices where it is true select the same soils."""
    soils = soils_from(list(SOILS.values()))
    by_mask, by_index = soils.take(np.array([True, False, False, True])), soils.take(np.array([0, 3]))
    np.testing.assert_array_equal(by_mask.cohesion_Pa, [1220, 6410])
    np.testing.assert_array_equal(by_index.k_phi_kN, by_mask.k_phi_kN)


def test_drawn_soils_surround_their_classes() -> None:
    """The medians of the soils around a class are near it, and every soil is within the prior's limits."""
    soils, nearest = draw_soils(20_000, np.random.default_rng(0))
    assert soils.cohesion_Pa.min() > 0
    assert soils.friction_angle_deg.min() >= 5
    for index, soil in enumerate(SOILS.values()):
        mine = nearest == index
        assert np.median(soils.shear_modulus_m[mine]) == pytest.approx(soil.shear_modulus_m, rel=0.15)
