"""A corrected simulation's drivetrain into the daemon's configuration: what `regolithd mismatch --corrected` found.

Friction, gain and the loss under load have the same names in both files and are copied, with how sure they are. Viscous
friction of another power than 1 becomes the straight line nearest to it over the speeds that the rover may drive; an
efficiency that is wrong at every torque alike goes into gain and no-load current. What else was found is not the
drivetrain's, or nothing that the daemon could take out: that is said.
"""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Any

import numpy as np

from regolithd.calibration.drivetrain.bench.line import BenchError
from regolithd.calibration.drivetrain.bench.session import Written
from regolithd.calibration.drivetrain.bench.toml_edit import set_value
from regolithd.calibration.parameters import Drivetrain, Wheel

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

EQUATION_11 = (
    *("torque_constant_Nm_per_A", "planetary_ratio", "planetary_efficiency", "harmonic_ratio", "harmonic_efficiency"),
)
TAKEN = (
    *("no_load_current_A", "no_load_current_std_A", "viscous_current_A_s_per_rad", "viscous_current_std_A_s_per_rad"),
    *("gain_factor", "gain_factor_std", "load_loss_per_Nm", "load_loss_std_per_Nm"),
)
SLOWEST_RAD_S, SPEED_LIMIT_M_S = 0.05, 0.05
"""Between which speeds a straight line must fit, where the configuration does not say."""
SAME = 1e-9


def drivetrain(simulation: Path, config: Path) -> Written:
    """Return the configuration's text with the drivetrain of a corrected simulation in it.

    Raises
    ------
    BenchError
        The two do not speak of one drivetrain, or the simulation has none.
    """
    found = tomllib.loads(simulation.read_text(encoding="utf-8"))
    text = config.read_text(encoding="utf-8")
    rover = tomllib.loads(text)
    if "drivetrain" not in found:
        raise BenchError(f"{simulation} has no [drivetrain]: it is no simulation of this rover")
    theirs, ours = Drivetrain(**found["drivetrain"]), Drivetrain(**rover.get("drivetrain", {}))
    if other := [name for name in EQUATION_11 if abs(getattr(theirs, name) / getattr(ours, name) - 1) > SAME]:
        raise BenchError(f"{simulation} and {config} differ in {', '.join(other)}: make them one drivetrain first")
    values = {name: np.array(getattr(theirs, name)) for name in TAKEN}
    says = []
    for effect in found.get("effects", []):
        says += _take(values, effect, ours.ratio, _speeds(rover))
    for name in TAKEN:
        if not np.allclose(values[name], getattr(ours, name), rtol=SAME, atol=0):
            text = set_value(text, "drivetrain", name, _written(values[name]))
            says.append(f"{name}: {_told(np.array(getattr(ours, name)))} → {_told(values[name])}")
    if theirs.gain_relative_std != ours.gain_relative_std:
        text = set_value(text, "drivetrain", "gain_relative_std", theirs.gain_relative_std)
        says.append(f"gain_relative_std: {ours.gain_relative_std:g} → {theirs.gain_relative_std:g}")
    return Written(text, says or ["The drivetrain is as the configuration has it: nothing to write."])


def _take(values: dict[str, Array], effect: Mapping[str, Any], ratio: float, speeds: Array) -> list[str]:
    """Add an effect that stands beside the tables; return what there is to say of it."""
    if effect["name"] == "load-dependent-efficiency" and effect["shape"].get("power") == 0:
        return _take_proportional(values, effect)
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
    said = (
        f"viscous-friction of power {power:.2f}: a straight line from {speeds[0]:.2g} to {speeds[-1]:.2g} rad/s at the "
        f"wheel, nowhere more than {1e3 * worst:.1f} mA beside it."
    )
    return [said]


def _take_proportional(values: dict[str, Array], effect: Mapping[str, Any]) -> list[str]:
    """Take a loss that is the same share a of the current at every torque: I (1 + a), no-load current and all."""
    share, std = float(effect["coefficients"][0]), float(effect.get("relative_std", 0.0))
    more = 1 + share * np.isin(np.arange(1, 7), effect["wheels"])
    for name in ("no_load_current_A", "viscous_current_A_s_per_rad"):
        values[name] = values[name] * more
    values["gain_factor"] = values["gain_factor"] / more
    doubt = values["gain_factor"] * std * np.abs(more - 1) / more
    values["gain_factor_std"] = np.hypot(values["gain_factor_std"], doubt)
    return [f"load-dependent-efficiency that does not depend on the load: {100 * share:+.1f} % of the current."]


def _line(speeds: Array, drag: Array) -> tuple[float, float]:
    """Return constant and slope of the nearest straight line that nowhere rises towards standstill."""
    design = np.column_stack([np.ones_like(speeds), speeds])
    (constant, slope), *_ = np.linalg.lstsq(design, drag, rcond=None)
    return float(constant), max(float(slope), 0.0)


def _speeds(rover: Mapping[str, Any]) -> Array:
    """Return wheel speeds [rad/s] from standstill to the limit that the configuration sets."""
    fastest = rover.get("control", {}).get("speed_limit_m_s", SPEED_LIMIT_M_S)
    slowest = rover.get("slip", {}).get("standstill_rad_s", SLOWEST_RAD_S)
    radius = Wheel(**rover.get("wheel", {})).radius_m
    return np.linspace(slowest, max(fastest / radius, 2 * slowest), 50)


def _written(six: Array) -> float | list[float]:
    return float(six[0]) if np.ptp(six) == 0 else [float(value) for value in six]


def _told(six: Array) -> str:
    return f"{six[0]:.4g}" if np.ptp(six) == 0 else "[" + ", ".join(f"{value:.4g}" for value in six) + "]"
