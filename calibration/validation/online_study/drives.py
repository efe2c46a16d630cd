"""Sound drives as the sequential test gets them, with other noise, and with drag that begins half way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.recording import Recording
from regolithd.calibration.mismatch.online.linearised import Linearised, learned
from regolithd.calibration.mismatch.online.pieces import Cutter
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.calibration.validation.blind_trials.recordings.generator import (
    Plan,
    rover_traverse,
    simulation_tables,
    true_model,
    with_noise,
)
from regolithd.calibration.validation.blind_trials.recordings.traverse import KINDS

if TYPE_CHECKING:
    from numpy.random import Generator

    from regolithd.calibration.mismatch.online.pieces import Piece
    from regolithd.calibration.mismatch.online.sums import Interval
    from regolithd.calibration.mismatch.online.thresholds import OnlineThresholds
    from regolithd.calibration.mismatch.simulation.simulation import Simulation
    from regolithd.calibration.validation.blind_trials.recordings.generator import Trial

Array = NDArray[np.float64]
STEP_S = 0.5
"""Time between snapshots: the daemon's rate by default."""


@dataclass(frozen=True, eq=False)
class SoundDrive:
    """A drive with nothing concealed.

    Attributes
    ----------
    trial: as measured
    true_current_A: without noise, shape (time, 6)
    linearised, intervals: as `regolithd monitor` computes them
    """

    trial: Trial
    true_current_A: Array
    linearised: Linearised
    intervals: tuple[Interval, ...]

    @cached_property
    def simulation(self) -> Simulation:
        """The simulation that the drive is compared with."""
        return load_simulation(self.trial.tables)

    def with_current(self, current_A: Array) -> tuple[Interval, ...]:
        """Return the intervals with another measured current, shape (time, 6), and the same columns."""
        change = current_A - self.trial.current_A
        step = round(1 / STEP_S)
        found = []
        for each in self.intervals:
            first = round(each.start_s * step)
            here = change[first : first + len(each.residual)]
            found.append(replace(each, residual=each.residual + np.where(each.mask, here, 0.0)))
        return tuple(found)

    def dragging(self, wheel: int, share: float, onset_s: float) -> Array:
        """Return the measured current with constant drag on a wheel from an onset on: a share of the mean current."""
        traverse = self.trial.traverse
        drag = np.zeros(self.true_current_A.shape)
        drag[:, wheel - 1] = share * self.trial.mean_current_A * traverse.rotation[:, wheel - 1]
        return self.trial.current_A + drag * (traverse.t_s >= onset_s)[:, None]

    def recording(self, current_A: Array) -> Recording:
        """Return the whole recording with a measured current, for the offline comparison."""
        recording = recording_of(self.trial)
        return recording.with_channels(motor_current_A=current_A)


def sound_drive(seed: int, number: int, duration_s: float, thresholds: OnlineThresholds) -> SoundDrive:
    """Return a drive of a seed and number: soil, rover, way, noise and errors are its own."""
    rng = np.random.default_rng([seed, number])
    tables = simulation_tables(rng)
    kind = str(rng.choice(list(KINDS)))
    traverse = rover_traverse(rng, kind, tables, duration_s, STEP_S)
    model = true_model(rng, tables, traverse)
    trial = with_noise(rng, Plan(number, seed, "nothing", ()), model, tables, ())
    pieces = list(pieces_of(recording_of(trial), thresholds.interval_s))
    first, rest = pieces[: thresholds.learning_intervals], pieces[thresholds.learning_intervals :]
    linearised, intervals = learned(first, load_simulation(tables))
    for before, piece in zip([first[-1], *rest], rest, strict=False):
        intervals.append(linearised.interval(piece, before))
    return SoundDrive(trial, model.current_A, linearised, tuple(intervals))


def other_noise(rng: Generator, drive: SoundDrive) -> Array:
    """Return the measured current with other noise: the drive's own, moved by a random time and put on other wheels.

    Moved cyclically by at least a tenth of the drive: strength and correlation are exactly those of the drive.
    """
    noise = drive.trial.current_A - drive.true_current_A
    length = len(noise)
    moved = [np.roll(noise[:, wheel], rng.integers(length // 10, length - length // 10)) for wheel in range(6)]
    order, signs = rng.permutation(6), rng.choice([-1.0, 1.0], 6)
    return drive.true_current_A + np.stack([signs[k] * moved[order[k]] for k in range(6)], axis=1)


def recording_of(trial: Trial) -> Recording:
    """Return a trial as a recording, without a way over a file."""
    traverse = trial.traverse
    gears = float(trial.tables["drivetrain"]["planetary_ratio"]) * float(trial.tables["drivetrain"]["harmonic_ratio"])
    body = {name: getattr(trial, name) for name in ("pitch_rad", "roll_rad", "yaw_rate_rad_s")}
    channels = {
        "motor_current_A": trial.current_A,
        "motor_speed_rad_s": traverse.wheel_speed_rad_s * gears,
        "load_N": trial.load_N,
        "ground_speed_m_s": trial.ground_speed_m_s,
        "motor_temperature_degC": trial.temperature_degC,
        **{name: np.repeat(values[:, None], 6, axis=1) for name, values in body.items()},
    }
    return Recording(traverse.t_s, np.zeros(len(traverse.t_s), np.int64), (1, 2, 3, 4, 5, 6), channels)


def pieces_of(recording: Recording, interval_s: float) -> list[Piece]:
    """Return a recording cut into pieces."""
    wheels = np.array(recording.wheels, np.float64)
    rows = {name: values.ravel() for name, values in recording.channels.items()}
    rows["t_s"] = np.repeat(recording.time_s, len(wheels))
    rows["wheel"] = np.tile(wheels, len(recording.time_s))
    cutter = Cutter(interval_s, "wheel")
    return [*cutter.add(rows), *cutter.rest()]
