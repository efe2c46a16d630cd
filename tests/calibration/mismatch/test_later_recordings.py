"""An effect that begins in one recording is there from the beginning of later ones: unchanged, grown, gone, new."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import winch
from winch import Winch

from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.changes import corrected_problem, stated_in, with_changes
from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.data.joined import joined
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.fleet.comparison import compare as compare_fleet
from regolithd.calibration.mismatch.online.linearised import learned
from regolithd.calibration.mismatch.online.pieces import Cutter, together
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.corrections.onset_clock import FoundIn, found_here
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.problem.problem import Problem

ROWS, STEP_S, ONSET_S, DRAG_A, ON = 2400, 0.5, 500.0, 0.3, np.array([0.0, 1.0])
STEP = {"onset_s": ONSET_S, "rise_s": 0.0}


def _recording(
    seed: int, drag_A: float, onset_s: float = 0.0, offset_A: float = 0.0, clock_s: float = 0.0, noise_A: float = 0.3
) -> Recording:
    """Return 20 minutes of a winch whose second drum drags from a time on; its clock begins anywhere."""
    generator = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(ROWS)[:, None]
    phase = time_s / 20 + np.array([0.0, 1.0]) + generator.uniform(0, 6)
    speed, pull = np.sin(phase) + 0.5 * np.sin(2.7 * phase), 40 + 15 * np.sin(phase / 3)
    current = 0.02 * pull + drag_A * np.sign(speed) * (time_s >= onset_s) * ON + offset_A * (1 - ON)
    columns = {"current_A": current + generator.normal(0, noise_A, speed.shape), "speed": speed, "pull_N": pull}
    table = {"t_s": clock_s + np.repeat(time_s, 2), "drum": np.tile([1.0, 2.0], ROWS)}
    return from_columns({**table, **{name: values.ravel() for name, values in columns.items()}}, unit="drum")


FIRST = _recording(0, DRAG_A, ONSET_S)


@pytest.fixture(scope="module")
def new(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the corrected simulation of a recording in which a drag begins."""
    folder = tmp_path_factory.mktemp("winch")
    module = Path(winch.__file__).parent
    (folder / "SIM.toml").write_text(f'[simulation]\nmodel = "winch:Winch"\npath = "{module}"\n', encoding="utf-8")
    found = compare(FIRST, load_simulation(folder / "SIM.toml"))
    assert [(effect.name, effect.wheels) for effect in found.answer.effects] == [("bearing-drag", (2,))]
    found.write_corrected(folder / "NEW.toml")
    return folder / "NEW.toml"


def _answer(recording: Recording, new: Path) -> Answer:
    return compare(recording, load_simulation(new)).answer


@pytest.mark.parametrize(
    "recording",
    [
        FIRST,
        _recording(1, DRAG_A),
        _recording(1, DRAG_A, clock_s=ROWS * STEP_S),
        joined([FIRST, _recording(1, DRAG_A)], "AB"),
    ],
    ids=["the same", "a later one", "a later one whose clock goes on", "both"],
)
def test_what_stays_as_it_was_is_consistent(recording: Recording, new: Path) -> None:
    """In the recording in which it began it acts from its onset on, in a later one from the beginning."""
    answer = _answer(recording, new)
    assert (answer.verdict, answer.effects, answer.changes) == ("consistent", (), ())


@pytest.mark.parametrize(("now_A", "word"), [(0.5, "larger"), (0.0, "gone")])
def test_what_has_changed_since_is_a_change(now_A: float, word: str, new: Path) -> None:
    """And no friction, which would be the same drag by another name."""
    answer = _answer(_recording(2, now_A), new)
    (change,) = answer.changes
    assert (answer.effects, change.name, change.wheels) == ((), "bearing-drag", (2,))
    assert change.low <= now_A < change.high
    assert f"bearing-drag is {word}" in change.statement


@pytest.mark.parametrize("relative_std", [0.08, 0.2])
def test_a_drag_that_was_known_badly_is_gone_all_the_same(relative_std: float, new: Path) -> None:
    """The readings say far more than that uncertainty: it must not take up the change."""
    text = re.sub(r"(?m)^relative_std = .*$", f"relative_std = {relative_std}", new.read_text())
    doubtful = new.with_name(f"{relative_std}.toml")
    doubtful.write_text(text)
    answer = _answer(_recording(2, 0.0, noise_A=0.03), doubtful)
    (change,) = answer.changes
    assert (answer.effects, change.name) == ((), "bearing-drag")
    assert change.low <= 0 < change.high


def test_what_is_new_is_named_beside_what_stays(new: Path) -> None:
    """The drag that was known is not named again."""
    answer = _answer(_recording(3, DRAG_A, offset_A=0.25), new)
    assert [(effect.name, effect.wheels) for effect in answer.effects] == [("current-sensor-bias", (1,))]
    assert answer.changes == ()


