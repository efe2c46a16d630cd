"""The evaluation of estimators and alarm: rate of false alarms, delays, errors, coverage, bias."""

import numpy as np

from regolithd.calibration.posterior.estimator import PosteriorEstimator
from regolithd.calibration.validation.estimators import bias, change_detector, errors_and_coverage
from regolithd.calibration.validation.estimators.simulated_drives import SimulatedDrive


def test_the_threshold_gives_the_requested_rate() -> None:
    """Of independent peaks at most one in 8 h exceeds the threshold, and more than 0.9."""
    rng = np.random.default_rng(0)
    peaks = rng.exponential(1.0, (600, 40))
    drives = change_detector.SingleSoilDrives({"cusum": peaks}, peaks.size * change_detector.DEAD_TIME)
    limit = change_detector.threshold(drives, "cusum")
    assert 0.9 < change_detector.false_alarms(drives, "cusum", limit) <= 1.0


def test_delays_count_from_the_crossing() -> None:
    """With little noise the median delay is below 10 s, and no alarm precedes the crossing."""
    drive = SimulatedDrive(8, 400, at_once=True, noise=0.05, drop_rate=0.0, no_load_A=0.0)
    found = change_detector.delays(drive, {"cusum": 11.2}, np.random.default_rng(0))["cusum"]
    assert np.nanmedian(found) < 10
    assert np.nanmin(found) > 0


def test_the_posterior_is_better_than_no_data_and_calibrated() -> None:
    """On 600 held-out rovers the error is below the prior mean's, and the coverage of 90 % intervals is 86–94 %."""
    found = errors_and_coverage.figures(
        errors_and_coverage.estimate_all(600, errors_and_coverage.Case(), 1, PosteriorEstimator()), ""
    )
    assert found["posterior_rmse_cohesion_Pa"] < 0.85 * found["prior_mean_rmse_cohesion_Pa"]
    assert found["posterior_rmse_cohesion_Pa"] < 0.6 * found["paper_rmse_cohesion_Pa"]
    for target in ("cohesion", "friction_angle", "margin"):
        assert 0.86 < found[f"coverage_90_{target}"] < 0.94
        assert 0.43 < found[f"coverage_50_{target}"] < 0.57


def test_a_single_instant_has_no_bias_by_the_no_load_current() -> None:
    """At 37 mA of no-load current the mean error of c on 3000 rovers is below 0.2 kPa, and the coverage nominal."""
    found = errors_and_coverage.figures(
        errors_and_coverage.estimate_all(3000, errors_and_coverage.CASES["instant"], 1, PosteriorEstimator()), ""
    )
    assert abs(found["posterior_bias_cohesion_Pa"]) < 200
    for target in ("cohesion", "friction_angle", "margin"):
        assert 0.875 < found[f"coverage_90_{target}"] < 0.925
        assert 0.465 < found[f"coverage_50_{target}"] < 0.535


def test_noise_biases_the_papers_friction_angle_and_not_the_posteriors() -> None:
    """The noise of Table 4 lowers φ by the paper's network by more than 0.5°, and changes the posterior's by less."""
    found = bias.figures(300, 1, PosteriorEstimator())
    assert found["bias_paper_of_noise_deg"] < -0.5
    assert abs(found["bias_posterior_of_noise_deg"]) < 0.5
