"""One monitor for each channel that a simulation predicts."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.online.monitor import Monitor
from regolithd.calibration.mismatch.online.thresholds import ONLINE_THRESHOLDS, OnlineThresholds
from regolithd.calibration.mismatch.simulation.one_channel import OneChannel

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.simulation.simulation import Simulation


def monitors_of(simulation: Simulation, thresholds: OnlineThresholds = ONLINE_THRESHOLDS) -> dict[str, Monitor]:
    """Return a monitor for each channel, by name.

    With several channels each has a higher threshold, so that all together have the stated rate of false reports: the
    rate falls at least as exp(−Δχ²/2).
    """
    if not simulation.channels:
        return {simulation.channel: Monitor(simulation, thresholds)}
    raised = replace(thresholds, alarm=thresholds.alarm + 2 * float(np.log(len(simulation.channels))))
    found = {}
    for channel in simulation.channels:
        of_channel = OneChannel(simulation, channel)
        of_channel.corrected_effects = [each for each in simulation.corrected_effects if each.channel == channel]
        found[channel] = Monitor(of_channel, raised)
    return found
