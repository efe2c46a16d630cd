"""What 37 mA of hidden no-load current does to cohesion, with and without the wheels-up calibration.

With it, the no-load current is taken out and known to 1 mA; without it, Eq. 11 reads all of the current as soil. A
third way is to know that it is not known: the posterior is told the most doubt that it takes (10 mA), which 37 mA
still exceed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.parameters import Drivetrain, Wheel
from regolithd.calibration.posterior import simulated_rovers as simulation
from regolithd.calibration.posterior.window import KNOWN_HIGH, KNOWN_LOW, CalibrationUncertainty, reduce_windows
from regolithd.calibration.validation.estimators.errors_and_coverage import NO_LOAD_A

if TYPE_CHECKING:
    from regolithd.calibration.posterior.estimator import PosteriorEstimator


def figures(count: int, seed: int, estimator: PosteriorEstimator) -> dict[str, float]:
    """Return error, bias and coverage of cohesion for windows of 10 s, with and without the calibration."""
    rng = np.random.default_rng(seed)
    wheel, drivetrain = Wheel(), Drivetrain()
    known = np.tile(CalibrationUncertainty().deviations(), (count, 1))
    unknown = known.copy()
    unknown[:, 4] = KNOWN_LOW[4]
    doubtful = unknown.copy()
    doubtful[:, 1] = KNOWN_HIGH[1]
    rovers = simulation.draw_rovers(count, rng, known, no_load_A=NO_LOAD_A)
    measured = simulation.drive(rovers, simulation.table_4_noise(count), 20, rng, drivetrain, wheel)
    all_of_it = drivetrain.gain_Nm_per_A * measured.current_A
    cohesion = rovers.soils.cohesion_Pa
    out = {"hidden_no_load_A": NO_LOAD_A}
    for name, torque, doubt in (
        ("calibrated", measured.torque_Nm, known),
        ("uncalibrated", all_of_it, unknown),
        ("uncalibrated_and_doubted", all_of_it, doubtful),
    ):
        mixture = estimator.mixtures(reduce_windows(measured.load_N, measured.slip, torque, doubt, wheel.radius_m))
        error = mixture.means()[:, 0] - cohesion
        low, high = mixture.quantiles(np.array([0.05, 0.95]))[:, 0].T
        out[f"drivetrain_{name}_rmse_cohesion_Pa"] = float(np.sqrt(np.mean(error**2)))
        out[f"drivetrain_{name}_bias_cohesion_Pa"] = float(np.mean(error))
        out[f"drivetrain_{name}_coverage_90"] = float(np.mean((low <= cohesion) & (cohesion <= high)))
    return out
