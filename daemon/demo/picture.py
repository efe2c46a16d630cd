"""The drive as a picture: torque, cohesion and friction angle of six wheels, with the truth behind them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

    from daemon.snapshot import Array, Estimate
    from daemon.virtual_rover import Truth

# Front, middle, rear in three hues; left solid, right dashed.
COLOURS = ("#0b6e99", "#0b6e99", "#c4622d", "#c4622d", "#4a7c3a", "#4a7c3a")
STYLES = ("-", "--") * 3
NAMES = ("1 front left", "2 front right", "3 middle left", "4 middle right", "5 rear left", "6 rear right")


def draw(seen: list[tuple[Estimate, Truth]], path: Path) -> None:
    """Write the picture (PNG)."""
    import matplotlib as mpl  # noqa: PLC0415  # only the demo has it

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415  # likewise

    start = seen[0][0].snapshot.time_ns
    seconds = np.array([(estimate.snapshot.time_ns - start) / 1e9 for estimate, _ in seen])
    figure, axes = plt.subplots(3, 1, figsize=(9, 8.2), sharex=True, layout="constrained")
    panels = (
        ("torque at the wheel (N·m)", [e.smoothed_torque_Nm for e, _ in seen], [t.torque_Nm for _, t in seen]),
        (
            "cohesion c (kPa)",
            [e.cohesion_Pa / 1000 for e, _ in seen],
            [t.cohesion_Pa / 1000 for _, t in seen],
        ),
        (
            "friction angle φ (°)",
            [np.degrees(e.friction_angle_rad) for e, _ in seen],
            [np.degrees(t.friction_angle_rad) for _, t in seen],
        ),
    )
    for axis, (label, estimated, true) in zip(axes, panels, strict=True):
        _panel(axis, seconds, np.stack(estimated), np.stack(true), label)
    axes[0].legend(ncols=3, frameon=False, fontsize=8, loc="upper right")
    axes[0].set_title(
        "Six wheels over a soil that changes: estimated (lines), true (broad and pale)", loc="left", fontsize=11
    )
    axes[-1].set_xlabel("time (s)")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _panel(axis: Axes, seconds: Array, estimated: Array, true: Array, label: str) -> None:
    moving = np.isfinite(estimated).any(axis=1)
    for wheel in range(6):
        colour = COLOURS[wheel]
        axis.plot(seconds[moving], true[moving, wheel], color=colour, alpha=0.25, linewidth=3)
        axis.plot(seconds, estimated[:, wheel], STYLES[wheel], color=colour, linewidth=1.3, label=NAMES[wheel])
    axis.set_ylabel(label)
    axis.spines[["top", "right"]].set_visible(False)
    axis.grid(axis="y", alpha=0.25)
