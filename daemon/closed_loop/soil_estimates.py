"""Soil estimates of a simulated drive, instant by instant, beside the ground truth; errors and coverage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.closed_loop.simulated_drive import START_NS, estimates

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.daemon.closed_loop.simulated_drive import SimulatedDrive
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.terrain_network import TerrainNetwork

    Array = NDArray[np.float64]

NEGLIGIBLE_A = 1e-9
"""A no-load current above 0, too small to change an estimate; see `with_posterior_enabled`."""
UNITS = ("cohesion_kPa", "friction_angle_deg")


@dataclass(frozen=True, slots=True, eq=False)
class SoilEstimates:
    """Cohesion [kPa] and friction angle [°], in this order along the last axis; NaN where there is no estimate.

    Attributes
    ----------
    time_s
        Shape (instants,).
    truth
        Shape (instants, 2): mean over the six wheels.
    settled
        Shape (instants,): all wheels were on one soil for the posterior's whole window.
    mean, low, high
        Shape (instants, 2): the posterior's mean, and the bounds of its 90 % interval.
    network
        Shape (instants, 2): the paper's network, mean over the six wheels.
    """

    time_s: Array
    truth: Array
    settled: NDArray[np.bool_]
    mean: Array
    low: Array
    high: Array
    network: Array


def soil_estimates(drive: SimulatedDrive, configuration: Configuration, network: TerrainNetwork) -> SoilEstimates:
    """Return what the daemon with this configuration estimates over a drive."""
    made = list(estimates(drive, with_posterior_enabled(configuration), network))
    truth = drive.truth[: len(made)]
    nothing = (np.nan,) * 6
    posteriors = [
        nothing
        if (each := estimate.posterior) is None
        else tuple(
            getattr(interval, name)
            for name in ("mean", "low_90", "high_90")
            for interval in (each.cohesion_Pa, each.friction_angle_rad)
        )
        for estimate in made
    ]
    mean, low, high = _in_display_units(np.array(posteriors).reshape(-1, 3, 2)).transpose(1, 0, 2)
    points = np.array([[each.cohesion_Pa, each.friction_angle_rad] for each in made])
    valid = np.array([each.valid for each in made])
    count = valid.sum(axis=1)[:, None]
    six = np.where(valid[:, None], points, 0.0).sum(axis=2) / np.maximum(count, 1)
    return SoilEstimates(
        time_s=np.array([(each.snapshot.time_ns - START_NS) / 1e9 for each in made]),
        truth=_in_display_units(
            np.array([[each.cohesion_Pa.mean(), each.friction_angle_rad.mean()] for each in truth])
        ),
        settled=_settled([each.soils for each in truth], configuration),
        mean=mean,
        low=low,
        high=high,
        network=_in_display_units(np.where(count > 0, six, np.nan)),
    )


def with_posterior_enabled(configuration: Configuration) -> Configuration:
    """Return the configuration with a no-load current above 0, so that the daemon computes the posterior.

    Without a calibrated no-load current the daemon withholds the posterior, because its error would be large: this
    study measures that error. 1 nA changes no estimate.
    """
    drivetrain = configuration.drivetrain
    if any(drivetrain.no_load_current_A):
        return configuration
    changed = drivetrain.model_copy(update={"no_load_current_A": (NEGLIGIBLE_A,) * 6})
    return configuration.model_copy(update={"drivetrain": changed})


def _in_display_units(values: Array) -> Array:
    """Return kPa and degrees for pascal and radians along the last axis."""
    return values * np.array([1e-3, 180 / np.pi])


def _settled(soils: list[tuple[str, ...]], configuration: Configuration) -> NDArray[np.bool_]:
    """Return at which instants all wheels have been on one soil for the posterior's whole window."""
    window = round(configuration.posterior.window_s * configuration.sync.rate_Hz) + 1
    alike = np.array([len(set(names)) == 1 for names in soils])
    recent = np.convolve(alike, np.ones(window))[: len(alike)]
    return recent >= window


def figures(soil: SoilEstimates) -> dict[str, float]:
    """Return errors and coverage against the ground truth at the settled instants, by name."""
    at = soil.settled & np.isfinite(soil.mean).all(axis=1) & np.isfinite(soil.network).all(axis=1)
    found: dict[str, float] = {"instants": float(at.sum())}
    truth = soil.truth[at]
    for estimator, values in (("posterior", soil.mean[at]), ("network", soil.network[at])):
        error = values - truth
        for k, unit in enumerate(UNITS):
            found[f"{estimator}_rmse_{unit}"] = float(np.sqrt(np.mean(error[:, k] ** 2)))
            found[f"{estimator}_bias_{unit}"] = float(np.mean(error[:, k]))
    inside = (soil.low[at] <= truth) & (truth <= soil.high[at])
    for k, unit in enumerate(UNITS):
        found[f"posterior_coverage_90_{unit}"] = float(np.mean(inside[:, k]))
    return found
