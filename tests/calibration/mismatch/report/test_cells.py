"""The map of a report: a rectangle for each block and wheel whose colour can be seen."""

from __future__ import annotations

import re

import numpy as np
import pytest

from regolithd.calibration.mismatch.report.axes import Panel
from regolithd.calibration.mismatch.report.figures import _cells, _edges

PANEL = Panel(10.0, 20.0, 100.0, 30.0, (0.0, 100.0), (0.0, 1.0))


def shown(edges: list[float], values: list[list[float]]) -> list[dict[str, str]]:
    """Return the attributes of each rectangle."""
    cells = _cells(PANEL, np.array(edges), np.array(values))
    return [dict(re.findall(r'([a-z-]+)="([^"]*)"', cell)) for cell in cells]


def test_a_cell_fills_its_block_and_its_wheel_s_row() -> None:
    """But for a gap; what is above the simulation and what is below it have a colour each."""
    first, second = shown([0.0, 40.0], [[6.0, -3.0]])
    assert (first["class"], second["class"]) == ("more", "less")
    assert (first["x"], first["y"], first["width"], first["height"]) == ("10.0", "20.5", "39.6", "14.0")
    assert (second["y"], second["fill-opacity"]) == ("35.5", f"{0.5**1.2:.2f}")


@pytest.mark.parametrize(("width_px", "drawn"), [(0.1, "0.3"), (0.7, "0.3"), (1.0, "0.6"), (5.0, "4.6")])
def test_a_narrow_cell_can_still_be_seen(width_px: float, drawn: str) -> None:
    """A third of a pixel at least."""
    (cell,) = shown([50.0, 50.0 + width_px], [[6.0]])
    assert (cell["x"], cell["width"]) == ("60.0", drawn)


def test_opacity_grows_with_the_standard_errors_up_to_six() -> None:
    """What nobody could see, and what was not measured, is not drawn."""
    cells = shown([0.0, 1, 2, 3, 4, 5], [[0.2], [float("nan")], [3.0], [6.0], [60.0]])
    assert [cell["fill-opacity"] for cell in cells] == [f"{0.5**1.2:.2f}", "1.00", "1.00"]


def test_blocks_meet_halfway_between_their_centres() -> None:
    """The outer ones are as wide inwards as outwards; a single one is a unit wide."""
    np.testing.assert_allclose(_edges(np.array([1.0, 2.0, 4.0])), [0.5, 1.5, 3.0, 5.0])
    np.testing.assert_allclose(_edges(np.array([7.0])), [6.5, 7.5])
