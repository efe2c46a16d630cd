"""How the daemon reads the ground of a drive, instant by instant, beside what the ground really is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.closed_loop.drive import START_NS, estimates

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.daemon.closed_loop.drive import Driven
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.terrain_network import Network

    Array = NDArray[np.float64]

UNLOCKING_A = 1e-9
UNITS = ("cohesion_kPa", "friction_angle_deg")


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """Cohesion [kPa] and friction angle [°], in this order along the last axis; NaN where nothing is said.

    Attributes
    ----------
    time_s
        Shape (instants,).
    truth
        Shape (instants, 2): mean over the six wheels.
    settled
        Shape (instants,): the window and all wheels are on one soil.
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


def read(driven: Driven, configuration: Configuration, network: Network) -> Reading:
    """Let the daemon with this configuration read a drive."""
    made = list(estimates(driven, asked(configuration), network))
    truth = driven.truth[: len(made)]
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
    mean, low, high = _for_people(np.array(posteriors).reshape(-1, 3, 2)).transpose(1, 0, 2)
    points = np.array([[each.cohesion_Pa, each.friction_angle_rad] for each in made])
    valid = np.array([each.valid for each in made])
    count = valid.sum(axis=1)[:, None]
    six = np.where(valid[:, None], points, 0.0).sum(axis=2) / np.maximum(count, 1)
    return Reading(
        time_s=np.array([(each.snapshot.time_ns - START_NS) / 1e9 for each in made]),
        truth=_for_people(np.array([[each.cohesion_Pa.mean(), each.friction_angle_rad.mean()] for each in truth])),
        settled=_settled([each.soils for each in truth], configuration),
        mean=mean,
        low=low,
        high=high,
        network=_for_people(np.where(count > 0, six, np.nan)),
    )


def asked(configuration: Configuration) -> Configuration:
    """Return a configuration that makes the posterior speak.

    Without a known no-load current the daemon withholds it, for the very reason that is shown here. A nanoampere
    changes no number and makes it say what it would have said.
    """
    drivetrain = configuration.drivetrain
    if any(drivetrain.no_load_current_A):
        return configuration
    unlocked = drivetrain.model_copy(update={"no_load_current_A": (UNLOCKING_A,) * 6})
    return configuration.model_copy(update={"drivetrain": unlocked})


def _for_people(values: Array) -> Array:
    """Return kPa and degrees for pascal and radians along the last axis."""
    return values * np.array([1e-3, 180 / np.pi])


def _settled(soils: list[tuple[str, ...]], configuration: Configuration) -> NDArray[np.bool_]:
    """Return where all wheels have been on one soil for as long as the posterior looks back."""
    window = round(configuration.posterior.window_s * configuration.sync.rate_Hz) + 1
    alike = np.array([len(set(names)) == 1 for names in soils])
    recent = np.convolve(alike, np.ones(window))[: len(alike)]
    return recent >= window


def figures(reading: Reading) -> dict[str, float]:
    """Return errors against the truth where the reading is settled, as flat names."""
    at = reading.settled & np.isfinite(reading.mean).all(axis=1) & np.isfinite(reading.network).all(axis=1)
    found: dict[str, float] = {"instants": float(at.sum())}
    truth = reading.truth[at]
    for who, said in (("posterior", reading.mean[at]), ("network", reading.network[at])):
        error = said - truth
        for k, unit in enumerate(UNITS):
            found[f"{who}_rmse_{unit}"] = float(np.sqrt(np.mean(error[:, k] ** 2)))
            found[f"{who}_bias_{unit}"] = float(np.mean(error[:, k]))
    inside = (reading.low[at] <= truth) & (truth <= reading.high[at])
    for k, unit in enumerate(UNITS):
        found[f"posterior_coverage_90_{unit}"] = float(np.mean(inside[:, k]))
    return found
