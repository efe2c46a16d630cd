"""The last stage: credible intervals of the soil under the rover, from the last seconds of all six wheels.

The terrain network gives a point estimate for each wheel and instant. The posterior network
(`calibration.posterior.estimator`) gives intervals for all wheels together, twice a second. There is no posterior while
the drivetrain is not calibrated: an unknown no-load current would be attributed to the soil.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.posterior.estimator import Buffer, Posterior, PosteriorEstimator
from regolithd.calibration.posterior.window import INTERVAL_S, MAX_INSTANTS, CalibrationUncertainty, REFERENCE_TORQUE_Nm
from regolithd.daemon.pipeline.snapshot import SlipSource, SoilChange
from regolithd.daemon.pipeline.soil_change import SoilChangeDetector

if TYPE_CHECKING:
    from regolithd.calibration.parameters import Drivetrain
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Array

SLIP_STD_MEASURED = 0.005
SLIP_STD_CONFIGURED = 0.03
"""Standard deviations of the slip: where the ground speed is measured, and where `[slip] constant` is used."""
HISTORY = 400
"""Number of half-second means that are kept, to compare the soil before and after a change."""


class PosteriorStage:
    """Collects half-second means and evaluates the posterior; time comes from the snapshots alone."""

    def __init__(self, estimator: PosteriorEstimator, configuration: Configuration) -> None:
        settings, drivetrain = configuration.posterior, configuration.drivetrain
        self._estimator = estimator
        self._buffer = Buffer(settings.window_s)
        self._gain_std = gain_relative_std(drivetrain)
        self._no_load_std_A = float(np.mean(drivetrain.no_load_current_std_A))
        self._no_load_A = float(np.mean(drivetrain.no_load_current_A))
        self._soil = settings.soil
        self._history: deque[Array] = deque(maxlen=HISTORY)
        self._change = SoilChangeDetector(configuration) if configuration.change.enabled else None

    def step(
        self, time_ns: int, load_N: Array, slip: Array, driving_torque_Nm: Array, sources: tuple[SlipSource, ...]
    ) -> tuple[Posterior | None, SoilChange | None]:
        """Return a posterior when a half second has ended, and an alarm when the soil has changed.

        Arrays have shape (6,), unsmoothed, NaN where a wheel stands.
        """
        if not self._buffer.add(time_ns, load_N, slip, driving_torque_Nm):
            return None, None
        window = self._buffer.window()
        if not window.size:
            return None, None
        uncertainty = self._uncertainty(sources)
        return self._estimator.estimate(window, uncertainty), self._detect_change(time_ns, window[:, -1], uncertainty)

    def _detect_change(self, time_ns: int, means: Array, uncertainty: CalibrationUncertainty) -> SoilChange | None:
        """Return the alarm, if any, with the probability that each quantity is lower since its onset than before."""
        if self._change is None:
            return None
        self._history.append(means)
        alarm = self._change.step(time_ns, *means)
        if alarm is None:
            return None
        past = np.stack(self._history, axis=1)
        since = max(1, round((alarm.time_ns - alarm.onset_ns) / (INTERVAL_S * 1e9)))
        before, after = past[:, :-since][:, -MAX_INSTANTS:], past[:, -since:][:, -MAX_INSTANTS:]
        fall = self._estimator.fall_probability(before, after, uncertainty) if before.size else None
        return SoilChange(alarm, fall)

    def _uncertainty(self, sources: tuple[SlipSource, ...]) -> CalibrationUncertainty:
        configured = SlipSource.CONFIGURED in sources
        return CalibrationUncertainty(
            gain_relative_std=self._gain_std,
            no_load_current_std_A=self._no_load_std_A,
            slip_std=SLIP_STD_CONFIGURED if configured else SLIP_STD_MEASURED,
            no_load_current_A=self._no_load_A,
            soil=self._soil,
        )


def gain_relative_std(drivetrain: Drivetrain) -> float:
    """Return the relative standard deviation of the gain at a usual torque, mean over the wheels.

    A brake test measures the whole gain: for its wheels, its standard deviation replaces that of Eq. 11's constants.
    """
    factor, std = np.array(drivetrain.gain_factor), np.array(drivetrain.gain_factor_std)
    braked = np.hypot(std / factor, REFERENCE_TORQUE_Nm * np.array(drivetrain.load_loss_std_per_Nm))
    return float(np.mean(np.where(braked > 0, braked, drivetrain.gain_relative_std)))
