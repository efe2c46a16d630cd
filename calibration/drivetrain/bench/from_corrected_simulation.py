"""Calibration from a simulation that `regolithd mismatch --corrected` wrote: its drivetrain goes into `rover.toml`.

| in the corrected simulation | in `rover.toml` |
|---|---|
| `[drivetrain]` friction, gain factor, load loss, with standard deviations | copied |
| effect `viscous-friction` of a power other than 1 | the nearest straight line over the rover's range of speeds |
| effect `load-dependent-efficiency` of power 0 (independent of the torque) | gain factor and no-load current |
| any other effect | not copied: the daemon has no such term, and a message messages so |
"""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Any

import numpy as np

from regolithd.calibration.drivetrain.bench.configuration_update import ConfigurationUpdate, set_value
from regolithd.calibration.drivetrain.bench.line_fit import BenchError
from regolithd.calibration.parameters import Drivetrain, Wheel

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

EQUATION_11_CONSTANTS = (
    *("torque_constant_Nm_per_A", "planetary_ratio", "planetary_efficiency", "harmonic_ratio", "harmonic_efficiency"),
)
COPIED = (
    *("no_load_current_A", "no_load_current_std_A", "viscous_current_A_s_per_rad", "viscous_current_std_A_s_per_rad"),
    *("gain_factor", "gain_factor_std", "load_loss_per_Nm", "load_loss_std_per_Nm"),
)
SLOWEST_RAD_S, SPEED_LIMIT_M_S = 0.05, 0.05
"""Lowest wheel speed [rad/s] and highest ground speed [m/s] of the line, if the configuration does not set them."""
RELATIVE_TOLERANCE = 1e-9
"""Relative difference up to which two constants are taken as equal."""


def copy_drivetrain(simulation: Path, config: Path) -> ConfigurationUpdate:
    """Return the configuration's text with the drivetrain of a corrected simulation.

    Raises
    ------
    BenchError
        The constants of Eq. 11 differ between the two, or the simulation has no drivetrain.
    """
    found = tomllib.loads(simulation.read_text(encoding="utf-8-sig"))
    text = config.read_text(encoding="utf-8-sig")
    rover = tomllib.loads(text)
    if "drivetrain" not in found:
        raise BenchError(f"{simulation} has no [drivetrain]: it is no simulation of this rover")
    theirs, ours = Drivetrain(**found["drivetrain"]), Drivetrain(**rover.get("drivetrain", {}))
    if other := [
        name
        for name in EQUATION_11_CONSTANTS
        if abs(getattr(theirs, name) / getattr(ours, name) - 1) > RELATIVE_TOLERANCE
    ]:
        raise BenchError(
            f"{simulation} and {config} differ in {', '.join(other)}: give them the same constants of Eq. 11 first"
        )
    values = {name: np.array(getattr(theirs, name)) for name in COPIED}
    messages = []
    for effect in found.get("effects", []):
        messages += _add_effect(values, effect, ours.ratio, _speeds(rover))
    for name in COPIED:
        if not np.allclose(values[name], getattr(ours, name), rtol=RELATIVE_TOLERANCE, atol=0):
            text = set_value(text, "drivetrain", name, _compact(values[name]))
            messages.append(f"{name}: {_formatted(np.array(getattr(ours, name)))} → {_formatted(values[name])}")
    if theirs.gain_relative_std != ours.gain_relative_std:
        text = set_value(text, "drivetrain", "gain_relative_std", theirs.gain_relative_std)
        messages.append(f"gain_relative_std: {ours.gain_relative_std:g} → {theirs.gain_relative_std:g}")
    return ConfigurationUpdate(text, messages or ["The configuration already has this drivetrain: nothing to write."])


def _add_effect(values: dict[str, Array], effect: Mapping[str, Any], ratio: float, speeds: Array) -> list[str]:
    """Add an effect of the simulation to the drivetrain's values, in place; return the messages about it."""
    if effect["name"] == "load-dependent-efficiency" and effect["shape"].get("power") == 0:
        return _add_proportional_loss(values, effect)
    if effect["name"] != "viscous-friction":
        return [f"{effect['name']} stays in the simulation: the daemon has no such term."]
    power = float(effect["shape"]["power"])
    drag = float(effect["coefficients"][0]) * speeds**power
    constant, slope = _line(speeds, drag)
    worst = float(np.max(np.abs(constant + slope * speeds - drag)))
    on = np.isin(np.arange(1, 7), effect["wheels"])
    values["no_load_current_A"] = np.maximum(values["no_load_current_A"] + constant * on, 0.0)
    values["viscous_current_A_s_per_rad"] = values["viscous_current_A_s_per_rad"] + slope / ratio * on
    share = float(effect.get("relative_std", 0.0))
    for name, std in (
        ("no_load_current_std_A", abs(constant)),
        ("viscous_current_std_A_s_per_rad", slope / ratio),
    ):
        values[name] = np.hypot(values[name], share * std * on)
    message = (
        f"viscous-friction of power {power:.2f}: a straight line from {speeds[0]:.2g} to {speeds[-1]:.2g} rad/s at the "
        f"wheel, which differs from it by {1e3 * worst:.1f} mA at most."
    )
    return [message]


def _add_proportional_loss(values: dict[str, Array], effect: Mapping[str, Any]) -> list[str]:
    """Add a loss that is the same share a of the current at every torque: I (1 + a), including the no-load current."""
    share, std = float(effect["coefficients"][0]), float(effect.get("relative_std", 0.0))
    factor = 1 + share * np.isin(np.arange(1, 7), effect["wheels"])
    for name in ("no_load_current_A", "viscous_current_A_s_per_rad"):
        values[name] = values[name] * factor
    values["gain_factor"] = values["gain_factor"] / factor
    std_of_loss = values["gain_factor"] * std * np.abs(factor - 1) / factor
    values["gain_factor_std"] = np.hypot(values["gain_factor_std"], std_of_loss)
    return [f"load-dependent-efficiency of power 0: {100 * share:+.1f} % of the current."]


def _line(speeds: Array, drag: Array) -> tuple[float, float]:
    """Return constant and slope of the least-squares line; the slope is at least zero."""
    design = np.column_stack([np.ones_like(speeds), speeds])
    (constant, slope), *_ = np.linalg.lstsq(design, drag, rcond=None)
    return float(constant), max(float(slope), 0.0)


def _speeds(rover: Mapping[str, Any]) -> Array:
    """Return wheel speeds [rad/s] from the standstill threshold to the speed limit of the configuration."""
    fastest = rover.get("control", {}).get("speed_limit_m_s", SPEED_LIMIT_M_S)
    slowest = rover.get("slip", {}).get("standstill_rad_s", SLOWEST_RAD_S)
    radius = Wheel(**rover.get("wheel", {})).radius_m
    return np.linspace(slowest, max(fastest / radius, 2 * slowest), 50)


def _compact(six: Array) -> float | list[float]:
    return float(six[0]) if np.ptp(six) == 0 else [float(value) for value in six]


def _formatted(six: Array) -> str:
    return f"{six[0]:.4g}" if np.ptp(six) == 0 else "[" + ", ".join(f"{value:.4g}" for value in six) + "]"
