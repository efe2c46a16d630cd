"""Calibration from a recording: read it, fit each wheel, plot the fits, and update the configuration's text.

Each function takes a recording (CSV or Parquet of `regolithd export`), the configuration file, and the path of a figure
or None. `rover.toml` is not written: the updated text is returned.
"""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.drivetrain.bench import procedures
from regolithd.calibration.drivetrain.bench.configuration_update import ConfigurationUpdate, set_value
from regolithd.calibration.drivetrain.bench.line_fit import BenchError
from regolithd.calibration.drivetrain.bench.plot import BrakeTest, PlottedFit, plot_brake, plot_fits, plot_radius
from regolithd.calibration.mismatch.data.recording import read_recording
from regolithd.calibration.parameters import GRAVITY_M_S2, Drivetrain, LoadCells

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from regolithd.calibration.drivetrain.bench.efficiency_fit import EfficiencyFit

    Array = NDArray[np.float64]


def load_cells(recording: Path, config: Path, plot: Path | None) -> ConfigurationUpdate:
    """Fit zero and span of the load cell of each wheel that has `weight_kg` in the recording."""
    text = config.read_text(encoding="utf-8-sig")
    table = LoadCells(**tomllib.loads(text).get("load_cells", {}))
    values = {name: list(getattr(table, name)) for name in ("zero_N", "zero_std_N", "span", "span_std")}
    messages: list[str] = []
    plotted: dict[int, PlottedFit] = {}
    for wheel, (weight, reading) in _wheels(recording, "weight_kg", "load_N"):
        found = procedures.fit_load_cell(weight, reading)
        for name, six in values.items():
            six[wheel - 1] = getattr(found, name)
        messages.append(
            f"wheel {wheel}: zero {found.zero_N:.2f} ± {found.zero_std_N:.2f} N, "
            f"span {found.span:.4f} ± {found.span_std:.4f}"
        )
        plotted[wheel] = (weight * GRAVITY_M_S2, reading, found.line)
    if plot:
        plot_fits(plot, plotted, "known load [N]", "reading [N]")
    return ConfigurationUpdate(_with_values(text, "load_cells", values), messages)


def wheels_up(recording: Path, config: Path, plot: Path | None) -> ConfigurationUpdate:
    """Fit the no-load current of each wheel that has motor speed and current in the recording."""
    text = config.read_text(encoding="utf-8-sig")
    table = _drivetrain(text)
    names = {
        "no_load_current_A": "coulomb_A",
        "no_load_current_std_A": "coulomb_std_A",
        "viscous_current_A_s_per_rad": "viscous_A_s_per_rad",
        "viscous_current_std_A_s_per_rad": "viscous_std_A_s_per_rad",
    }
    values = {name: list(getattr(table, name)) for name in names}
    messages: list[str] = []
    plotted: dict[int, PlottedFit] = {}
    for wheel, (speed, current) in _wheels(recording, "motor_speed_rad_s", "motor_current_A"):
        found = procedures.fit_no_load_current(speed, current)
        for name, field in names.items():
            values[name][wheel - 1] = getattr(found, field)
        messages.append(
            f"wheel {wheel}: {1e3 * found.coulomb_A:.1f} ± {1e3 * found.coulomb_std_A:.1f} mA, and "
            f"{1e6 * found.viscous_A_s_per_rad:.1f} ± {1e6 * found.viscous_std_A_s_per_rad:.1f} µA s/rad"
        )
        plotted[wheel] = (speed, current, found.line)
    if plot:
        plot_fits(plot, plotted, "motor speed [rad/s]", "motor current [A]")
    return ConfigurationUpdate(_with_values(text, "drivetrain", values), messages)


def brake(recording: Path, config: Path, plot: Path | None) -> ConfigurationUpdate:
    """Fit the efficiency against torque of each wheel that has `brake_torque_Nm` in the recording."""
    text = config.read_text(encoding="utf-8-sig")
    table = _drivetrain(text)
    names = ("gain_factor", "gain_factor_std", "load_loss_per_Nm", "load_loss_std_per_Nm")
    values = {name: list(getattr(table, name)) for name in names}
    messages: list[str] = []
    plotted: dict[int, BrakeTest] = {}
    ideal = table.torque_constant_Nm_per_A * table.ratio
    for wheel, (torque, current) in _wheels(recording, "brake_torque_Nm", "motor_current_A"):
        found = procedures.fit_brake(torque, current, table.gain_Nm_per_A)
        for name in names:
            values[name][wheel - 1] = getattr(found, name)
        messages += _brake_messages(wheel, found, np.abs(torque), ideal)
        plotted[wheel] = BrakeTest(np.abs(torque), np.abs(current), found, ideal)
    if plot:
        plot_brake(plot, plotted)
    return ConfigurationUpdate(_with_values(text, "drivetrain", values), messages)


