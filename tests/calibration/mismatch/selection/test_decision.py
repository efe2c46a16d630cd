"""What has earned a name and what has not: changes that heal, beats of time, lines under slow noise, soil borders."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rover_drives import columns, simulation

from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.answer import Answer

Table = dict[str, NDArray[np.float64]]


def answer_to(table: Table, added: NDArray[np.float64]) -> Answer:
    """Return what is said when this, in shares of the mean current, is added to the currents."""
    current = table["motor_current_A"]
    changed = {**table, "motor_current_A": current + added * np.mean(np.abs(current))}
    return compare(from_columns(changed), simulation()).answer


def test_what_comes_and_goes_on_one_wheel_is_not_wear() -> None:
    """A cable that rubs in two spells has no name; its wheel is told."""
    table = columns(11, length_s=600.0)
    t, rubbing = table["t_s"], np.zeros(len(table["t_s"]))
    for start_s, end_s in ((140, 230), (380, 470)):
        rubbing[(t > start_s) & (t < end_s) & (table["wheel"] == 4)] = 0.6
    answer = answer_to(table, rubbing * np.sign(table["motor_speed_rad_s"]))
    assert answer.verdict == "unexplained"
    assert not answer.effects
    assert {place.wheels for place in answer.unexplained} == {(4,)}


def test_what_wears_is_named_still() -> None:
    """The same drag that stays is a bearing's."""
    table = columns(11, length_s=600.0)
    stays = 0.6 * ((table["t_s"] > 140) & (table["wheel"] == 4))
    answer = answer_to(table, stays * np.sign(table["motor_speed_rad_s"]))
    assert [(effect.name, effect.wheels) for effect in answer.effects] == [("bearing-drag", (4,))]


def test_a_beat_too_quick_for_a_curve_over_time_is_located_there() -> None:
    """Something that switches every quarter of a minute, whatever the wheels do, is of time and has no name."""
    table = columns(12, length_s=400.0)
    beat = 0.2 * np.sign(np.sin(2 * np.pi * table["t_s"] / 16.0))
    answer = answer_to(table, beat * np.sign(table["motor_speed_rad_s"]))
    assert answer.verdict == "unexplained"
    assert [place.covariate for place in answer.unexplained] == ["time"]


def test_a_ripple_is_found_under_noise_that_is_slow() -> None:
    """A line in the spectrum is held against the noise around it: what wanders over a minute hides no grousers."""
    table = columns(13, length_s=600.0, noise=0.1)
    rng = np.random.default_rng(5)
    steps = np.zeros((len(table["t_s"]) // 6, 6))
    for k in range(1, len(steps)):
        steps[k] = 0.99 * steps[k - 1] + 0.141 * rng.normal(size=6)
    turned = np.cumsum(table["motor_speed_rad_s"].reshape(-1, 6) / 1400 * 0.2, axis=0)
    added = 0.3 * steps.ravel() + 0.06 * np.sin(11 * turned).ravel()
    answer = answer_to(table, added)
    (ripple,) = answer.effects
    assert ripple.name == "wheel-angle-ripple"
    assert abs(ripple.parameters["order"].value - 11) < 0.05
    quiet = answer_to(table, 0.3 * steps.ravel())
    assert "wheel-angle-ripple" not in {effect.name for effect in quiet.effects}


def test_a_soil_border_is_met_axle_by_axle() -> None:
    """The onset is when the rover's middle is over it, however slowly it drives across."""
    table = columns(14, length_s=900.0, speed=None)
    slow = np.abs(table["motor_speed_rad_s"]) / 1400
    hub = (0.075 * slow).reshape(-1, 6)[:, 0] * 0.97
    place = np.cumsum(hub * 0.2)[:, None] + 0.325 * np.array([1.0, 1, 0, 0, -1, -1])
    border = place[:, 2][np.searchsorted(np.arange(len(place)) * 0.2, 500.0)]
    answer = answer_to(table, 0.25 * (place > border).ravel() * np.sign(table["motor_speed_rad_s"]))
    (effect,) = answer.effects
    assert effect.name == "soil-transition"
    onset = effect.parameters["onset_s"]
    assert onset.low <= 500 <= onset.high
