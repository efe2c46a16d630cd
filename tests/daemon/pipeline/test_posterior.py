"""There is a posterior twice a second, for a calibrated drivetrain and the wheel that the network was trained for."""

from collections.abc import Callable

import pytest

from regolithd.calibration.parameters import Drivetrain
from regolithd.calibration.posterior.estimator import PosteriorModelError
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.pipeline.onnx_models import load_models, load_posterior
from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.pipeline.posterior import gain_relative_std
from regolithd.daemon.pipeline.snapshot import Estimate

CALIBRATED = {"no_load_current_A": 0.037, "no_load_current_std_A": 0.001, "gain_relative_std": 0.03}


def changed(configuration: Configuration, **tables: dict[str, object]) -> Configuration:
    """Return a configuration with some tables changed."""
    return Configuration.model_validate(configuration.model_dump() | tables)


def estimates(configuration: Configuration, drive: Callable, rate_Hz: float, snapshots: int) -> list[Estimate]:
    """Return the chain's estimates of a straight drive."""
    models = load_models(configuration)
    return Chain(configuration, models).feed(drive(rate_Hz=rate_Hz).frames(snapshots))


@pytest.mark.parametrize("rate_Hz", [2.0, 20.0])
def test_a_calibrated_rover_has_a_posterior_twice_a_second(
    configuration: Configuration, drive: Callable, rate_Hz: float
) -> None:
    """At any SYNC rate, with ordered quantiles and intervals that narrow with time."""
    settings = changed(configuration, drivetrain=CALIBRATED, sync={"rate_Hz": rate_Hz})
    made = estimates(settings, drive, rate_Hz, int(15 * rate_Hz))
    posteriors = [estimate.posterior for estimate in made if estimate.posterior is not None]
    assert 27 <= len(posteriors) <= 30
    last = posteriors[-1]
    assert (last.wheels, last.instants) == (6, 20)
    for interval in (last.cohesion_Pa, last.friction_angle_rad, last.drawbar_margin):
        assert interval.low_90 < interval.low_50 < interval.median < interval.high_50 < interval.high_90
    assert last.cohesion_Pa.low_90 > 0
    width = [posterior.cohesion_Pa.high_90 - posterior.cohesion_Pa.low_90 for posterior in (posteriors[0], last)]
    assert width[1] < width[0]  # ten seconds say more than half a one


def test_a_rover_without_a_calibrated_drivetrain_has_no_posterior(
    configuration: Configuration, drive: Callable
) -> None:
    """An unknown no-load current would be attributed to the soil."""
    assert load_posterior(configuration) is None
    assert all(estimate.posterior is None for estimate in estimates(configuration, drive, 2.0, 20))


def test_it_can_be_switched_off(configuration: Configuration) -> None:
    """`[posterior] enabled = false` loads no model, calibrated or not."""
    assert load_posterior(changed(configuration, drivetrain=CALIBRATED, posterior={"enabled": False})) is None


def test_a_posterior_for_another_wheel_is_refused(configuration: Configuration) -> None:
    """The error names both radii and what to do."""
    with pytest.raises(PosteriorModelError, match=r"trained for wheels of 0\.075 m radius, not 0\.1 m\. Train one"):
        load_posterior(changed(configuration, drivetrain=CALIBRATED, wheel={"radius_m": 0.1}))


def test_a_brake_says_how_well_the_gain_is_known() -> None:
    """A wheel with a brake test has its standard deviation, any other that of Eq. 11's constants."""
    assert gain_relative_std(Drivetrain(gain_relative_std=0.05)) == pytest.approx(0.05)
    one = Drivetrain(gain_relative_std=0.05, gain_factor=0.8, gain_factor_std=(0.008, 0, 0, 0, 0, 0))  # type: ignore[arg-type]
    assert gain_relative_std(one) == pytest.approx((0.01 + 5 * 0.05) / 6)
    bent = Drivetrain(gain_factor_std=0.03, load_loss_std_per_Nm=0.1)  # type: ignore[arg-type]  # one value for six
    assert gain_relative_std(bent) == pytest.approx(0.03 * 2**0.5)
