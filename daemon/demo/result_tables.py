"""The tables that the demo prints at its end: estimates beside the ground truth, by wheel and by soil."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

if TYPE_CHECKING:
    from regolithd.daemon.demo.ground_truth_log import PosteriorOnSoil, WheelOnSoil


def wheel_table(wheels: list[WheelOnSoil]) -> Table:
    """Return the table of each wheel's means on each soil, true values in brackets."""
    table = _titled("Each wheel alone, the paper's network: mean over each soil (true)")
    table.add_column("\nwheel", justify="right")
    table.add_column("\nsoil")
    for name in ("torque\nN·m", "c\nkPa", "φ\n°"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("outside\ntraining", justify="right")
    wheel = 0
    for each in wheels:
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


def posterior_table(posteriors: list[PosteriorOnSoil]) -> Table:
    """Return the table of the posterior on each soil: median and 90 % interval, true values in brackets."""
    table = _titled("Posterior of all six wheels: median, 90 % interval (true)")
    table.add_column("\nsoil")
    table.add_column("c\nkPa", justify="right", no_wrap=True)
    table.add_column("φ\n°", justify="right", no_wrap=True)
    for each in posteriors:
        cohesion, angle = each.posterior.cohesion_Pa, each.posterior.friction_angle_rad
        table.add_row(
            each.soil,
            f"{cohesion.median / 1000:.1f}, {cohesion.low_90 / 1000:.1f} … {cohesion.high_90 / 1000:.1f} "
            f"({each.true_cohesion_Pa / 1000:.2f})",
            f"{math.degrees(angle.median):.0f}, {math.degrees(angle.low_90):.0f} … {math.degrees(angle.high_90):.0f} "
            f"({math.degrees(each.true_friction_angle_rad):.1f})",
        )
    return table


def _titled(title: str) -> Table:
    return Table(
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        title=title,
        title_justify="left",
        title_style="bold",
        padding=(0, 2, 0, 0),
    )
