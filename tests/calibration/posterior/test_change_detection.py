"""The soil-change alarm: raised by a change of soil, not by drops of current, slopes or missing wheels."""

import numpy as np

from regolithd.calibration.parameters import SOILS, Wheel
from regolithd.calibration.posterior import change_detection as change
from regolithd.calibration.terrain.wheel_soil import contact_angle, wheel_torque
from regolithd.calibration.validation.estimators.simulated_drives import SimulatedDrive, instants, torque_curve

THRESHOLD = 11.2


def first_alarm(drive: SimulatedDrive, length: int, seed: int = 0) -> np.ndarray:
    """Return the half second of each rover's first alarm, ∞ where none came."""
    expected = torque_curve(SOILS[drive.first], Wheel())
    state, first = change.start((drive.rovers,)), np.full(drive.rovers, np.inf)
    for k, instant in enumerate(instants(drive, length, np.random.default_rng(seed))):
        state, top = change.step(state, instant.torque_Nm, expected(instant.load_N, instant.slip))
        first = np.minimum(first, np.where(top > THRESHOLD, k, np.inf))
    return first


def test_the_torque_curve_is_the_model() -> None:
    """The polynomial stays within 2 % of the wheel–soil model for every soil."""
    load, slip = np.meshgrid(np.geomspace(8, 120, 9), np.linspace(0, 0.2, 7))
    for soil in SOILS.values():
        exact = wheel_torque(contact_angle(load, slip, Wheel(), soil), slip, Wheel(), soil)
        np.testing.assert_allclose(torque_curve(soil, Wheel())(load, slip), exact, rtol=0.02)


def test_a_weaker_soil_raises_the_alarm_within_a_minute() -> None:
    """At 35 % noise nine in ten of 40 rovers raise the alarm within a minute of a change to a weaker soil."""
    first = first_alarm(SimulatedDrive(40, change_at=400, at_once=True), 520)
    assert np.mean((first >= 400) & (first < 520)) > 0.9


def test_slopes_and_momentary_drops_raise_none() -> None:
    """Six rovers raise no alarm in ten minutes with slopes and three times the usual rate of drops."""
    assert np.isinf(first_alarm(SimulatedDrive(6, noise=0.2, drop_rate=0.09), 1200)).all()


def test_one_rover_alone_has_the_sums_of_one_among_many() -> None:
    """A rover alone and among others has the same CUSUMs, and the alarm has direction, onset and torque ratio."""
    rng = np.random.default_rng(1)
    torque = 0.3 + 0.1 * rng.standard_normal((500, 2, 6))
    torque[420:, 0] -= 0.15
    together, alone = change.start((2,)), change.start()
    raised = None
    for k in range(500):
        together, _ = change.step(together, torque[k], np.full((2, 6), 0.3))
        alone, top = change.step(alone, torque[k, 0], np.full(6, 0.3))
        np.testing.assert_allclose(together.sums[0], alone.sums)
        raised = raised or change.alarm(alone, k * 500_000_000, THRESHOLD)
    assert raised is not None
    assert raised.direction == "fall"
    assert abs(raised.onset_ns / 5e8 - 420) <= 20
    assert 0.3 < raised.torque_ratio < 0.8
    assert change.alarm(change.start(), 0, THRESHOLD) is None
    assert top > THRESHOLD


def test_a_missing_wheel_is_ignored() -> None:
    """With two wheels never measured the others raise the alarm, and no CUSUM is NaN."""
    rng = np.random.default_rng(1)
    torque = 0.3 + 0.1 * rng.standard_normal((520, 6))
    torque[420:] -= 0.15
    torque[:, 2:4] = np.nan
    state = change.start()
    for row in torque:
        state, top = change.step(state, row, np.full(6, 0.3))
        assert np.isfinite(top)
    assert top > THRESHOLD
