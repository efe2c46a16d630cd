"""Columns that are likely in another unit than their names say, or swapped: the simulation leaves far less then."""

from __future__ import annotations

import re
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import RecordingError, SimulationError
from regolithd.calibration.mismatch.problem.covariates import quantity

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

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
    "m3_h": ((0.06, 0.0, "l/min"), (3.6, 0.0, "l/s"), (3600.0, 0.0, "m³/s")),
    "m3_s": ((1 / 3600, 0.0, "m³/h"), (1 / 60000, 0.0, "l/min"), (1e-3, 0.0, "l/s")),
    "l_min": ((1 / 0.06, 0.0, "m³/h"), (60.0, 0.0, "l/s"), (1e-3, 0.0, "ml/min")),
    "l_s": ((1 / 60, 0.0, "l/min"), (1 / 3.6, 0.0, "m³/h"), (1e3, 0.0, "m³/s")),
    "kg_s": ((1 / 3600, 0.0, "kg/h"), (1e-3, 0.0, "g/s")),
    "kg_h": ((3600.0, 0.0, "kg/s"), (1e3, 0.0, "t/h")),
    "t_h": ((1e-3, 0.0, "kg/h"), (3.6, 0.0, "kg/s")),
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
FURTHEST_STDS = 3.0
"""Standard deviations of their priors within which parameters may be the reason instead (a choice)."""
LEFT_BY_PARAMETERS = 2.0
"""What they then leave, over what the conversion leaves, up to which they are (a choice: the simulation is taken as
linear in them, and it may leave out other things)."""
BEYOND_ALL = 1e100
"""What no prediction reaches, in any unit."""
LEAST = 1e-300
"""Variance of a column that does not change."""
LEAST_TOLD = 1e-3
"""Share of a mean square below which a number says no more."""
LEAST_KNOWN = 0.2
"""Share of the readings that have to be predicted for that (a choice)."""


def notes_on_units(
    recording: Recording,
    simulation: Predictor,
    predict: Callable[[Recording], Array],
    predicted: Callable[[], Array],
    moved: Callable[[str, float], Array],
) -> Iterator[str]:
    """Yield a note on the column that is likely in another unit, or on the two that are swapped.

    Of several mistakes that is told with which the simulation leaves least. Swaps are tried where a unit seems to be
    wrong, or the simulation is worse than the mean of what it predicts. Where parameters within their priors explain as
    much, nothing is told.

    `predict` runs the simulation as it is stated; `predicted` returns what it predicts from the readings as they are,
    and `moved` the same with another value of a parameter.

    Raises
    ------
    RecordingError
        Where the simulation, from the readings as they are, is worse than the mean of what it predicts, or that is in
        another unit.
    """
    measured, channel = recording.channel(simulation.channel), simulation.channel
    if not np.isfinite(measured).any():
        return
    as_read, variance = _power(measured - predicted()), float(np.nanvar(measured))
    recorded = [name for name in simulation.inputs if name in recording.channels]

    def left_by(**columns: Array) -> float:
        """Return the mean square left with these columns, over the variance of what is predicted then."""
        other = recording.with_channels(**columns)
        read = other.channel(channel)
        try:
            return _power(read - predict(other)) / max(float(np.nanvar(read)), LEAST)
        except (RecordingError, SimulationError):
            return float("inf")

    share = as_read / max(variance, LEAST)
    found = list(_other_units(recording, recorded, share, left_by)) if share > LEFT_AS_READ else []
    of_channel = list(_other_unit_predicted(channel, measured, predicted))
    found += of_channel
    useless = share > 1 or bool(of_channel)
    if share > LEFT_AS_READ:
        found += _swapped(recording, recorded, channel, share, left_by, alike=not (found or useless))
    if not found:
        return
    left, mistake, cure = min(found)
    if (
        _left_beside_parameters(measured - predicted(), simulation, predicted, moved)
        <= LEFT_BY_PARAMETERS * left * variance
    ):
        return
    told = (
        f"{mistake}: with that put right, the simulation leaves {_in_words(left / share)} of the mean square that it "
        f"leaves of {channel} now. {cure}; another column with wrong values may look like that, too"
    )
    if useless:
        raise RecordingError(told)
    yield f"{told}."


