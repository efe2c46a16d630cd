"""The evaluation: the alarm's threshold keeps its rate, delays count from the crossing, coverage is counted right."""

import numpy as np

from regolithd.calibration.posterior.estimator import PosteriorEstimator
from regolithd.calibration.validation.estimators import bias
from regolithd.calibration.validation.estimators import change_detector as detector
from regolithd.calibration.validation.estimators import errors_and_coverage as estimators
from regolithd.calibration.validation.estimators.traverse import Drive


def test_the_threshold_gives_the_rate_that_was_asked_for() -> None:
    """Of independent peaks, the threshold lets through as many as one in 8 h, and not one more."""
    rng = np.random.default_rng(0)
    peaks = rng.exponential(1.0, (600, 40))
    null = detector.NullDrives({"cusum": peaks}, peaks.size * detector.QUIET)
    limit = detector.threshold(null, "cusum")
    assert 0.9 < detector.false_alarms(null, "cusum", limit) <= 1.0


def test_delays_count_from_the_crossing() -> None:
    """With no doubt about the change, the alarm comes within seconds after it, and none before."""
    drive = Drive(8, 400, at_once=True, noise=0.05, drop_rate=0.0, no_load_A=0.0)
    found = detector.delays(drive, {"cusum": 11.2}, np.random.default_rng(0))["cusum"]
    assert np.nanmedian(found) < 10
    assert np.nanmin(found) > 0


def test_the_posterior_is_better_than_no_data_and_covers_as_it_says() -> None:
    """On 600 new rovers: less error than the prior's mean, and 90 % intervals that hold between 86 and 94 %."""
    found = estimators.figures(estimators.answers(600, estimators.Case(), 1, PosteriorEstimator()), "")
    assert found["posterior_rmse_cohesion_Pa"] < 0.85 * found["prior_mean_rmse_cohesion_Pa"]
    assert found["posterior_rmse_cohesion_Pa"] < 0.6 * found["paper_rmse_cohesion_Pa"]
    for target in ("cohesion", "friction_angle", "margin"):
        assert 0.86 < found[f"coverage_90_{target}"] < 0.94
        assert 0.43 < found[f"coverage_50_{target}"] < 0.57


def test_a_single_instant_is_told_without_bias_though_most_of_the_current_is_friction() -> None:
    """At 37 mA of no-load current, on 3000 rovers: c less than 0.2 kPa off on average, and intervals as they say."""
    found = estimators.figures(estimators.answers(3000, estimators.CASES["instant"], 1, PosteriorEstimator()), "")
    assert abs(found["posterior_bias_cohesion_Pa"]) < 200
    for target in ("cohesion", "friction_angle", "margin"):
        assert 0.875 < found[f"coverage_90_{target}"] < 0.925
        assert 0.465 < found[f"coverage_50_{target}"] < 0.535


def test_noise_pulls_the_papers_friction_angle_down_and_leaves_the_posteriors() -> None:
    """The scatter of Table 4 lowers the paper network's mean φ by more than half a degree; ours by less than half."""
    found = bias.figures(300, 1, PosteriorEstimator())
    assert found["bias_paper_of_noise_deg"] < -0.5
    assert abs(found["bias_posterior_of_noise_deg"]) < 0.5
