"""A part of what a corrected simulation has changes: one drum of two, and one late column beside another."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING

import numpy as np
import pytest
import tram
import winch
from tram import DELAY_S

from regolithd.calibration.mismatch import compare, load_simulation
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.changes import stated_in
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.delayed import filtered

if TYPE_CHECKING:
    from pathlib import Path

ROWS, STEP_S, DRAG_A = 2400, 0.5, 0.3


def _wound(seed: int, first_A: float, second_A: float) -> Recording:
    """Return 20 minutes of a winch with the drag of each drum."""
    generator = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(ROWS)[:, None]
    phase = time_s / 20 + np.array([0.0, 1.0]) + generator.uniform(0, 6)
    speed, pull = np.sin(phase) + 0.5 * np.sin(2.7 * phase), 40 + 15 * np.sin(phase / 3)
    current = 0.02 * pull + np.array([first_A, second_A]) * np.sign(speed) + generator.normal(0, 0.3, speed.shape)
    columns = {"current_A": current, "speed": speed, "pull_N": pull}
    table = {"t_s": np.repeat(time_s, 2), "drum": np.tile([1.0, 2.0], ROWS)}
    return from_columns({**table, **{name: values.ravel() for name, values in columns.items()}}, unit="drum")


def _simulation(folder: Path, module: object, name: str) -> Path:
    """Write a simulation's class and its SIM.toml."""
    stem = name.lower()
    (folder / f"{stem}.py").write_text(inspect.getsource(module))  # type: ignore[arg-type]
    (folder / "SIM.toml").write_text(f'[simulation]\nmodel = "{stem}:{name}"\n')
    return folder / "SIM.toml"


def test_an_effect_on_both_drums_that_changes_on_one_is_told_of_that_one(tmp_path: Path) -> None:
    """The corrected file has both sizes then, each on its drum; a third recording is consistent with them."""
    first = compare(_wound(1, DRAG_A, DRAG_A), load_simulation(_simulation(tmp_path, winch, "Winch")))
    assert [(effect.name, effect.wheels) for effect in first.answer.effects] == [("coulomb-friction", (1, 2))]
    first.write_corrected(tmp_path / "NEW.toml")
    later = compare(_wound(2, DRAG_A, 2 * DRAG_A), load_simulation(tmp_path / "NEW.toml"))
    (change,) = later.answer.changes
    assert (change.name, change.wheels, later.answer.effects) == ("coulomb-friction", (2,), ())
    assert change.low < 2 * DRAG_A < change.high
    assert ", on drum 2:" in change.statement
    later.write_corrected(tmp_path / "NEWER.toml")
    newer = load_simulation(tmp_path / "NEWER.toml")
    assert compare(_wound(3, DRAG_A, 2 * DRAG_A), newer).answer.verdict == "consistent"
    (again,) = compare(_wound(4, DRAG_A, DRAG_A), newer).answer.changes
    assert (again.wheels, again.low < DRAG_A < again.high) == ((2,), True)


def test_effects_of_one_name_are_summed_on_each_wheel() -> None:
    """An effect on three wheels, and a change on one: one effect on two wheels, and one on the third."""
    friction = Contribution("coulomb-friction", {}, (0.4,), (1, 2, 3), relative_std=0.1)
    change = Contribution("coulomb-friction", {}, (0.2,), (2,), relative_std=0.3)
    found = [each.contribution for each in stated_in(library(), [friction, change], [])]
    assert [(each.wheels, each.coefficients) for each in found] == [((1, 3), (0.4,)), ((2,), pytest.approx((0.6,)))]
    assert [each.relative_std for each in found] == pytest.approx([0.1, np.hypot(0.04, 0.06) / 0.6])


def _late_current(seed: int, filter_s: float, delay_s: float) -> Recording:
    """Return a recording of the tram whose grade is late, and whose current is behind a filter."""
    read, on_time = tram.columns(seed, delay_s), tram.columns(seed, 0.0)
    current = 0.47 + 30.6 * (0.0193 + on_time["grade"]) * on_time["speed_m_s"]
    if filter_s:
        current = filtered(from_columns(on_time), current[:, None], filter_s)[:, 0]
    noise = 0.25 * np.random.default_rng(seed + 100).normal(size=len(current))
    return from_columns({**read, "current_A": current + noise})


def test_two_columns_may_be_late(tmp_path: Path) -> None:
    """Each with its delay, found at once, or the second beside the corrected first."""
    path = _simulation(tmp_path, tram, "Tram")
    both = compare(_late_current(31, 4.0, DELAY_S), load_simulation(path)).answer
    delays = {effect.shape["late"]: effect.parameters["delay_s"] for effect in both.effects}
    assert delays.keys() == {"grade", "current_A"}
    assert both.verdict == "missing-physics"
    assert delays["grade"].value == pytest.approx(DELAY_S, abs=0.5)
    assert delays["current_A"].value == pytest.approx(4.0, abs=0.5)
    first = compare(_late_current(32, 4.0, 0.0), load_simulation(path))
    assert [effect.shape["late"] for effect in first.answer.effects] == ["current_A"]
    first.write_corrected(tmp_path / "NEW.toml")
    later = compare(_late_current(33, 4.0, DELAY_S), load_simulation(tmp_path / "NEW.toml")).answer
    assert [effect.shape["late"] for effect in later.effects] == ["grade"]
    assert later.changes == ()
    later = compare(_late_current(34, 0.0, DELAY_S), load_simulation(tmp_path / "NEW.toml")).answer
    assert [effect.shape["late"] for effect in later.effects] == ["grade"]
    assert [(change.name, change.low <= 0) for change in later.changes] == [("sensor-delay", True)]
