"""What the drive came to: per wheel and soil, the estimate beside the truth."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

if TYPE_CHECKING:
    from daemon.demo.witness import Stretch


def summary(stretches: list[Stretch]) -> Table:
    """Return the table: estimated, and true in brackets."""
    table = Table(
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        title="Estimated (true), mean over each soil",
        title_justify="left",
        title_style="bold",
        padding=(0, 2, 0, 0),
    )
    table.add_column("\nwheel", justify="right")
    table.add_column("\nsoil")
    for name in ("torque\nN·m", "c\nkPa", "φ\n°"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("outside\ntraining", justify="right")
    wheel = 0
    for each in stretches:
        table.add_row(
            str(each.wheel) if each.wheel != wheel else "",
            each.soil,
            f"{each.torque_Nm:.2f} ({each.true_torque_Nm:.2f})",
            f"{each.cohesion_Pa / 1000:.2f} ({each.true_cohesion_Pa / 1000:.2f})",
            f"{math.degrees(each.friction_angle_rad):.1f} ({math.degrees(each.true_friction_angle_rad):.1f})",
            f"{100 * each.outside:.0f} %",
        )
        wheel = each.wheel
    return table
