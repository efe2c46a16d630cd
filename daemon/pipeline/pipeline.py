"""From CAN frames to estimates: the same code, and the same numbers, for a live bus and for a replayed log.

    chain = Chain(configuration, load_models(configuration))
    for estimate in chain.feed(frames): …

`Chain` joins decoder (frames ─▶ signals), acquisition (signals ─▶ snapshots) and `Pipeline` (snapshots ─▶ estimates):

| stage | module | in ─▶ out, each of shape (6,) |
|---|---|---|
| torque | `calibration.drivetrain.torque` | motor current and speed ─▶ wheel torque (Eq. 11) |
| smoothing | `smooth` | torque, load, measured slip ─▶ the same without momentary drops |
| slip | `slip` | measured or configured slip |
| terrain network | `terrain_network` | smoothed values ─▶ cohesion, friction angle |
| posterior | `posterior` | unsmoothed values ─▶ credible intervals for all wheels together, soil-change alarm |

An estimate depends on the snapshots so far and on nothing else, so a replay gives the same numbers to the last bit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.drivetrain.torque import wheel_torque
from regolithd.daemon.pipeline.acquire import Acquisition
from regolithd.daemon.pipeline.posterior import PosteriorStage
from regolithd.daemon.pipeline.slip import choose_slip, wheel_slip
from regolithd.daemon.pipeline.smooth import Smoother
from regolithd.daemon.pipeline.snapshot import WHEELS, Estimate
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import Reading, Sync

if TYPE_CHECKING:
    from collections.abc import Iterable

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.onnx_models import OnnxModels
    from regolithd.daemon.pipeline.snapshot import Array, Snapshot
    from regolithd.drivers.can.frame import Frame
    from regolithd.drivers.devices.decoding.signals import Signal


class Chain:
    """Decoder, acquisition and pipeline in a row; no clock, no input or output."""

    def __init__(self, configuration: Configuration, models: OnnxModels) -> None:
        nodes = configuration.described()
        self.decoder = Decoder(nodes)
        period_ns = int(1e9 / configuration.sync.rate_Hz)
        self.acquisition = Acquisition(nodes, self.decoder.expected, period_ns)
        self.pipeline = Pipeline(configuration, models)

    def feed(self, frames: Iterable[Frame]) -> list[Estimate]:
        """Take the next frames of the bus; return an estimate for each snapshot that they complete."""
        decode = self.decoder.decode
        return self.take([signal for frame in frames if (signal := decode(frame)) is not None])

    def take(self, signals: Iterable[Signal]) -> list[Estimate]:
        """Take the next decoded signals; return an estimate for each snapshot that they complete."""
        estimates = []
        for signal in signals:
            if isinstance(signal, Reading | Sync):
                snapshot = self.acquisition.accept(signal)
                if snapshot is not None:
                    estimates.append(self.pipeline.step(snapshot))
        return estimates


class Pipeline:
    """The stages after acquisition, with their state, for one rover."""

    def __init__(self, configuration: Configuration, models: OnnxModels) -> None:
        self._drivetrain = configuration.drivetrain
        self._load_zero_N = np.array(configuration.load_cells.zero_N)
        self._load_span = np.array(configuration.load_cells.span)
        self._radius_m = configuration.wheel.radius_m
        self._slip = configuration.slip
        self._terrain_network = models.terrain
        smoothing = configuration.smoothing
        rate = configuration.sync.rate_Hz
        self._smoother = Smoother(rate, smoothing.window_s, smoothing.threshold, smoothing.time_constant_s)
        self._direction = np.zeros(WHEELS)
        self._posterior = PosteriorStage(models.posterior, configuration) if models.posterior else None

    def step(self, snapshot: Snapshot) -> Estimate:
        """Return the estimate of the next snapshot."""
        speed = snapshot.motor_speed_rad_s / self._drivetrain.ratio
        direction = np.where(np.abs(speed) < self._slip.standstill_rad_s, 0.0, np.sign(speed))  # NaN stays NaN
        self._reset_reversed(direction)
        torque = wheel_torque(snapshot.motor_current_A, snapshot.motor_speed_rad_s, self._drivetrain)
        turning = np.abs(direction) == 1
        measured = wheel_slip(speed, snapshot.ground_speed_m_s, self._radius_m, turning)
        load = self._load_span * (snapshot.load_N - self._load_zero_N)
        driving = np.where(turning, torque * direction, np.nan)
        smoothed = self._smoother.step(snapshot.time_ns, driving, load, measured)
        slip, source = choose_slip(smoothed.slip, self._slip.constant, turning)
        raw_slip, sources = choose_slip(measured, self._slip.constant, turning)
        posterior, alarm = None, None
        if self._posterior:
            posterior, alarm = self._posterior.step(snapshot.time_ns, load, raw_slip, driving, sources)
        terrain = self._terrain_network.estimate(self._inputs(smoothed.torque, smoothed.load, slip, np.abs(speed)))
        return Estimate(
            snapshot=snapshot,
            wheel_torque_Nm=torque,
            smoothed_torque_Nm=smoothed.torque * direction,
            smoothed_load_N=smoothed.load,
            slip=slip,
            slip_source=source,
            cohesion_Pa=terrain.cohesion_Pa,
            friction_angle_rad=terrain.friction_angle_rad,
            valid=np.isfinite(terrain.cohesion_Pa) & np.isfinite(terrain.friction_angle_rad),
            input_names=self._terrain_network.input_names,
            outside=terrain.outside,
            model_version=self._terrain_network.card.version,
            posterior=posterior,
            soil_change=alarm,
        )

    def _reset_reversed(self, direction: Array) -> None:
        """Reset the smoothing of a wheel that stopped or reversed: its filter holds values of the other direction."""
        known = ~np.isnan(direction)
        if (changed := known & (direction != self._direction)).any():
            self._smoother.reset(changed)
            self._direction = np.where(known, direction, self._direction)

    def _inputs(self, driving_torque_Nm: Array, load_N: Array, slip: Array, speed: Array) -> dict[str, Array]:
        return {
            "load_N": load_N,
            "slip": slip,
            "motor_current_A": driving_torque_Nm / self._terrain_network.card.gain_Nm_per_A,
            "wheel_torque_Nm": driving_torque_Nm,
            "wheel_speed_rad_s": speed,
        }