def _brake_messages(wheel: int, found: EfficiencyFit, torque_Nm: Array, ideal_gain_Nm_per_A: float) -> list[str]:
    ends = np.array([torque_Nm[torque_Nm > 0].min(), torque_Nm.max()])
    share, std = (100 * each for each in found.efficiency(ends, ideal_gain_Nm_per_A))
    dependence = (
        f"changes by {-100 * found.load_loss_per_Nm:+.1f} ± {100 * found.load_loss_std_per_Nm:.1f} % for each N m"
    )
    independent = "too few torques to determine whether it depends on the torque"
    if found.load_loss_std_per_Nm > 0 and not found.load_dependent:
        independent = f"does not depend on the torque, to within {100 * found.load_loss_std_per_Nm:.1f} % for each N m"
    gain = f"gain {found.gain_factor:.3f} ± {found.gain_factor_std:.3f} of Eq. 11's"
    efficiency = (
        f"  efficiency {share[0]:.1f} ± {std[0]:.1f} % at {ends[0]:.2g} N m, {share[1]:.1f} ± {std[1]:.1f} % at "
        f"{ends[1]:.2g} N m; no-load current here {1e3 * found.no_load_A:.1f} ± {1e3 * found.no_load_std_A:.1f} mA"
    )
    return [f"wheel {wheel}: {gain}; {dependence if found.load_dependent else independent}", efficiency]


def radius(
    recording: Path, config: Path, distance_m: float, distance_std_m: float, plot: Path | None
) -> ConfigurationUpdate:
    """Take the mean radius of the wheels that turned; distance and its standard deviation in metres."""
    if distance_m <= 0:
        raise BenchError("give the distance, for example: --distance 5.03 --distance-std 0.005")
    text = config.read_text(encoding="utf-8-sig")
    ratio = _drivetrain(text).ratio
    turned = dict(_wheels(recording, "t_s", "motor_speed_rad_s"))
    found = {
        wheel: procedures.fit_radius(time, speed, ratio, distance_m, distance_std_m)
        for wheel, (time, speed) in turned.items()
    }
    mean = float(np.mean([each.radius_m for each in found.values()]))
    # The error of the distance is common to all wheels; their differences are independent errors of the mean.
    mean_std = float(np.std([each.radius_m for each in found.values()])) / np.sqrt(len(found))
    std = float(np.hypot(max(each.radius_std_m for each in found.values()), mean_std))
    messages = [
        f"wheel {wheel}: {1e3 * each.radius_m:.2f} ± {1e3 * each.radius_std_m:.2f} mm" for wheel, each in found.items()
    ]
    messages.append(f"all: {1e3 * mean:.2f} ± {1e3 * std:.2f} mm")
    if plot:
        rolled = {wheel: (time, speed / ratio) for wheel, (time, speed) in turned.items()}
        plot_radius(plot, rolled, found, procedures.RadiusFit(mean, std))
    return ConfigurationUpdate(
        set_value(set_value(text, "wheel", "radius_m", mean), "wheel", "radius_std_m", std), messages
    )


def _drivetrain(text: str) -> Drivetrain:
    return Drivetrain(**tomllib.loads(text).get("drivetrain", {}))


def _with_values(text: str, table: str, values: dict[str, list[float]]) -> str:
    for name, six in values.items():
        text = set_value(text, table, name, [float(value) for value in six])
    return text


def _wheels(recording: Path, *names: str) -> Iterator[tuple[int, tuple[Array, ...]]]:
    """Yield the number of each wheel with its columns, restricted to rows in which all of them are finite."""
    found = read_recording(recording)
    time = np.repeat(found.time_s[:, None], len(found.wheels), axis=1)
    channels = [time if name == "t_s" else found.channel(name) for name in names]
    any_wheel = False
    for column, wheel in enumerate(found.wheels):
        rows = np.all([np.isfinite(channel[:, column]) for channel in channels], axis=0)
        if rows.sum() > 2:
            any_wheel = True
            yield int(wheel), tuple(channel[rows, column] for channel in channels)
    if not any_wheel:
        raise BenchError(f"{recording} has no wheel with {' and '.join(names)}")
