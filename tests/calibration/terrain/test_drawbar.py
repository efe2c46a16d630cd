"""Thrust and resistance against quadrature, the loads' balance, and soils as arrays against soils one by one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.calibration.paper.equations import normal_stress, shear_stress
from regolithd.calibration.parameters import SOILS, Rover, Wheel
from regolithd.calibration.terrain import wheel_soil
from regolithd.calibration.terrain.drawbar import drawbar_margin, drawbar_pull, resistance, thrust
from regolithd.calibration.terrain.soils import draw_soils, soils_from
from regolithd.calibration.terrain.wheel_loads import GRAVITY_M_S2, wheel_loads

WHEEL = Wheel()


@given(st.floats(0.05, 1.5), st.floats(100, 1e5), st.floats(100, 1e5), st.floats(0, 1e4))
def test_closed_forms_are_the_integrals(angle: float, normal: float, shear: float, cohesion: float) -> None:
    """Thrust and resistance are what the stresses of Eqs 4 and 5 add up to."""
    theta = np.linspace(0, angle, 20_001)
    whole = np.float64(angle)
    pushed = shear_stress(theta, whole, np.float64(shear), np.float64(cohesion)) * np.cos(theta)
    held = normal_stress(theta, whole, np.float64(normal)) * np.sin(theta)
    area = WHEEL.radius_m * WHEEL.width_m
    assert thrust(whole, np.float64(shear), cohesion, WHEEL) == pytest.approx(
        area * np.trapezoid(pushed, theta), rel=1e-5
    )
    assert resistance(whole, np.float64(normal), WHEEL) == pytest.approx(area * np.trapezoid(held, theta), rel=1e-5)


@pytest.mark.parametrize("name", SOILS)
def test_the_margin_is_the_pull_at_the_end_of_slip(name: str) -> None:
    """No slip pulls more than the margin says, at an unchanged contact angle, and a stiff soil gets to it."""
    soil = SOILS[name].model_copy(update={"shear_modulus_m": 1e-6})
    angle = np.array([0.4])
    slip = np.array([0.9])
    pull = drawbar_pull(angle, slip, WHEEL, soil) / wheel_soil.carried_load(angle, slip, WHEEL, soil)
    assert pull == pytest.approx(drawbar_margin(angle, slip, WHEEL, soil), rel=1e-6)


@given(st.floats(-0.4, 0.4), st.floats(-0.3, 0.3))
def test_loads_balance_weight_and_moments(pitch: float, roll: float) -> None:
    """The six loads add to the weight across the slope, and their moments hold the centre of gravity."""
    rover = Rover()
    loads = wheel_loads(np.float64(pitch), np.float64(roll), rover)
    assert loads.sum() == pytest.approx(30 * GRAVITY_M_S2 * np.cos(pitch) * np.cos(roll))
    ahead = np.array([1, 1, 0, 0, -1, -1]) * rover.wheelbase_m / 2
    assert loads @ ahead / loads.sum() == pytest.approx(-0.25 * np.tan(pitch), abs=1e-12)


def test_many_soils_at_once_are_soils_one_by_one() -> None:
    """The contact angle of four soils in one array is that of each alone."""
    load, slip = np.linspace(10, 80, 6), np.full(6, 0.03)
    together = wheel_soil.contact_angle(load, slip, WHEEL, soils_from(list(SOILS.values())).per_wheel())
    alone = [wheel_soil.contact_angle(load, slip, WHEEL, soil) for soil in SOILS.values()]
    np.testing.assert_allclose(together, alone, rtol=1e-9)


def test_drawn_soils_surround_their_classes() -> None:
    """The medians of the soils around a class are near it, and none is outside what a soil can be."""
    soils, nearest = draw_soils(20_000, np.random.default_rng(0))
    assert soils.cohesion_Pa.min() > 0
    assert soils.friction_angle_deg.min() >= 5
    for index, soil in enumerate(SOILS.values()):
        mine = nearest == index
        assert np.median(soils.shear_modulus_m[mine]) == pytest.approx(soil.shear_modulus_m, rel=0.15)
