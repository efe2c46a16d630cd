"""Bias of the friction angle by the noise of the current: mean estimates with and without noise on one soil.

The posterior: sandy loam, 49 N, slip 0.025, a calibrated drivetrain. The paper's network: at the means of record 500,
with the scatter of the paper's Table 4.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.parameters import SOILS, Drivetrain, Wheel
from regolithd.calibration.posterior import simulated_rovers
from regolithd.calibration.posterior.window import CalibrationUncertainty, reduce_windows
from regolithd.calibration.terrain.soils import soils_from
from regolithd.calibration.validation.estimators import paper_network
from regolithd.calibration.validation.estimators.errors_and_coverage import NO_LOAD_A
from regolithd.calibration.validation.reproduction import published

if TYPE_CHECKING:
    from regolithd.calibration.posterior.estimator import PosteriorEstimator

Array = NDArray[np.float64]

LOW_NOISE = 0.10
"""Relative standard deviation of the current in the runs with low noise [1]."""


def figures(count: int, seed: int, estimator: PosteriorEstimator) -> dict[str, float]:
    """Return the mean φ of each method [°] with the noise of Table 4 and with low noise, and the difference."""
    rng = np.random.default_rng(seed)
    out = {}
    for name, noise in (("quiet", _low_noise(count)), ("noisy", simulated_rovers.table_4_noise(count))):
        out[f"bias_posterior_{name}_friction_angle_deg"] = _posterior(count, noise, rng, estimator)
    usual, noisy = _paper(rng)
    out |= {"bias_paper_quiet_friction_angle_deg": usual, "bias_paper_noisy_friction_angle_deg": noisy}
    for method in ("paper", "posterior"):
        noisy, quiet = (out[f"bias_{method}_{name}_friction_angle_deg"] for name in ("noisy", "quiet"))
        out[f"bias_{method}_of_noise_deg"] = noisy - quiet
    return out


def _posterior(
    count: int, noise: simulated_rovers.MeasurementNoise, rng: np.random.Generator, estimator: PosteriorEstimator
) -> float:
    wheel, known = Wheel(), np.tile(CalibrationUncertainty().deviations(), (count, 1))
    soils = soils_from([SOILS["sandy-loam"]] * count, wheel.width_m)
    rovers = simulated_rovers.draw_rovers(count, rng, known, no_load_A=NO_LOAD_A)
    rovers = replace(rovers, soils=soils, load_N=np.full((count, 6), 49.0), slip=np.full((count, 6), 0.025))
    measured = simulated_rovers.simulate_measurements(rovers, noise, 20, rng, Drivetrain(), wheel)
    windows = reduce_windows(measured.load_N, measured.slip, measured.torque_Nm, known, wheel.radius_m)
    return float(np.degrees(estimator.mixtures(windows).means()[:, 1].mean()))


def _low_noise(count: int) -> simulated_rovers.MeasurementNoise:
    table = simulated_rovers.table_4_noise(count)
    return replace(table, current=np.full((count, 6), LOW_NOISE), drop_rate=np.zeros((count, 1)))


def _paper(rng: np.random.Generator) -> tuple[float, float]:
    """Return φ by the paper's network at the means of record 500, and its mean over noisy records about them [°]."""
    record = published.SET_500
    count = 20_000
    noise = simulated_rovers.current_noise_factor(simulated_rovers.table_4_noise(count), (count, 1, 6), rng)[:, 0]
    load = record["load_N"] * np.clip(1 + simulated_rovers.TABLE_4_LOAD * rng.standard_normal((count, 6)), 0.2, None)
    # Divided by its mean: the drops lower the mean current, and only the scatter is of interest here.
    current = np.clip(record["motor_current_A"] * noise / noise.mean(), 0, None)
    slip = np.full_like(load, record["slip"])

    def angle(*inputs: Array) -> float:
        return float(np.degrees(np.arctan(paper_network.estimate(*inputs)[..., 1].ravel())).mean())

    usual = (np.array([record[name]]) for name in ("load_N", "slip", "motor_current_A"))
    return angle(*usual), angle(load, slip, current)