def _added(recording: Recording, found_in: FoundIn | None, shape: dict[str, float]) -> np.ndarray:
    """Return what a corrected drag adds on drum 2, without the sign of the motion; NaN where nothing is compared."""
    drag = Contribution("bearing-drag", shape, (1.0,), (2,), found_in=found_in)
    return _moving(corrected_problem(build_problem(recording, Winch()), stated_in(library(), [drag], [])))


def _moving(problem: Problem) -> np.ndarray:
    """Return what is added on drum 2 while it moves."""
    return np.where(problem.mask & (problem.covariates["direction"] != 0), np.abs(problem.added), np.nan)[:, 1]


def _agree(one: np.ndarray, other: np.ndarray | float) -> bool:
    return bool(np.nanmax(np.abs(one - other)) < 1e-9)


@pytest.mark.parametrize(
    ("shape", "at_end"),
    [
        (STEP, 1.0),
        ({"onset_s": ONSET_S, "rise_s": 900.0}, -np.expm1(-(1199.5 - ONSET_S) / 900)),
        ({"onset_s": ONSET_S, "full_at_s": 1199.5, "power": 2.0}, 1.0),
    ],
)
def test_a_later_recording_has_the_size_at_the_end_of_the_first(shape: dict[str, float], at_end: float) -> None:
    """However it grew; and so has what was recorded after the first in one recording with it."""
    found_in = found_here(build_problem(FIRST, Winch()))
    assert found_in.end_s == 1199.5
    first, later = (_added(each, found_in, shape) for each in (FIRST, _recording(1, 0.0)))
    assert _agree(later, at_end)
    assert _agree(first[: int(ONSET_S / STEP_S)], 0.0)
    both = _added(joined([FIRST, _recording(1, 0.0)], "AB"), found_in, shape)
    assert _agree(both, np.concatenate([first, later]))


def test_an_onset_that_stands_alone_is_on_the_clock_of_each_recording() -> None:
    """As a person writes it who knows when something begins."""
    added = _added(_recording(1, 0.0), None, STEP)
    assert _agree(added[: int(ONSET_S / STEP_S)], 0.0)
    assert _agree(added[int(ONSET_S / STEP_S) :], 1.0)


def test_a_reading_that_differs_makes_another_recording() -> None:
    """The times alone are those of every recording that is as long."""
    found_in = found_here(build_problem(FIRST, Winch()))
    current = FIRST.channels["current_A"].copy()
    current[-1, 0] += 1e-3
    assert found_here(build_problem(FIRST.with_channels(current_A=current), Winch())) != found_in
    assert found_here(build_problem(replace(FIRST, notes=("read again",)), Winch())) == found_in


def test_a_drag_that_had_begun_is_the_friction_of_a_later_recording() -> None:
    """On a machine with one axis no friction is looked for beside it, but another drag may begin."""
    drag = Contribution("bearing-drag", STEP, (1.0,), (1, 2), found_in=FoundIn("of another", 9, 600.0))
    stated = stated_in(library(), [drag], [])
    problem = corrected_problem(build_problem(FIRST, Winch()), stated)
    *looked_for, change = with_changes(problem, library(), stated)
    names = {candidate.name for candidate in looked_for}
    assert "coulomb-friction" not in names
    assert "bearing-drag" in names
    assert (change.covariate, change.imitated_over) == ("direction", "wheel_speed")


@pytest.mark.parametrize(("found_in", "at_first"), [(None, 0.0), (FoundIn("of another", 9, 600.0), 1.0)])
def test_a_monitor_counts_an_onset_from_the_start_of_the_drive(found_in: FoundIn | None, at_first: float) -> None:
    """Not from the start of each piece; one of another recording has passed."""
    simulation, drive = Winch(), _recording(4, DRAG_A)
    simulation.corrected_effects = (Contribution("bearing-drag", STEP, (1.0,), (2,), found_in=found_in),)
    columns = {"t_s": np.repeat(drive.time_s, 2), "drum": np.tile([1.0, 2.0], ROWS)}
    pieces = list(Cutter(100.0, "drum").add({**columns, **{k: v.ravel() for k, v in drive.channels.items()}}))
    linearised, _ = learned(pieces[:3], simulation)
    for piece, added in ((pieces[2], at_first), (pieces[7], 1.0)):
        assert _agree(_moving(linearised.pose(*together([piece]))), added)


def test_a_fleet_knows_each_of_its_recordings(new: Path) -> None:
    """The one in which the drag began has it from its onset on, a later one from the beginning."""
    agreeing = compare_fleet([FIRST, _recording(5, DRAG_A)], load_simulation(new)).answer
    assert (agreeing.verdict, agreeing.effects) == ("consistent", ())
