"""The two ONNX models that the pipeline runs, each read from its file once: terrain network and posterior network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.calibration.models import POSTERIOR_MODEL, TERRAIN_MODEL
from regolithd.calibration.models.onnx_session import ModelError
from regolithd.calibration.posterior.estimator import PosteriorEstimator, PosteriorModelError
from regolithd.daemon.pipeline.terrain_network import AbsentTerrainNetwork, TerrainNetwork

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration

RADIUS_TOLERANCE = 0.02
"""Relative: a wheel that differs by more from the one that the posterior network was trained for needs its own."""


@dataclass(frozen=True, slots=True)
class OnnxModels:
    """The models of one rover.

    `posterior` is None where no posterior is to be computed. `problem` says which model cannot be used, and why; empty
    where both can.
    """

    terrain: TerrainNetwork | AbsentTerrainNetwork
    posterior: PosteriorEstimator | None
    problem: str = ""


def load_models(configuration: Configuration) -> OnnxModels:
    """Return the models that a configuration names.

    Raises
    ------
    ModelError
        A file is missing, damaged, or does not fit this rover.
    """
    return OnnxModels(load_terrain_network(configuration), load_posterior(configuration))


def load_usable_models(configuration: Configuration) -> OnnxModels:
    """Return the models that a configuration names, without those that cannot be used; `problem` says why."""
    problems: list[str] = []
    terrain: TerrainNetwork | AbsentTerrainNetwork = AbsentTerrainNetwork()
    posterior = None
    try:
        terrain = load_terrain_network(configuration)
    except ModelError as error:
        problems.append(str(error))
    try:
        posterior = load_posterior(configuration)
    except ModelError as error:
        problems.append(str(error))
    return OnnxModels(terrain, posterior, " ".join(problems))


def load_terrain_network(configuration: Configuration) -> TerrainNetwork:
    """Return the network of `[estimator] model`, or the one that comes with regolithd; may raise `ModelError`."""
    return TerrainNetwork(configuration.estimator.model or TERRAIN_MODEL)


def load_posterior(configuration: Configuration) -> PosteriorEstimator | None:
    """Return the posterior network, or None where it is switched off or the no-load current is not calibrated.

    Raises
    ------
    ModelError
        The posterior network cannot be used, or (`PosteriorModelError`) was trained for another wheel.
    """
    settings = configuration.posterior
    if not settings.enabled or not any(configuration.drivetrain.no_load_current_A):
        return None
    path = settings.model or POSTERIOR_MODEL
    estimator = PosteriorEstimator(path)
    radius_m = configuration.wheel.radius_m
    if abs(radius_m / estimator.radius_m - 1) > RADIUS_TOLERANCE:
        raise PosteriorModelError(
            f"{path}: trained for wheels of {estimator.radius_m} m radius, not {radius_m} m. "
            "Train one for this rover (`regolithd train-posterior`), or set [posterior] enabled = false."
        )
    return estimator
