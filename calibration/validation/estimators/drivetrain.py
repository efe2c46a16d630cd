"""Error of the cohesion by a no-load current of 37 mA, with and without the wheels-up calibration.

| case | no-load current | its stated standard deviation |
|---|---|---|
| calibrated | subtracted | 1 mA |
| uncalibrated | attributed to the soil by Eq. 11 | 1 mA |
| uncalibrated_and_doubted | attributed to the soil by Eq. 11 | 10 mA, the largest that the posterior accepts |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.parameters import Drivetrain, Wheel
from regolithd.calibration.posterior import simulated_rovers
from regolithd.calibration.posterior.window import (
    UNCERTAINTY_HIGH,
    UNCERTAINTY_LOW,
    CalibrationUncertainty,
    reduce_windows,
)
from regolithd.calibration.validation.estimators.errors_and_coverage import NO_LOAD_A

if TYPE_CHECKING:
    from regolithd.calibration.posterior.estimator import PosteriorEstimator


def figures(count: int, seed: int, estimator: PosteriorEstimator) -> dict[str, float]:
    """Return error, bias and coverage of cohesion for windows of 10 s, with and without the calibration."""
    rng = np.random.default_rng(seed)
    wheel, drivetrain = Wheel(), Drivetrain()
    calibrated = np.tile(CalibrationUncertainty().deviations(), (count, 1))
    uncalibrated = calibrated.copy()
    uncalibrated[:, 4] = UNCERTAINTY_LOW[4]
    doubted = uncalibrated.copy()
    doubted[:, 1] = UNCERTAINTY_HIGH[1]
    rovers = simulated_rovers.draw_rovers(count, rng, calibrated, no_load_A=NO_LOAD_A)
    measured = simulated_rovers.simulate_measurements(
        rovers, simulated_rovers.table_4_noise(count), 20, rng, drivetrain, wheel
    )
    uncorrected = drivetrain.gain_Nm_per_A * measured.current_A
    cohesion = rovers.soils.cohesion_Pa
    out = {"hidden_no_load_A": NO_LOAD_A}
    for name, torque, uncertainty in (
        ("calibrated", measured.torque_Nm, calibrated),
        ("uncalibrated", uncorrected, uncalibrated),
        ("uncalibrated_and_doubted", uncorrected, doubted),
    ):
        mixture = estimator.mixtures(
            reduce_windows(measured.load_N, measured.slip, torque, uncertainty, wheel.radius_m)
        )
        error = mixture.means()[:, 0] - cohesion
        low, high = mixture.quantiles(np.array([0.05, 0.95]))[:, 0].T
        out[f"drivetrain_{name}_rmse_cohesion_Pa"] = float(np.sqrt(np.mean(error**2)))
        out[f"drivetrain_{name}_bias_cohesion_Pa"] = float(np.mean(error))
        out[f"drivetrain_{name}_coverage_90"] = float(np.mean((low <= cohesion) & (cohesion <= high)))
    return out
