"""Errors, coverage and ranks of the posterior, compared with the paper's network and least squares.

Held-out rovers from `posterior.simulated_rovers` with the noise of the paper's Table 4. The inputs of each method:

- the paper's network: load, slip and recorded current of each instant and wheel; its estimates are averaged. As in the
  paper the current includes the no-load current; `paper_corrected` has it subtracted. The posterior is compared with
  the better of the two.
- least squares: in addition the true sinkage of each wheel at each instant and the true shear modulus, which a rover
  does not measure.
- the posterior: load, slip and torque, and the uncertainty of the calibration.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.paper.least_squares import least_squares
from regolithd.calibration.parameters import SOILS, Drivetrain, Wheel
from regolithd.calibration.posterior import simulated_rovers
from regolithd.calibration.posterior.window import CalibrationUncertainty, reduce_windows
from regolithd.calibration.terrain.soils import ANGLE_STD_DEG, LOG_STD
from regolithd.calibration.terrain.wheel_soil import contact_angle, shear_displacement
from regolithd.calibration.validation.estimators import paper_network

if TYPE_CHECKING:
    from regolithd.calibration.posterior.estimator import PosteriorEstimator

Array = NDArray[np.float64]

NO_LOAD_A = 0.037
BINS = 20
CHUNK = 1000


@dataclass(frozen=True, slots=True, eq=False)
class MethodEstimates:
    """Estimates of each method for N windows, and the truth.

    Attributes
    ----------
    truth
        Cohesion [Pa], friction angle [rad] and drawbar margin [1], shape (N, 3).
    nearest, slip
        Index in `SOILS` of the nearest class, and mean slip, shape (N,).
    methods
        Cohesion [Pa], friction angle [rad] and, of the posterior, drawbar margin [1], shape (N, 2 or 3).
    ranks
        Posterior distribution function at the truth, shape (N, 3).
    intervals
        Quantiles 0.05, 0.25, 0.5, 0.75, 0.95 of the posterior, shape (N, 3, 5).
    """

    truth: Array
    nearest: NDArray[np.intp]
    slip: Array
    methods: dict[str, Array]
    ranks: Array
    intervals: Array


@dataclass(frozen=True, slots=True)
class Case:
    """Input of the estimators: number of half seconds and of wheels, with noise or not, soil class known or not."""

    instants: int = 20
    wheels: int = 6
    noise: bool = True
    soil_known: bool = False


CASES = {
    "window": Case(),
    "instant": Case(instants=1, wheels=1),
    "noiseless_window": Case(noise=False),
    "told_window": Case(soil_known=True),
}
"""Cases of the evaluation: ten seconds of six wheels (also without noise, and with known class), one instant of one."""


def estimate_all(count: int, case: Case, seed: int, estimator: PosteriorEstimator) -> MethodEstimates:
    """Return the estimates of all methods for `count` rovers."""
    rng = np.random.default_rng(seed)
    parts = [_chunk(min(CHUNK, count - start), case, rng, estimator) for start in range(0, count, CHUNK)]
    return MethodEstimates(
        truth=np.concatenate([part.truth for part in parts]),
        nearest=np.concatenate([part.nearest for part in parts]),
        slip=np.concatenate([part.slip for part in parts]),
        methods={name: np.concatenate([part.methods[name] for part in parts]) for name in parts[0].methods},
        ranks=np.concatenate([part.ranks for part in parts]),
        intervals=np.concatenate([part.intervals for part in parts]),
    )


def _chunk(count: int, case: Case, rng: np.random.Generator, estimator: PosteriorEstimator) -> MethodEstimates:
    wheel, drivetrain = Wheel(), Drivetrain()
    uncertainty = CalibrationUncertainty() if case.noise else CalibrationUncertainty(torque_noise_Nm=0.0)
    known = np.tile(uncertainty.deviations(), (count, 1))
    rovers = simulated_rovers.draw_rovers(count, rng, known, no_load_A=NO_LOAD_A)
    noise = simulated_rovers.table_4_noise(count) if case.noise else simulated_rovers.no_noise(count)
    measured = simulated_rovers.simulate_measurements(rovers, noise, case.instants, rng, drivetrain, wheel)
    truth = np.column_stack(
        [
            rovers.soils.cohesion_Pa,
            np.radians(rovers.soils.friction_angle_deg),
            simulated_rovers.drawbar_margins(rovers, wheel),
        ]
    )
    load, slip, torque = (x.copy() for x in (measured.load_N, measured.slip, measured.torque_Nm))
    load[:, :, case.wheels :] = np.nan
    soil_index = rovers.nearest_class if case.soil_known else None
    mixture = estimator.mixtures(reduce_windows(load, slip, torque, known, wheel.radius_m, soil_index))
    chosen = np.s_[:, :, : case.wheels]
    methods = {
        "paper": _paper(measured.load_N[chosen], slip[chosen], measured.current_A[chosen]),
        "paper_corrected": _paper(measured.load_N[chosen], slip[chosen], torque[chosen] / drivetrain.gain_Nm_per_A),
        "posterior": mixture.means(),
    }
    if case.instants * case.wheels > 2:
        methods["least_squares"] = _least_squares(rovers, measured, case.wheels, wheel)
    levels = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
    return MethodEstimates(
        truth, rovers.nearest_class, rovers.slip.mean(axis=1), methods, mixture.ranks(truth), mixture.quantiles(levels)
    )


def _paper(load_N: Array, slip: Array, current_A: Array) -> Array:
    cohesion, tangent = np.moveaxis(paper_network.estimate(load_N, slip, current_A).astype(np.float64), -1, 0)
    return np.column_stack([cohesion.mean(axis=(1, 2)), np.arctan(tangent).mean(axis=(1, 2))])


def _least_squares(
    rovers: simulated_rovers.SimulatedRovers, measured: simulated_rovers.Measurements, wheels: int, wheel: Wheel
) -> Array:
    soils = rovers.soils.per_wheel()
    angle = contact_angle(rovers.load_N, rovers.slip, wheel, soils)
    displacement = shear_displacement(angle, rovers.slip, wheel)
    shape = measured.load_N[:, :, :wheels].shape
    flat = (len(angle), -1)
    cohesion, tangent = least_squares(
        measured.load_N[:, :, :wheels].reshape(flat),
        measured.torque_Nm[:, :, :wheels].reshape(flat),
        np.broadcast_to(angle[:, None, :wheels], shape).reshape(flat),
        np.broadcast_to(displacement[:, None, :wheels], shape).reshape(flat),
        soils.shear_modulus_m,
        wheel,
    )
    return np.column_stack([cohesion, np.arctan(tangent)])


def figures(found: MethodEstimates, prefix: str) -> dict[str, float]:
    """Return root-mean-square errors, biases and coverage, over all rovers and for each class of soil."""
    out: dict[str, float] = {}
    truth = found.truth
    methods = found.methods | {"prior_mean": np.broadcast_to(truth[:, :2].mean(axis=0), (len(truth), 2))}
    for name, answer in methods.items():
        error = answer[:, :2] - truth[:, :2]
        rmse = np.sqrt(np.mean(error**2, axis=0))
        out[f"{prefix}{name}_rmse_cohesion_Pa"] = float(rmse[0])
        out[f"{prefix}{name}_rmse_friction_angle_deg"] = float(np.degrees(rmse[1]))
        out[f"{prefix}{name}_bias_cohesion_Pa"] = float(error[:, 0].mean())
        out[f"{prefix}{name}_bias_friction_angle_deg"] = float(np.degrees(error[:, 1].mean()))
    for unit in ("cohesion_Pa", "friction_angle_deg"):
        best = min(out[f"{prefix}{name}_rmse_{unit}"] for name in ("paper", "paper_corrected"))
        out[f"{prefix}ratio_to_paper_{unit}"] = out[f"{prefix}posterior_rmse_{unit}"] / best
    margin_error = found.methods["posterior"][:, 2] - truth[:, 2]
    out[f"{prefix}posterior_rmse_margin"] = float(np.sqrt(np.mean(margin_error**2)))
    out[f"{prefix}prior_mean_rmse_margin"] = float(truth[:, 2].std())
    return out | coverage(found, prefix)


def coverage(found: MethodEstimates, prefix: str) -> dict[str, float]:
    """Return the coverage of the 50 % and 90 % intervals over all rovers and for each class, and χ² of the ranks.

    Classes are defined in two ways: by the truth, and by the posterior mean (keys `_believed_…`). A calibrated
    posterior has its nominal coverage on average over soils that give the same data: over all rovers, for each class by
    posterior mean, and for each true class if the class is known. For a true class that the data do not determine, it
    does not.
    """
    out: dict[str, float] = {}
    groups = {"": np.full(len(found.truth), True)}
    groups |= {f"_{name}": found.nearest == index for index, name in enumerate(SOILS)}
    estimated = _class_by_posterior_mean(found)
    groups |= {f"_believed_{name}": estimated == index for index, name in enumerate(SOILS)}
    for column, target in enumerate(("cohesion", "friction_angle", "margin")):
        value, quantile = found.truth[:, column], found.intervals[:, column]
        for level, (low, high) in {50: (1, 3), 90: (0, 4)}.items():
            inside = (quantile[:, low] <= value) & (value <= quantile[:, high])
            for group, rows in groups.items():
                if rows.any():
                    out[f"{prefix}coverage_{level}_{target}{group}"] = float(inside[rows].mean())
        counts, _ = np.histogram(found.ranks[:, column], BINS, (0, 1))
        expected = len(value) / BINS
        # For a calibrated posterior this is distributed as χ² with BINS − 1 degrees of freedom: 19 ± 6.
        out[f"{prefix}rank_chi_squared_{target}"] = float(np.sum((counts - expected) ** 2 / expected))
    return out


def _class_by_posterior_mean(found: MethodEstimates) -> NDArray[np.intp]:
    """Return the class of Table 1 nearest to the posterior mean, in units of the prior's spread around a class."""
    soils = list(SOILS.values())
    cohesion = np.log(found.methods["posterior"][:, :1] / [soil.cohesion_Pa for soil in soils]) / LOG_STD
    angle = np.degrees(found.methods["posterior"][:, 1:2]) - [soil.friction_angle_deg for soil in soils]
    return np.argmin(cohesion**2 + (angle / ANGLE_STD_DEG) ** 2, axis=1)
