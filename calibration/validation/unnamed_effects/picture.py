"""The study's picture: held-out errors without and with the curve, over what the true model leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import matplotlib as mpl

from regolithd.calibration.validation.reproduction.pictures import OURS, PAPER, STYLE, figure, save

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


class Drawn(Protocol):
    """One recording."""

    @property
    def machine(self) -> str:
        """The machine's name."""

    @property
    def kind(self) -> str:
        """Of the concealed effect."""

    @property
    def before(self) -> float:
        """Held-out error without the curve, over the true model's."""

    @property
    def after(self) -> float:
        """The same with the curve; 0 where there is none."""


def draw(recordings: Sequence[Drawn], path: Path) -> None:
    """Draw a row for each recording in which something was found."""
    shown = [each for each in reversed(recordings) if each.after]
    rows = range(len(shown))
    with mpl.rc_context(STYLE):
        made = figure(9, 1.2 + 0.24 * len(shown))
        panel = made.subplots()
        panel.axvspan(0.95, 1.05, color="#eef1f4", zorder=0)
        panel.axvline(1.0, color="#808890", linewidth=0.8)
        panel.hlines(rows, [each.after for each in shown], [each.before for each in shown], color="#c5ccd3")
        panel.plot([each.before for each in shown], rows, "o", color=PAPER, label="without the curve")
        panel.plot([each.after for each in shown], rows, "o", color=OURS, label="with the empirical curve")
        panel.set_yticks(list(rows), [f"{each.kind} ({each.machine})" for each in shown], fontsize=8)
        panel.set_xlabel("held-out error over what the true model leaves")
        panel.legend(loc="lower right")
        save(made, path)
