"""Columns that are likely in another unit than their names say: converted, the simulation leaves far less."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import RecordingError, SimulationError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.problem.predictor import Predictor

Array = NDArray[np.float64]

CONVERSIONS: dict[str, tuple[tuple[float, float, str], ...]] = {
    "degC": ((1.0, -273.15, "K"), (5 / 9, -160 / 9, "°F")),
    "K": ((1.0, 273.15, "°C"),),
    "rad": ((np.pi / 180, 0.0, "deg"),),
    "deg": ((180 / np.pi, 0.0, "rad"),),
    "rad_s": ((np.pi / 180, 0.0, "deg/s"), (np.pi / 30, 0.0, "rpm")),
    "deg_s": ((180 / np.pi, 0.0, "rad/s"), (6.0, 0.0, "rpm")),
    "rpm": ((30 / np.pi, 0.0, "rad/s"), (60.0, 0.0, "revolutions per second")),
    "m_s": ((1 / 3.6, 0.0, "km/h"),),
    "Pa": ((100.0, 0.0, "mbar"), (1e3, 0.0, "kPa"), (1e5, 0.0, "bar")),
    "kPa": ((1e-3, 0.0, "Pa"), (0.1, 0.0, "mbar"), (100.0, 0.0, "bar")),
    "bar": ((1e-3, 0.0, "mbar"), (1e-5, 0.0, "Pa"), (1e-2, 0.0, "kPa")),
    "kg": ((1 / 9.80665, 0.0, "N"), (1e-3, 0.0, "g")),
    "N": ((9.80665, 0.0, "kg"), (1e3, 0.0, "kN")),
    "kW": ((1e-3, 0.0, "W"),),
    "W": ((1e3, 0.0, "kW"),),
    "A": ((1e-3, 0.0, "mA"),),
    "V": ((1e-3, 0.0, "mV"),),
    "m": ((1e-3, 0.0, "mm"), (1e-2, 0.0, "cm")),
    "mm": ((1e3, 0.0, "m"),),
    "percent": ((100.0, 0.0, "shares of 1"),),
    "pct": ((100.0, 0.0, "shares of 1"),),
}
"""Units at the end of a column's name, and what is mistaken for them: a reading in that is multiplied, then shifted."""
MISTAKABLE = re.compile(rf".+?_({'|'.join(CONVERSIONS)})(_\d+)?")
"""The end of such a name; a number may follow the unit."""
LEFT_AS_READ = 0.05
"""Power that the simulation leaves, over the variance of what was recorded, from which units are tried (a choice: an
input in another unit leaves a large part of it, and a recording that fits costs no further run)."""
LEFT_CONVERTED = 0.1
"""Share of that power up to which a conversion is likely (a choice: left-out physics is no change of a unit)."""
LEFT_SHRUNK = 0.5
"""Share of what the simulation leaves with the input at 0, up to which a smaller unit is likely (a choice): what the
input should not do at all, a smaller unit takes away as well."""
LEFT_PREDICTED = 0.1
"""The same of the predicted column, over its variance (a choice: converted, the simulation explains it well)."""
BEYOND_ALL = 1e100
"""What no prediction reaches, in any unit."""
LEAST_KNOWN = 0.2
"""Share of the readings that have to be predicted for that (a choice)."""


def notes_on_units(
    recording: Recording,
    simulation: Predictor,
    predict: Callable[[Recording], Array],
    predicted: Callable[[], Array],
) -> Iterator[str]:
    """Yield a note for each input that is likely in another unit.

    `predict` runs the simulation as it is stated; `predicted` returns what it predicts from the readings as they are.

    Raises
    ------
    RecordingError
        Where the simulation, from the readings as they are, is worse than the mean of what it predicts; and where that
        is in another unit.
    """
    measured, columns = recording.channel(simulation.channel), simulation.inputs
    _check_predicted(simulation.channel, measured, predicted)
    mistakable = [(name, found[1]) for name in columns if (found := MISTAKABLE.fullmatch(name))]
    recorded = [(name, unit) for name, unit in mistakable if name in recording.channels]
    if not recorded:
        return
    as_read, variance = _power(measured - predicted()), float(np.nanvar(measured))

    def left_by(name: str, factor: float, offset: float) -> float:
        converted = recording.with_channels(**{name: factor * recording.channel(name) + offset})
        try:
            return _power(measured - predict(converted))
        except (RecordingError, SimulationError):
            return float("inf")

    def likely(name: str, stated: str) -> Iterator[tuple[float, str]]:
        for factor, offset, unit in CONVERSIONS[stated]:
            left = left_by(name, factor, offset)
            if left < LEFT_CONVERTED * as_read and (
                offset or factor > 1 or left < LEFT_SHRUNK * left_by(name, 0.0, 0.0)
            ):
                yield left, unit

    for name, stated in recorded if as_read > LEFT_AS_READ * variance else ():
        left, unit = min(likely(name, stated), default=(0.0, ""))
        if not unit:
            continue
        told = (
            f"{name} is likely in {unit}: converted from that, the simulation leaves {left / as_read:.1g} of "
            f"the mean square that it leaves of {simulation.channel} now. Convert the column to {stated}, or "
            f"correct the simulation if it takes it so; another column with wrong values may look like that, too"
        )
        if as_read > variance:
            raise RecordingError(told)
        yield f"{told}."


def _check_predicted(channel: str, measured: Array, predicted: Callable[[], Array]) -> None:
    """Raise an error where the predicted column is likely in another unit: its readings explain nothing as they are."""
    stated = MISTAKABLE.fullmatch(channel)
    if stated is None or not np.isfinite(measured).any():
        return
    prediction, variance = predicted(), float(np.nanvar(measured))
    for factor, offset, unit in CONVERSIONS[stated[1]]:
        left = _power(factor * measured + offset - prediction)
        if left < LEFT_PREDICTED * factor**2 * variance and _power(measured - prediction) > variance / 2:
            raise RecordingError(
                f"{channel} is likely in {unit}: converted from that, it is predicted with an error of {left**0.5:.1g} "
                f"{stated[1]}. Convert the column to {stated[1]}, or correct the simulation if it predicts {unit}"
            )


def _power(left: Array) -> float:
    """Return the mean square of what is known of a difference (time, wheel); infinite where hardly anything is."""
    known = np.isfinite(left) & (np.abs(left) < BEYOND_ALL)
    return float(np.mean(left[known] ** 2)) if np.mean(known) > LEAST_KNOWN else float("inf")
