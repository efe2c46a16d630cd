"""The drive as a picture: the torque of six wheels, and what they say about the ground, with the truth beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

    from regolithd.calibration.posterior.estimator import Interval
    from regolithd.daemon.pipeline.snapshot import Array, Estimate
    from regolithd.daemon.simulator.virtual_rover import Truth

# Front, middle, rear in three hues; left solid, right dashed.
COLOURS = ("#0b6e99", "#0b6e99", "#c4622d", "#c4622d", "#4a7c3a", "#4a7c3a")
STYLES = ("-", "--") * 3
NAMES = ("1 front left", "2 front right", "3 middle left", "4 middle right", "5 rear left", "6 rear right")
POSTERIOR = "#7b4b94"

Seen = list[tuple["Estimate", "Truth"]]


def draw(seen: Seen, path: Path) -> None:
    """Write the picture (PNG)."""
    import matplotlib as mpl  # noqa: PLC0415  # only the demo has it

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415  # likewise

    figure, (torque, cohesion, angle) = plt.subplots(3, 1, figsize=(9, 8.6), sharex=True, layout="constrained")
    _torque(torque, seen)
    _ground(
        cohesion,
        seen,
        [estimate.cohesion_Pa / 1000 for estimate, _ in seen],
        [truth.cohesion_Pa / 1000 for _, truth in seen],
        [(estimate.posterior.cohesion_Pa if estimate.posterior else None) for estimate, _ in seen],
        1e-3,
    )
    _ground(
        angle,
        seen,
        [np.degrees(estimate.friction_angle_rad) for estimate, _ in seen],
        [np.degrees(truth.friction_angle_rad) for _, truth in seen],
        [(estimate.posterior.friction_angle_rad if estimate.posterior else None) for estimate, _ in seen],
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


def _seconds(seen: Seen) -> Array:
    start = seen[0][0].snapshot.time_ns
    return np.array([(estimate.snapshot.time_ns - start) / 1e9 for estimate, _ in seen])


def _torque(axis: Axes, seen: Seen) -> None:
    seconds = _seconds(seen)
    measured = np.stack([estimate.smoothed_torque_Nm for estimate, _ in seen])
    true = np.stack([truth.torque_Nm for _, truth in seen])
    true[np.isnan(measured).all(axis=1)] = np.nan
    for wheel, (colour, style, name) in enumerate(zip(COLOURS, STYLES, NAMES, strict=True)):
        axis.plot(seconds, true[:, wheel], color=colour, alpha=0.22, linewidth=4)
        axis.plot(seconds, measured[:, wheel], style, color=colour, linewidth=1.2, label=name)
    axis.set_ylabel("torque at the wheel (N·m)")
    axis.legend(ncols=3, frameon=False, fontsize=8, loc="upper right")
    soils = list(dict.fromkeys(soil for _, truth in seen for soil in truth.soils))
    title = f"Six wheels drive from {' onto '.join(soils)}: measured (lines), true (broad)"
    axis.set_title(title, loc="left", fontsize=11)


def _ground(
    axis: Axes,
    seen: Seen,
    alone: list[Array],
    true: list[Array],
    posteriors: list[Interval | None],
    factor: float,
) -> None:
    """Draw one quantity: the posterior's band, the paper's network of each wheel, the soil of each wheel."""
    seconds = _seconds(seen)
    known = [(at, posterior) for at, posterior in zip(seconds, posteriors, strict=True) if posterior is not None]
    if known:
        at = np.array([second for second, _ in known])
        band = {
            name: factor * np.array([getattr(posterior, name) for _, posterior in known])
            for name in ("low_90", "low_50", "median", "high_50", "high_90")
        }
        axis.fill_between(
            at, band["low_90"], band["high_90"], color=POSTERIOR, alpha=0.13, linewidth=0, label="six wheels: 90 %"
        )
        axis.fill_between(at, band["low_50"], band["high_50"], color=POSTERIOR, alpha=0.22, linewidth=0, label="50 %")
        axis.plot(at, band["median"], color=POSTERIOR, linewidth=2, label="median")
    axis.plot(seconds, np.stack(alone), color="#888888", linewidth=0.6, alpha=0.7)
    axis.plot([], [], color="#888888", linewidth=0.8, label="each wheel alone, the paper's network")
    for first, second, colour, name in (
        (0, 1, COLOURS[0], "front"),
        (2, 3, COLOURS[2], "middle"),
        (4, 5, COLOURS[4], "rear"),
    ):
        soil = np.mean([row[[first, second]] for row in true], axis=1)
        axis.plot(seconds, soil, color=colour, linewidth=1.5, linestyle=(0, (5, 1)), label=f"true, {name} wheels")