def _left_beside_parameters(
    left: Array, simulation: Predictor, predicted: Callable[[], Array], moved: Callable[[str, float], Array]
) -> float:
    """Return the mean square that least squares over the parameters leaves; infinite where one is far from its prior.

    The simulation is linearised at the priors' values, a standard deviation wide.
    """
    priors = simulation.parameters
    steps = [moved(name, prior.value + prior.std) - predicted() for name, prior in priors.items()]
    known = np.isfinite(left) & np.all([np.isfinite(step) for step in steps], axis=0)
    if not steps or not known.any():
        return float("inf")
    columns = np.stack([step[known] for step in steps], axis=1)
    changed = np.linalg.lstsq(columns, left[known], rcond=1e-6)[0]
    if np.max(np.abs(changed)) > FURTHEST_STDS:
        return float("inf")
    return float(np.mean((left[known] - columns @ changed) ** 2))


def _in_words(share: float) -> str:
    return f"{share:.1g}" if share >= LEAST_TOLD else f"less than {LEAST_TOLD:g}"


def _mistakable_unit(column: str) -> str:
    found = MISTAKABLE.fullmatch(column)
    return found[1] if found else ""


def _other_units(
    recording: Recording, inputs: Sequence[str], share: float, left_by: Callable[..., float]
) -> Iterator[tuple[float, str, str]]:
    """Yield what is left, the mistake and the cure for each input that is likely in another unit."""
    for name in inputs:
        stated = _mistakable_unit(name)
        for factor, offset, unit in CONVERSIONS.get(stated, ()):
            readings = recording.channel(name)
            left = left_by(**{name: factor * readings + offset})
            if left < LEFT_CONVERTED * share and (
                offset or factor > 1 or left < LEFT_SHRUNK * left_by(**{name: 0.0 * readings})
            ):
                cure = f"Convert the column to {stated}, or correct the simulation if it takes it so"
                yield left, f"{name} is likely in {unit}", cure


def _other_unit_predicted(
    channel: str, measured: Array, predicted: Callable[[], Array]
) -> Iterator[tuple[float, str, str]]:
    """Yield the same of the predicted column, where its readings explain nothing as they are."""
    stated, prediction, variance = _mistakable_unit(channel), predicted(), float(np.nanvar(measured))
    for factor, offset, unit in CONVERSIONS.get(stated, ()):
        left = _power(factor * measured + offset - prediction)
        if left < LEFT_PREDICTED * factor**2 * variance and _power(measured - prediction) > variance / 2:
            cure = f"Convert the column to {stated}, or correct the simulation if it predicts {unit}"
            yield left / (factor**2 * variance), f"{channel} is likely in {unit}", cure


def _swapped(
    recording: Recording,
    inputs: Sequence[str],
    channel: str,
    share: float,
    left_by: Callable[..., float],
    *,
    alike: bool,
) -> Iterator[tuple[float, str, str]]:
    """Yield the same of each pair of columns that likely have each other's readings; `alike`: only of the same unit."""
    others = [name for name in recording.channels if name not in (channel, *inputs)]
    pairs = [*combinations((channel, *inputs), 2), *product((channel, *inputs), others)]
    for one, other in pairs:
        units = {name.removeprefix(quantity(name)) for name in (one, other)}
        if alike and (len(units) > 1 or units == {""}):
            continue
        left = left_by(**{one: recording.channel(other), other: recording.channel(one)})
        if left < min(LEFT_CONVERTED * share, LEFT_PREDICTED):
            yield left, f"{one} and {other} likely have each other's readings", "Swap the names of the columns"


def _power(left: Array) -> float:
    """Return the mean square of what is known of a difference (time, wheel); infinite where hardly anything is."""
    known = np.isfinite(left) & (np.abs(left) < BEYOND_ALL)
    return float(np.mean(left[known] ** 2)) if np.mean(known) > LEAST_KNOWN else float("inf")
