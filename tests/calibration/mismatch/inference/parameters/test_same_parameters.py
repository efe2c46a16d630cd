"""A corrected effect that changes beside a parameter that could take the change up."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import stirrer
from stirrer import DRAG, LOAD, stirred

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.data.recording import Recording


@pytest.fixture(scope="module")
def corrected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the simulation with the drag that a first recording showed."""
    folder = tmp_path_factory.mktemp("stirrer")
    module = Path(stirrer.__file__).parent
    (folder / "SIM.toml").write_text(f'[simulation]\nmodel = "stirrer:Stirrer"\npath = "{module}"\n', encoding="utf-8")
    found = compare(stirred(0), load_simulation(folder / "SIM.toml"))
    assert [effect.name for effect in found.answer.effects] == ["viscous-friction"]
    found.write_corrected(folder / "NEW.toml")
    return folder / "NEW.toml"


def _answer(recording: Recording, path: Path) -> Answer:
    return compare(recording, load_simulation(path)).answer


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_stays_as_it_was_is_consistent(seed: int, corrected: Path) -> None:
    """Parameter and drag are what they were, together."""
    answer = _answer(stirred(seed), corrected)
    assert (answer.verdict, answer.changes) == ("consistent", ())
    assert not any("load_Nms2" in note for note in answer.notes)


@pytest.mark.parametrize(("factor", "probable"), [(0.0, 0.8), (1.8, 0.9)])
def test_a_change_that_the_parameter_could_take_up_is_told_with_it(
    factor: float, probable: float, corrected: Path
) -> None:
    """The intervals hold size and parameter; a note says where the parameter would have to be instead."""
    answer = _answer(stirred(4, factor * DRAG), corrected)
    assert answer.verdict == "missing-physics"
    (change,), (load,) = answer.changes, answer.parameters
    assert change.name == "viscous-friction"
    assert change.low <= factor * change.corrected < change.high
    assert not change.low < change.corrected < change.high
    assert load.low < LOAD < load.high
    (note,) = [note for note in answer.notes if "load_Nms2" in note]
    assert re.search(r"load_Nms2 = [\d.e-]+ N m s² instead of [\d.e-]+ may explain this one in its place", note)
    assert answer.probability is not None
    assert answer.probability > probable
    assert answer.alternatives[0].effects == ()


def test_without_the_posterior_the_parameter_takes_it_up(corrected: Path, tmp_path: Path) -> None:
    """What each is known by alone allows the one to stand for the other."""
    text = re.sub(r"posterior = .*\n", "", corrected.read_text(encoding="utf-8"))
    (tmp_path / "NEW.toml").write_text(text, encoding="utf-8")
    assert _answer(stirred(4, 1.4 * DRAG), corrected).verdict == "missing-physics"
    assert _answer(stirred(4, 1.4 * DRAG), tmp_path / "NEW.toml").verdict == "consistent"


def test_a_parameter_that_may_have_moved_is_told_beside_the_effect(corrected: Path) -> None:
    """Something has changed, and the recording does not tell what: no change is claimed, and the answer is not sure."""
    answer = _answer(stirred(4, load=0.95 * LOAD), corrected)
    assert (answer.verdict, answer.changes) == ("consistent", ())
    (note,) = [note for note in answer.notes if "load_Nms2" in note]
    assert note.startswith("Since viscous-friction was found, something has changed: load_Nms2 = ")
    assert answer.probability is not None
    assert answer.probability < 0.9
    assert answer.alternatives[0].effects == ("viscous-friction",)


def test_a_parameter_that_moves_far_is_no_change_of_the_effect(corrected: Path) -> None:
    """Where the recording tells them apart: the load's law is not the drag's."""
    answer = _answer(stirred(5, load=1.15 * LOAD), corrected)
    assert not answer.changes
