"""Noise of the simulated measurements."""

import numpy as np

from regolithd.calibration.parameters import Drivetrain, Wheel
from regolithd.calibration.posterior.simulated_rovers import (
    TABLE_4_CURRENT,
    draw_noise,
    draw_rovers,
    drawbar_margins,
    no_noise,
    simulate_measurements,
    stated_noise,
    table_4_noise,
)
from regolithd.calibration.terrain.wheel_soil import contact_angle, wheel_torque


def test_simulated_currents_have_the_noise_of_table_4() -> None:
    """The relative standard deviation of 2000 currents of a rover is that of Table 4, with the drops."""
    rng = np.random.default_rng(0)
    rovers = draw_rovers(4, rng, np.full((4, 5), 1e-6), no_load_A=0.2)
    current = simulate_measurements(rovers, table_4_noise(4), 2000, rng, Drivetrain(), Wheel()).current_A
    np.testing.assert_allclose((current.std(axis=1) / current.mean(axis=1)).mean(axis=0), TABLE_4_CURRENT, rtol=0.08)


def test_the_stated_noise_is_independent_of_the_soil() -> None:
    """Over 6000 windows it correlates with the noise of the current, and not with soil or torque."""
    rng = np.random.default_rng(0)
    rovers, noise = draw_rovers(6000, rng), draw_noise(6000, rng)
    stated = stated_noise(rovers, noise, Drivetrain().gain_Nm_per_A, rng)
    torque = simulate_measurements(rovers, no_noise(6000), 1, rng, Drivetrain(), Wheel()).torque_Nm.mean(axis=(1, 2))
    assert np.corrcoef(stated, noise.current.mean(axis=1))[0, 1] > 0.4
    for of_the_soil in (np.log(rovers.soils.cohesion_Pa), rovers.soils.friction_angle_deg, torque):
        assert abs(np.corrcoef(stated, of_the_soil)[0, 1]) < 3.5 / np.sqrt(6000)


def test_without_noise_and_errors_the_torque_is_the_models() -> None:
    """With zero noise and uncertainty the measured torque is that of the wheel–soil model for load and slip."""
    rng, wheel = np.random.default_rng(0), Wheel()
    rovers = draw_rovers(50, rng, np.full((50, 5), 1e-12))
    torque = simulate_measurements(rovers, no_noise(50), 3, rng, Drivetrain(), wheel).torque_Nm
    soils = rovers.soils.per_wheel()
    exact = wheel_torque(contact_angle(rovers.load_N, rovers.slip, wheel, soils), rovers.slip, wheel, soils)
    np.testing.assert_allclose(torque, np.broadcast_to(exact[:, None], torque.shape), rtol=1e-6)


def test_the_margin_is_between_those_of_the_wheels() -> None:
    """The drawbar margin of a rover is finite, and below the tangent of a vertical slope."""
    margins = drawbar_margins(draw_rovers(200, np.random.default_rng(0)), Wheel())
    assert margins.shape == (200,)
    assert np.isfinite(margins).all()
