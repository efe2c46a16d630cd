"""Units that devices state: the factor to SI, and what is refused."""

from __future__ import annotations

import math

import pytest

from regolithd.drivers.devices.units import (
    ENCODER,
    FEED,
    FEED_AND_GEAR,
    FIXED_UNITS,
    RAD_S_PER_RPM,
    RATED_CURRENT,
    SI_VELOCITY,
    StatedUnit,
    UnknownUnitError,
    implausible,
    process_unit,
    stated_factor,
)


@pytest.mark.parametrize(
    ("unit", "values", "factor"),
    [
        (RATED_CURRENT, (2500,), 2.5e-3),  # per mille of 2500 mA
        (SI_VELOCITY, (0x00B44700,), RAD_S_PER_RPM),  # revolutions per minute
        (SI_VELOCITY, (0xFDB44700,), 1e-3 * RAD_S_PER_RPM),  # thousandths of them
        (SI_VELOCITY, (0x00100300,), 1.0),  # radians per second
        (SI_VELOCITY, (0xFD410300,), math.radians(1e-3)),  # thousandths of a degree per second
        (ENCODER, (4096, 1), 2 * math.pi / 4096),
        (FEED, (3600, 1), 2 * math.pi / 3600),
        (FEED_AND_GEAR, (3600, 1, 14, 1), 14 * 2 * math.pi / 3600),  # at the motor, 14 turns before the shaft's one
        (process_unit(1), (0x00210000, 2), 0.01),  # newtons with two decimal digits
        (process_unit(1), (0x03210000, 3), 1.0),  # kilonewtons with three
        (process_unit(1), (0x00020000, 3), 9.80665e-3),  # grams
        (process_unit(1, fixed_point=False), (0x00210000,), 1.0),
        (process_unit(1, fixed_point=False), (0x03210000,), 1e3),  # a floating-point number in kilonewtons
    ],
)
def test_the_factor_follows_from_what_the_device_states(
    unit: StatedUnit, values: tuple[int, ...], factor: float
) -> None:
    """One raw value is this much in SI units."""
    assert stated_factor(unit, values) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "values", "said"),
    [
        (RATED_CURRENT, (0,), "0x6075:00 = 0x0: the rated current is 0"),
        (RATED_CURRENT, (4_000_000_000,), "one step of the raw value would be 4e+03 A"),
        (ENCODER, (1, 1), "0x608F:01 = 0x1, 0x608F:02 = 0x1: one step of the raw value would be 6.28 rad/s"),
        (ENCODER, (0, 1), "it is 0"),
        (FEED, (0, 1), "it is 0"),
        (SI_VELOCITY, (0x00B50300,), "no angle per time; 0x00B44700 is rpm"),
        (SI_VELOCITY, (0x80B44700,), "all values together would cover only"),
        (process_unit(2), (0x00220000, 0), "0x6131:02 = 0x220000, 0x6132:02 = 0x0: no unit of force or mass"),
        (process_unit(1), (0x03210000, 0), "one step of the raw value would be 1e+03 N"),
    ],
)
def test_a_unit_that_is_not_set_or_absurd_is_refused(unit: StatedUnit, values: tuple[int, ...], said: str) -> None:
    """The message has the objects, their values and the reason."""
    with pytest.raises(UnknownUnitError) as caught:
        stated_factor(unit, values)
    assert said in str(caught.value)


def test_every_named_unit_is_plausible_in_sixteen_bits_or_more() -> None:
    """No unit that `rover.toml` may name is refused for an object of 32 bits."""
    assert {
        name: implausible(end, factor) for name, (end, factor) in FIXED_UNITS.items() if implausible(end, factor)
    } == {"kN": "one step of the raw value would be 1e+03 N"}


@pytest.mark.parametrize("bits", [8, 16, 32])
@pytest.mark.parametrize(("dimension", "step", "reach"), [("A", 1.0, 0.1), ("N", 10.0, 1.0), ("degC", 10.0, 20.0)])
def test_a_unit_is_implausible_by_its_step_or_by_its_range(
    dimension: str, step: float, reach: float, bits: int
) -> None:
    """A raw value reaches 2 to the power of one bit less than it has; the sign of the factor is that of the wiring."""
    finest = reach / 2 ** (bits - 1)
    for sign in (1, -1):
        assert implausible(dimension, sign * step, bits) == ""
        assert implausible(dimension, sign * step * 1.01, bits).startswith("one step of the raw value would be")
        assert implausible(dimension, sign * finest, bits) == ""
        told = implausible(dimension, sign * finest * 0.99, bits)
        assert told == f"all values together would cover only {0.99 * reach:.3g} {dimension}"
    assert implausible(dimension, 0.0, bits) == f"a step of 0 {dimension}"
    assert implausible(dimension, float("inf"), bits) == f"a step of inf {dimension}"


def test_a_quantity_without_limits_has_any_unit_that_is_not_zero() -> None:
    """Its name ends in a unit that is shown with a slash."""
    assert implausible("m_s", 1e-30) == ""
    assert implausible("m_s", float("nan")) == "a step of nan m/s"


PREFIXES = {"": 1.0, "m": 1e-3, "k": 1e3, "0.1 ": 0.1, "0.01 ": 0.01}
NAMED = {
    "A": ("A", 1.0, ("", "m")),
    "rad/s": ("rad_s", 1.0, ("",)),
    "rpm": ("rad_s", math.tau / 60, ("", "m")),
    "N": ("N", 1.0, ("", "0.1 ", "0.01 ", "m", "k")),
    "g": ("N", 9.80665e-3, ("", "k")),
    "V": ("V", 1.0, ("", "0.1 ", "m")),
    "°C": ("degC", 1.0, ("", "0.1 ")),
    "rad": ("rad", 1.0, ("",)),
    "°": ("rad", math.pi / 180, ("", "0.01 ")),
    "°/s": ("rad_s", math.pi / 180, ("", "0.01 ")),
    "m/s": ("m_s", 1.0, ("",)),
    "mm/s": ("m_s", 1e-3, ("", "0.01 ")),
}


def test_a_named_unit_has_its_factor_to_si() -> None:
    """Prefix times unit; a kilogram is its weight at standard gravity."""
    expected = {
        f"{prefix}{unit}": (ending, pytest.approx(PREFIXES[prefix] * factor))
        for unit, (ending, factor, prefixes) in NAMED.items()
        for prefix in prefixes
    }
    assert dict(FIXED_UNITS) == expected
