"""Responses of recordings add up over a machine's recordings, and are ranked over machines and wheels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from regolithd.calibration.mismatch.candidates.responses import Responses, strongest

SHAPES = tuple(({"order": float(order)},) for order in range(1, 4))


def response(*sizes: tuple[float, float]) -> Responses:
    """Return responses of energy 100 whose coefficients are these, cosine alone, by shape and wheel."""
    moment = np.zeros((len(SHAPES), 2, 2))
    moment[:, :, 0] = 100.0 * np.array(sizes)
    return Responses(SHAPES, ("left", "right"), moment, np.full((len(SHAPES), 2), 100.0))


@pytest.mark.parametrize(
    ("recordings", "best"),
    [
        ([response((0, 0), (0.4, 0), (0, 0))] * 2, [1]),
        ([response((0.4, 0), (0, 0.3), (0, 0)), response((-0.4, 0), (0, 0.3), (0, 0))], [1]),
        ([response((0.3, 0.3), (0.35, 0), (0, 0))] * 2, [0, 1]),
    ],
)
def test_what_has_one_phase_in_all_recordings_is_strongest(recordings: list[Responses], best: list[int]) -> None:
    """Opposite ones cancel; several wheels count together, each pays for its coefficients."""
    assert strongest(recordings, ["a", "a"], len(best)) == best


def test_machines_have_phases_of_their_own() -> None:
    """Opposite ones of two machines do not cancel."""
    opposite = [response((0, 0), (0.4, 0), (0, 0)), response((0, 0), (-0.4, 0), (0, 0))]
    assert strongest(opposite, ["a", "b"], 3) == [1, 0, 2]
    assert strongest(opposite, ["a", "a"], 3) == [0, 1, 2]


def test_what_no_recording_can_tell_is_none() -> None:
    """However few others there are."""
    one = response((0, 0), (0, 0), (0.1, 0))
    energy = one.energy.copy()
    energy[:2] = 0.0
    assert strongest([replace(one, energy=energy)], ["a"], 2) == [2]
