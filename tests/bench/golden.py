"""Compare an output with the stored one: `GOLDEN=write pytest …` stores it anew, for review in the diff."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.text import Text

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def assert_golden(text: str, stored: Path) -> None:
    """Fail where `text` differs from the stored file."""
    if os.environ.get("GOLDEN") == "write":
        stored.parent.mkdir(exist_ok=True)
        stored.write_text(text, encoding="utf-8")
    assert text.splitlines() == stored.read_text(encoding="utf-8").splitlines()


def rounded(value: object) -> object:
    """Return JSON content with numbers of three digits: the last ones depend on the processor."""
    if isinstance(value, float):
        return float(f"{value:.3g}")
    if isinstance(value, dict):
        return {key: rounded(each) for key, each in value.items()}
    return [rounded(each) for each in value] if isinstance(value, list | tuple) else value


def description(figure: Figure) -> str:
    """Return what a figure shows, as text: size, axes, and each line, area, bar and text with data and style."""
    lines = [f"figure {figure.get_size_inches().tolist()}"]
    texts = [each for each in figure.findobj(Text) if each.get_text()]
    lines += sorted({_text(each) for each in texts})
    for axes in figure.axes:
        lines += _axes(axes)
    return "\n".join(lines) + "\n"


def _axes(axes: Axes) -> list[str]:
    limits = [_numbers(axes.get_xlim()), _numbers(axes.get_ylim())]
    lines = [f"axes {axes.get_title(loc='left')!r} {axes.get_title()!r} x {limits[0]} y {limits[1]}"]
    lines += [f"  visible spines {sorted(name for name, spine in axes.spines.items() if spine.get_visible())}"]
    for line in axes.lines:
        style = f"{line.get_linestyle()} {line.get_linewidth():g} {line._dash_pattern}"
        lines.append(f"  line {_style(line)} {to_hex(line.get_color())} {style} {_numbers(line.get_xydata())}")
    for area in axes.collections:
        points = [path.vertices for path in area.get_paths()]
        colours = [to_hex(colour, keep_alpha=True) for colour in area.get_facecolor()]
        lines.append(f"  area {_style(area)} {colours} {area.get_linewidth()} {_numbers(np.concatenate(points))}")
    for bar in axes.patches:
        box = (bar.get_x(), bar.get_y(), bar.get_width(), bar.get_height())
        lines.append(f"  bar {_style(bar)} {to_hex(bar.get_facecolor(), keep_alpha=True)} {_numbers(box)}")
    legend = axes.get_legend()
    if legend is not None:
        names = [each.get_text() for each in legend.get_texts()]
        lines.append(f"  legend {legend._loc} {legend._ncols} {legend.get_frame_on()} {names}")
    return lines


def _style(artist: Artist) -> str:
    return f"{artist.get_label()!r} alpha {artist.get_alpha()}"


def _text(text: Text) -> str:
    size, weight, angle = text.get_fontsize(), text.get_fontweight(), text.get_rotation()
    place = [f"{value:.3g}" for value in text.get_position()]
    return f"text {text.get_text()!r} {place} {size:g} {weight} {to_hex(text.get_color())} {text.get_ha()} {angle:g}"


def _numbers(values: Iterable[float]) -> list[str]:
    return [f"{value:.4g}" for value in np.ravel(np.asarray(values, float))]
