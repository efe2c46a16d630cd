"""Checks the ONNX models: whether they load, fit this rover, and run."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from regolithd.calibration.models.onnx_session import ModelError
from regolithd.calibration.parameters import GRAVITY_M_S2
from regolithd.daemon.check.finding import Finding, good, warning, wrong
from regolithd.daemon.pipeline.onnx_models import load_posterior, load_terrain_network

if TYPE_CHECKING:
    from regolithd.calibration.models.card import ModelCard
    from regolithd.daemon.config.configuration import Configuration


async def check_models(configuration: Configuration) -> list[Finding]:
    """Load both models, run the terrain network once, and compare them with the rover."""
    return [await _check_network(configuration), await _check_posterior(configuration)]


async def _check_network(configuration: Configuration) -> Finding:
    try:
        network = await asyncio.to_thread(load_terrain_network, configuration)  # it reads a file and runs the network
    except ModelError as error:
        return wrong("model", str(error), "")
    return judge_card(network.card, configuration)


async def _check_posterior(configuration: Configuration) -> Finding:
    try:
        posterior = await asyncio.to_thread(load_posterior, configuration)
    except ModelError as error:
        return wrong("posterior", str(error), "")
    return judge_posterior(configuration, there=posterior is not None)


def judge_posterior(configuration: Configuration, *, there: bool) -> Finding:
    """Return whether there will be a posterior, and soil-change alarms."""
    if there:
        return good("posterior", f"intervals from the last {configuration.posterior.window_s:g} s of all wheels")
    if not configuration.posterior.enabled:
        return good("posterior", "switched off: no posterior, and no soil-change alarm")
    text = "[drivetrain] no_load_current_A is not calibrated: no posterior, and no soil-change alarm"
    return warning("posterior", text, "`regolithd calibrate wheels-up` measures it.")


def judge_card(card: ModelCard, configuration: Configuration) -> Finding:
    """Return whether the terrain network was trained for loads like this rover's."""
    inputs = ", ".join(f"{each.name} {each.low:.4g} to {each.high:.4g} {each.unit}" for each in card.inputs)
    share = configuration.rover.mass_kg * GRAVITY_M_S2 / 6
    for each in card.inputs:
        if each.name == "load_N" and not each.low <= share <= each.high:
            trained = f"{each.low:.3g} to {each.high:.3g} N"
            text = (
                f"{card.version}: a sixth of the rover's weight is {share:.0f} N, the network was trained for {trained}"
            )
            return warning(
                "model",
                text,
                "Every estimate will be marked as outside the training range: train one for this rover.",
            )
    return good("model", f"{card.version}; {inputs}")
