"""Words and units of the user's machine: what its covariates are called, from the simulation or the columns' names."""

from __future__ import annotations

import re
from types import MappingProxyType
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
    "wheel_angle": "angle of rotation",
    "voltage": "bus voltage",
    "wheel_row": "row",
    "lagged_prediction": "past of the prediction",
    "lagged_acceleration": "past of the acceleration",
    "none": "nothing (a constant)",
}
"""Names of covariates that neither the simulation nor a column gives; the others read well as they are."""
SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
SPELLINGS = {"degC": "°C", "degF": "°F", "Nm": "N·m", "percent": "%"}
"""Units whose spelling in a column's name is not the usual one."""
QUANTITIES = {"°C": "temperature", "°F": "temperature", "K": "temperature", "V": "voltage", "bar": "pressure"}
"""What a column of this unit is, whose name need not say it: `gearbox_degC` is the gearbox's temperature."""
DIVISORS = frozenset({"s", "s2", "min", "h"})
"""Unit words that divide what stands before them: `m_s` is m/s."""
ANGULAR_SPEED = "rad/s"
"""The unit of `wheel_speed` where nothing says another: the contract's."""
UNIT_OF_ONE_WORD = re.compile(r"[^\W\d]+|°[CF]|[%°]")
"""A unit that is divided by without brackets."""
SUPERSCRIPT = re.compile("[⁰¹²³⁴⁵⁶⁷⁸⁹]")
UNIT_IN_LABEL = re.compile(r"\(([^(),]+)[^()]*\)$")
FIRST_INSTANTS = 16
"""Instants by which most columns are told apart (a choice)."""
WORD_IN_BRACES = re.compile(r"\{(\w+)\}")


def labels_of(
    stated: Mapping[str, str],
    covariates: Mapping[str, Array],
    channels: Mapping[str, Array],
    predicted: Mapping[str, Array] = MappingProxyType({}),
) -> dict[str, str]:
    """Return a label with its unit for each covariate: as stated, or as the column is called that it is.

    `predicted` has the size of the prediction, by the name of its column; its label is that stated of `torque`, if any.
    """
    found = {}
    for name, values in covariates.items():
        if (column := column_of(values, channels)) is not None and quantity(column) != column:
            found[name] = label_of_column(column)
        elif (column := column_of(values, predicted)) is not None:
            found[name] = stated.get("torque", f"predicted {label_of_column(column)}")
    return {**found, **stated}


def column_of(values: Array, channels: Mapping[str, Array]) -> str | None:
    """Return the first column that has these values, if there is one."""
    return next((column for column, read in channels.items() if _same(values, read)), None)


def _same(values: Array, read: Array) -> bool:
    if values is read or values.shape != read.shape:
        return values is read
    # Most columns differ from the first instants on, and are long.
    first = np.s_[:FIRST_INSTANTS]
    return all(np.array_equal(values[some], read[some], equal_nan=True) for some in (first, np.s_[:]))


def label_of_column(column: str) -> str:
    """Return a column's name as people write it: "carriage speed (m/s)" for `carriage_speed_m_s`."""
    name = quantity(column)
    parts = column[len(name) + 1 :].split("_") if name != column else []
    unit = ""
    for part in (part for part in parts if part != "per"):
        base, power = part.rstrip("0123456789"), part[len(part.rstrip("0123456789")) :]
        joined = "/" if part in DIVISORS else "·"
        unit += (joined if unit else "") + SPELLINGS.get(base, base) + power.translate(SUPERSCRIPTS)
    words = name.replace("_", " ")
    what = QUANTITIES.get(unit, "")
    if what[:4] not in words.lower():
        words += f" {what}"
    return words + (f" ({unit})" if unit else "")


def unit_in_label(covariate: str, labels: Mapping[str, str]) -> str:
    """Return a covariate's unit: what its label has in brackets, up to a comma.

    Empty where nothing says it, and for a pure number (1). A speed is in rad/s where nothing says it.
    """
    if covariate == "time":
        return "s"
    if covariate == "wheel_speed":
        return speed_unit(labels)
    found = UNIT_IN_LABEL.search(labels.get(covariate, ""))
    return found[1] if found and found[1] != "1" else ""


def word_for(covariate: str, labels: Mapping[str, str]) -> str:
    """Return what a covariate is called in a sentence, without its unit."""
    return labels.get(covariate, COVARIATES.get(covariate, covariate.replace("_", " "))).split(" (")[0]


def with_article(covariate: str, labels: Mapping[str, str]) -> str:
    """Return the same with its article, which time has none of: "the wind", "time"."""
    word = word_for(covariate, labels)
    return word if covariate == "time" else f"the {word}"


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
    per = {"per_speed": divided("1", speed), "per_speed2": divided("1", speed, "²")}
    above, _, below = speed.partition("/")
    per["per_acceleration"] = f"s²/{above}" if below == "s" else product(f"{below or '1'} s", divided("1", above))
    text = unit.format(unit=of_channel, speed=speed, **per)
    text = re.sub(r"\(1/([^()\s/]+)\)\^", r"1/\1^", text)  # (1/rpm)^p
    text = re.sub(r"\(1\)\^\w+", "1", text)
    return product(*text.split(" "))


def divided(unit: str, by: str, power: str = "") -> str:
    """Return one unit over another: N/m, N s²/m² (over the square of m/s), 1/K, A/V^p.

    `power` is of `by`: ², ^p, or nothing.
    """
    if by in {"", "1"}:
        return unit
    if by == unit and not power:
        return "1"
    above, slash, below = by.partition("/")
    words = (above, below) if slash else (above,)
    if not all(map(UNIT_OF_ONE_WORD.fullmatch, words)) or (power and any(map(SUPERSCRIPT.search, words))):
        return product(unit, f"1/({by}){power}")
    if not slash:
        return product(unit, f"1/{by}{power}")
    flipped = f"({below}/{above}){power}" if power.startswith("^") else f"{below}{power}/{above}{power}"
    return product(unit, flipped)


def product(*units: str) -> str:
    """Return units beside each other: A and 1/rpm are A/rpm; a 1 is left out."""
    found = ""
    for unit in units:
        if found and unit.startswith("1/"):
            found += unit[1:]
        elif unit != "1":
            found += f" {unit}" if found else unit
    return found or "1"
