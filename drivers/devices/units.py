"""Units of objects: the factor from a raw value to SI, fixed or stated by the device in objects of its own.

A fixed unit is a number. A `StatedUnit` names the objects that state it; the master reads them while the node boots,
and the decoder takes their values from the answers on the bus, so that a replayed log gives the same as the bus did.

| unit | objects | factor |
|---|---|---|
| `rated-current-permille` | 0x6075 motor rated current [mA] | 0x6075 × 10⁻⁶ A (CiA 402: 0x6078 is per mille of it) |
| `si-unit-velocity` | 0x60A9 | prefix, numerator and denominator (CiA 303-2; 0x00B44700 is rpm) |
| `feed-constant` | 0x6092, 0x6091 where listed | 2π × 0x6092:02/0x6092:01 × 0x6091:01/0x6091:02 rad/s |
| `encoder-increments` | 0x608F | 2π × 0x608F:02/0x608F:01 rad/s |
| `process-unit` | 0x6131 unit, 0x6132 decimal digits | unit × 10^−digits (CiA 404) |
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

ObjectKey = tuple[int, int]
"""Index and sub-index of an object."""

RAD_S_PER_RPM = 2.0 * math.pi / 60.0
_STANDARD_GRAVITY = 9.80665

FIXED_UNITS = MappingProxyType(
    {
        "A": ("A", 1.0),
        "mA": ("A", 1e-3),
        "rad/s": ("rad_s", 1.0),
        "rpm": ("rad_s", RAD_S_PER_RPM),
        "mrpm": ("rad_s", 1e-3 * RAD_S_PER_RPM),
        "N": ("N", 1.0),
        "0.1 N": ("N", 0.1),
        "0.01 N": ("N", 0.01),
        "mN": ("N", 1e-3),
        "kN": ("N", 1e3),
        "kg": ("N", _STANDARD_GRAVITY),
        "g": ("N", 1e-3 * _STANDARD_GRAVITY),
        "V": ("V", 1.0),
        "0.1 V": ("V", 0.1),
        "mV": ("V", 1e-3),
        "°C": ("degC", 1.0),
        "0.1 °C": ("degC", 0.1),
        "rad": ("rad", 1.0),
        "°": ("rad", math.radians(1.0)),
        "0.01 °": ("rad", math.radians(0.01)),
        "°/s": ("rad_s", math.radians(1.0)),
        "0.01 °/s": ("rad_s", math.radians(0.01)),
        "m/s": ("m_s", 1.0),
        "mm/s": ("m_s", 1e-3),
        "0.01 mm/s": ("m_s", 1e-5),
    }
)
"""Names in `rover.toml`: the ending of the quantities that may have the unit, and the factor to SI."""

COARSEST_STEP = MappingProxyType({"A": 1.0, "rad_s": 10 * RAD_S_PER_RPM, "N": 10.0, "V": 5.0, "degC": 10.0})
"""Largest plausible step between two raw values; a larger one means a unit that was not set, or mistaken."""
SMALLEST_RANGE = MappingProxyType({"A": 0.1, "rad_s": 10 * RAD_S_PER_RPM, "N": 1.0, "V": 5.0, "degC": 20.0})
"""Smallest plausible range of an object: its highest raw value times the step."""


@dataclass(frozen=True, slots=True)
class StatedUnit:
    """A unit that the device states: `factor` of the raw values of `objects`; `dimension` ends the quantity's name.

    `factor` raises `ValueError`, with a reason, where these values state no unit.
    """

    name: str
    dimension: str
    objects: tuple[ObjectKey, ...]
    factor: Callable[[tuple[int, ...]], float]


Scale = float | StatedUnit


class UnknownUnitError(ValueError):
    """The device states no unit that can be used; the message says which object, its value and why."""


def stated_factor(unit: StatedUnit, values: tuple[int, ...]) -> float:
    """Return the factor that these raw values of `unit.objects` state.

    Raises
    ------
    UnknownUnitError
        They state none, or one that is not plausible.
    """
    stated = ", ".join(
        f"0x{index:04X}:{subindex:02X} = 0x{value:X}"
        for (index, subindex), value in zip(unit.objects, values, strict=True)
    )
    try:
        factor = unit.factor(values)
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        raise UnknownUnitError(f"{stated}: {'it is 0' if isinstance(error, ZeroDivisionError) else error}") from error
    if problem := implausible(unit.dimension, factor):
        raise UnknownUnitError(f"{stated}: {problem}")
    return factor


def implausible(dimension: str, factor: float, bits: int = 32) -> str:
    """Return why a factor cannot be right for an object of so many bits; empty where it may be."""
    coarsest, smallest = COARSEST_STEP.get(dimension), SMALLEST_RANGE.get(dimension)
    unit = dimension.replace("_", "/")
    if not math.isfinite(factor) or factor == 0:
        return f"a step of {factor:g} {unit}"
    if coarsest is not None and abs(factor) > coarsest:
        return f"one step of the raw value would be {abs(factor):.3g} {unit}"
    if smallest is not None and abs(factor) * 2 ** (bits - 1) < smallest:
        return f"all values together would cover only {abs(factor) * 2 ** (bits - 1):.3g} {unit}"
    return ""


def _rated_current(values: tuple[int, ...]) -> float:
    if not values[0]:
        raise ValueError("the rated current is 0")
    return values[0] * 1e-6


_PREFIX_SHIFT, _NUMERATOR_SHIFT, _DENOMINATOR_SHIFT = 24, 16, 8
_ANGLES = {0x10: 1.0, 0x41: math.radians(1.0), 0xB4: 2.0 * math.pi}  # CiA 303-2: rad, degree, revolution
_TIMES = {0x03: 1.0, 0x47: 60.0}  # second, minute
_FORCES = {0x21: 1.0, 0x02: _STANDARD_GRAVITY, 0x4B: 1e-3 * _STANDARD_GRAVITY}  # newton, kilogram, gram


def _si_unit(value: int) -> tuple[float, int, int]:
    """Return prefix (as a factor), numerator and denominator of a unit as CiA 303-2 codes it."""
    prefix = value >> _PREFIX_SHIFT & 0xFF
    exponent = prefix - 256 if prefix > 127 else prefix
    return 10.0**exponent, value >> _NUMERATOR_SHIFT & 0xFF, value >> _DENOMINATOR_SHIFT & 0xFF


def _si_velocity(values: tuple[int, ...]) -> float:
    prefix, numerator, denominator = _si_unit(values[0])
    if numerator not in _ANGLES or denominator not in _TIMES:
        raise ValueError("no angle per time; 0x00B44700 is rpm")
    return prefix * _ANGLES[numerator] / _TIMES[denominator]


def _feed(values: tuple[int, ...]) -> float:
    feed, shaft_turns, *gear = values
    motor_turns, geared_turns = gear or (1, 1)
    return 2.0 * math.pi * shaft_turns / feed * motor_turns / geared_turns


def _increments(values: tuple[int, ...]) -> float:
    increments, turns = values
    return 2.0 * math.pi * turns / increments


def _process(values: tuple[int, ...]) -> float:
    unit, digits = values
    prefix, numerator, denominator = _si_unit(unit)
    if numerator not in _FORCES or denominator:
        raise ValueError("no unit of force or mass; 0x00210000 is newton")
    return prefix * _FORCES[numerator] * 10.0**-digits


RATED_CURRENT = StatedUnit("rated-current-permille", "A", ((0x6075, 0),), _rated_current)
SI_VELOCITY = StatedUnit("si-unit-velocity", "rad_s", ((0x60A9, 0),), _si_velocity)
FEED_AND_GEAR = StatedUnit("feed-constant", "rad_s", ((0x6092, 1), (0x6092, 2), (0x6091, 1), (0x6091, 2)), _feed)
FEED = StatedUnit("feed-constant", "rad_s", ((0x6092, 1), (0x6092, 2)), _feed)
ENCODER = StatedUnit("encoder-increments", "rad_s", ((0x608F, 1), (0x608F, 2)), _increments)


def process_unit(channel: int, *, fixed_point: bool = True) -> StatedUnit:
    """Return the unit of a CiA 404 channel; a REAL32 process value (0x6130) has no decimal digits."""
    if fixed_point:
        return StatedUnit("process-unit", "N", ((0x6131, channel), (0x6132, channel)), _process)
    # No dimension: a floating-point number has no step that could be implausible.
    return StatedUnit("process-unit", "", ((0x6131, channel),), lambda values: _process((*values, 0)))


STATED_UNITS = MappingProxyType(
    {
        "rated-current-permille": (RATED_CURRENT,),
        "si-unit-velocity": (SI_VELOCITY,),
        "feed-constant": (FEED_AND_GEAR, FEED),
        "encoder-increments": (ENCODER,),
    }
)
"""Names in `rover.toml`; of several, the first whose objects the EDS lists."""
