"""Draw the demo's drive: torque of six wheels, cohesion and friction angle, estimated and true."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

    from regolithd.calibration.posterior.estimator import Interval
    from regolithd.daemon.pipeline.snapshot import Array, Estimate
    from regolithd.daemon.simulator.virtual_rover import GroundTruth

# Front, middle, rear in three hues; left solid, right dashed.
COLOURS = ("#0b6e99", "#0b6e99", "#c4622d", "#c4622d", "#4a7c3a", "#4a7c3a")
STYLES = ("-", "--") * 3
NAMES = ("1 front left", "2 front right", "3 middle left", "4 middle right", "5 rear left", "6 rear right")
POSTERIOR_COLOUR = "#7b4b94"

Records = list[tuple["Estimate", "GroundTruth"]]


def draw(records: Records, path: Path, *, paper: bool = True) -> None:
    """Write the picture as PNG; `paper` adds what the paper's network makes of each wheel."""
    import matplotlib as mpl  # noqa: PLC0415  # only the demo has it

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415  # likewise

    figure, (torque, cohesion, angle) = plt.subplots(3, 1, figsize=(9, 8.6), sharex=True, layout="constrained")
    _torque(torque, records)
    _soil_quantity(
        cohesion,
        records,
        [estimate.cohesion_Pa / 1000 for estimate, _ in records] if paper else [],
        [truth.cohesion_Pa / 1000 for _, truth in records],
        [(estimate.posterior.cohesion_Pa if estimate.posterior else None) for estimate, _ in records],
        1e-3,
    )
    _soil_quantity(
        angle,
        records,
        [np.degrees(estimate.friction_angle_rad) for estimate, _ in records] if paper else [],
        [np.degrees(truth.friction_angle_rad) for _, truth in records],
        [(estimate.posterior.friction_angle_rad if estimate.posterior else None) for estimate, _ in records],
        float(np.degrees(1)),
    )
    cohesion.set_ylabel("cohesion c (kPa)")
    angle.set_ylabel("friction angle φ (°)")
    angle.set_xlabel("time (s)")
    cohesion.legend(ncols=4, frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0, 1.0), borderaxespad=0.1)
    for axis in (torque, cohesion, angle):
        axis.spines[["top", "right"]].set_visible(False)
        axis.grid(axis="y", alpha=0.2)
        axis.set_axisbelow(True)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _seconds(records: Records) -> Array:
    start = records[0][0].snapshot.time_ns
    return np.array([(estimate.snapshot.time_ns - start) / 1e9 for estimate, _ in records])


def _torque(axis: Axes, records: Records) -> None:
    seconds = _seconds(records)
    measured = np.stack([estimate.smoothed_torque_Nm for estimate, _ in records])
    true = np.stack([truth.torque_Nm for _, truth in records])
    true[np.isnan(measured).all(axis=1)] = np.nan
    for wheel, (colour, style, name) in enumerate(zip(COLOURS, STYLES, NAMES, strict=True)):
        axis.plot(seconds, true[:, wheel], color=colour, alpha=0.22, linewidth=4)
        axis.plot(seconds, measured[:, wheel], style, color=colour, linewidth=1.2, label=name)
    axis.set_ylabel("torque at the wheel (N·m)")
    axis.legend(ncols=3, frameon=False, fontsize=8, loc="upper right")
    soils = list(dict.fromkeys(soil for _, truth in records for soil in truth.soils))
    title = f"Six wheels drive from {' onto '.join(soils)}: estimated (thin lines), true (broad lines)"
    axis.set_title(title, loc="left", fontsize=11)


def _soil_quantity(
    axis: Axes,
    records: Records,
    alone: list[Array],
    true: list[Array],
    posteriors: list[Interval | None],
    factor: float,
) -> None:
    """Draw one soil quantity: the posterior's intervals, the paper's network and the true value of each wheel."""
    seconds = _seconds(records)
    known = [(at, interval) for at, interval in zip(seconds, posteriors, strict=True) if interval is not None]
    if known:
        at = np.array([second for second, _ in known])
        band = {
            name: factor * np.array([getattr(interval, name) for _, interval in known])
            for name in ("low_90", "low_50", "median", "high_50", "high_90")
        }
        axis.fill_between(
            at,
            band["low_90"],
            band["high_90"],
            color=POSTERIOR_COLOUR,
            alpha=0.13,
            linewidth=0,
            label="six wheels: 90 %",
        )
        axis.fill_between(
            at, band["low_50"], band["high_50"], color=POSTERIOR_COLOUR, alpha=0.22, linewidth=0, label="50 %"
        )
        axis.plot(at, band["median"], color=POSTERIOR_COLOUR, linewidth=2, label="median")
    if alone:
        axis.plot(seconds, np.stack(alone), color="#888888", linewidth=0.6, alpha=0.7)
        axis.plot([], [], color="#888888", linewidth=0.8, label="each wheel alone, the paper's network")
    for first, second, colour, name in (
        (0, 1, COLOURS[0], "front"),
        (2, 3, COLOURS[2], "middle"),
        (4, 5, COLOURS[4], "rear"),
    ):
        soil = np.mean([row[[first, second]] for row in true], axis=1)
        axis.plot(seconds, soil, color=colour, linewidth=1.5, linestyle=(0, (5, 1)), label=f"true, {name} wheels")
