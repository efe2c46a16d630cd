"""Words and units of the user's machine: what its covariates are called, from the simulation or the columns' names."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.problem.covariates import quantity

if TYPE_CHECKING:
    from collections.abc import Mapping

Array = NDArray[np.float64]

COVARIATES = {
    "wheel_speed": "speed",
    "direction": "direction of motion",
    "torque": "predicted value",
    "wheel_acceleration": "acceleration",
    "wheel_angle": "angle",
    "voltage": "bus voltage",
    "wheel_row": "row",
    "none": "nothing (a constant)",
}
"""Names of covariates that neither the simulation nor a column gives; the others read well as they are."""
SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
SPELLINGS = {"degC": "°C", "degF": "°F", "Nm": "N·m", "percent": "%"}
"""Units whose spelling in a column's name is not the usual one."""
DIVISORS = frozenset({"s", "s2", "min", "h"})
"""Unit words that divide what stands before them: `m_s` is m/s."""
ANGULAR_SPEED = "rad/s"
"""The unit of `wheel_speed` where nothing says another: the contract's."""
UNIT_IN_LABEL = re.compile(r"\(([^(),]+)[^()]*\)$")
WORD_IN_BRACES = re.compile(r"\{(\w+)\}")


def labels_of(
    stated: Mapping[str, str], covariates: Mapping[str, Array], channels: Mapping[str, Array]
) -> dict[str, str]:
    """Return a label with its unit for each covariate: as stated, or as the column is called that it is."""
    found = {}
    for name, values in covariates.items():
        column = column_of(values, channels)
        if column is not None and quantity(column) != column:
            found[name] = label_of_column(column)
    return {**found, **stated}


def column_of(values: Array, channels: Mapping[str, Array]) -> str | None:
    """Return the first column that has these values, if there is one."""
    return next((column for column, read in channels.items() if _same(values, read)), None)


def _same(values: Array, read: Array) -> bool:
    return values is read or (values.shape == read.shape and np.array_equal(values, read, equal_nan=True))


def label_of_column(column: str) -> str:
    """Return a column's name as people write it: `carriage_speed_m_s` is "carriage speed (m/s)"."""
    name = quantity(column)
    parts = column[len(name) + 1 :].split("_") if name != column else []
    unit = ""
    for part in (part for part in parts if part != "per"):
        base, power = part.rstrip("0123456789"), part[len(part.rstrip("0123456789")) :]
        joined = "/" if part in DIVISORS else "·"
        unit += (joined if unit else "") + SPELLINGS.get(base, base) + power.translate(SUPERSCRIPTS)
    return name.replace("_", " ") + (f" ({unit})" if unit else "")


def unit_in_label(covariate: str, labels: Mapping[str, str]) -> str:
    """Return a covariate's unit: what its label has in brackets, up to a comma; empty where nothing says it."""
    if covariate == "time":
        return "s"
    found = UNIT_IN_LABEL.search(labels.get(covariate, ""))
    return found[1] if found else ""


def word_for(covariate: str, labels: Mapping[str, str]) -> str:
    """Return what a covariate is called in a sentence, without its unit."""
    return labels.get(covariate, COVARIATES.get(covariate, covariate.replace("_", " "))).split(" (")[0]


def in_words(text: str, labels: Mapping[str, str]) -> str:
    """Return a text with each covariate in braces, as {wheel_speed}, in the machine's own words."""
    return WORD_IN_BRACES.sub(lambda found: word_for(found[1], labels), text)


def speed_unit(labels: Mapping[str, str]) -> str:
    """Return the unit of `wheel_speed`: what is in brackets at the end of its label."""
    found = re.search(r"\(([^()]+)\)$", labels.get("wheel_speed", ""))
    return found[1] if found else ANGULAR_SPEED


def in_units(unit: str, of_channel: str, labels: Mapping[str, str]) -> str:
    """Return a coefficient's unit with the channel's and the speed's in the place of {unit}, {speed} and {per_speed}.

    {per_speed} and {per_speed2} are one over the unit of speed and its square, {per_acceleration} over that a second.
    """
    speed = speed_unit(labels)
    above, _, below = speed.partition("/")
    below = below or "1"
    if below == "s":
        per = {"per_speed": f"s/{above}", "per_speed2": f"s²/{above}²", "per_acceleration": f"s²/{above}"}
    else:
        per = {"per_speed": f"{below}/{above}", "per_speed2": f"({below}/{above})²"}
        per["per_acceleration"] = f"{below} s/{above}"
    return unit.format(unit=of_channel, speed=speed, **per)
