"""The bias of φ under noise: what the noise alone does to each method's mean answer, on one and the same soil.

Sandy loam, 49 N, slip 0.025, a calibrated drivetrain. The paper's network is also asked where the paper was: at the
means of its record 500, with the scatter of its Table 4.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from regolithd.calibration.models import TERRAIN_MODEL
from regolithd.calibration.parameters import SOILS, Drivetrain, Wheel
from regolithd.calibration.posterior import simulated_rovers as simulation
from regolithd.calibration.posterior.window import CalibrationUncertainty, reduce_windows
from regolithd.calibration.terrain.soils import soils_from
from regolithd.calibration.validation.estimators.errors_and_coverage import NO_LOAD_A
from regolithd.calibration.validation.reproduction import published

if TYPE_CHECKING:
    from regolithd.calibration.posterior.estimator import PosteriorEstimator

Array = NDArray[np.float64]

QUIET = 0.10
"""Relative noise of the current in the quiet runs: the least that the posterior was trained with."""


def figures(count: int, seed: int, estimator: PosteriorEstimator) -> dict[str, float]:
    """Return the mean φ of each method [°] with the noise of Table 4 and without, and the difference."""
    rng = np.random.default_rng(seed)
    out = {}
    for name, noise in (("quiet", _quiet(count)), ("noisy", simulation.table_4_noise(count))):
        out[f"bias_posterior_{name}_friction_angle_deg"] = _posterior(count, noise, rng, estimator)
    usual, noisy = _paper(rng)
    out |= {"bias_paper_quiet_friction_angle_deg": usual, "bias_paper_noisy_friction_angle_deg": noisy}
    for method in ("paper", "posterior"):
        noisy, quiet = (out[f"bias_{method}_{name}_friction_angle_deg"] for name in ("noisy", "quiet"))
        out[f"bias_{method}_of_noise_deg"] = noisy - quiet
    return out


def _posterior(count: int, noise: simulation.Noise, rng: np.random.Generator, estimator: PosteriorEstimator) -> float:
    wheel, known = Wheel(), np.tile(CalibrationUncertainty().deviations(), (count, 1))
    soils = soils_from([SOILS["sandy-loam"]] * count, wheel.width_m)
    rovers = simulation.draw_rovers(count, rng, known, no_load_A=NO_LOAD_A)
    rovers = replace(rovers, soils=soils, load_N=np.full((count, 6), 49.0), slip=np.full((count, 6), 0.025))
    measured = simulation.drive(rovers, noise, 20, rng, Drivetrain(), wheel)
    windows = reduce_windows(measured.load_N, measured.slip, measured.torque_Nm, known, wheel.radius_m)
    return float(np.degrees(estimator.mixtures(windows).means()[:, 1].mean()))


def _quiet(count: int) -> simulation.Noise:
    table = simulation.table_4_noise(count)
    return replace(table, current=np.full((count, 6), QUIET), drop_rate=np.zeros((count, 1)))


def _paper(rng: np.random.Generator) -> tuple[float, float]:
    """Return the paper network's φ at record 500's means, and averaged over noisy records about them [°]."""
    record = published.SET_500
    count = 20_000
    noise = simulation.disturb(simulation.table_4_noise(count), (count, 1, 6), rng)[:, 0]
    load = record["load_N"] * np.clip(1 + simulation.TABLE_4_LOAD * rng.standard_normal((count, 6)), 0.2, None)
    # The drops lower the mean of the current; it is the scatter about the mean that is asked about.
    current = np.clip(record["motor_current_A"] * noise / noise.mean(), 0, None)
    slip = np.full_like(load, record["slip"])
    session = onnxruntime.InferenceSession(TERRAIN_MODEL)

    def angle(inputs: Array) -> float:
        (raw,) = session.run(None, {"inputs": inputs.reshape(-1, 3).astype(np.float32)})
        return float(np.degrees(np.arctan(raw[:, 1])).mean())

    usual = np.array([record["load_N"], record["slip"], record["motor_current_A"]])
    return angle(usual), angle(np.stack([load, slip, current], axis=-1))
