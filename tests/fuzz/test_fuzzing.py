"""Damaged input of every kind is taken, or refused with the error of its reader; `make fuzz` tries it for an hour."""

from __future__ import annotations

from typing import TYPE_CHECKING

import fuzzing
import pytest
from servers import SERVERS
from targets import TARGETS, Target

if TYPE_CHECKING:
    from pathlib import Path
    from random import Random

INPUTS = {"control socket": 10, "hostile broker": 3, "CAN frames": 40}
OTHERS = 80


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("target", [*TARGETS, *SERVERS], ids=lambda target: target.name)
def test_damaged_input_is_taken_or_refused(target: Target) -> None:
    """No input causes another error, a hang, another exit status, or growing memory."""
    inputs = INPUTS.get(target.name, OTHERS)
    result = fuzzing.fuzz(0.0, 7, inputs, target.name)[target.name]
    assert result.inputs == inputs
    assert not result.defects, "\n".join(result.defects)
    assert 0 < result.refused < inputs or not target.allowed


def test_defects_are_counted(tmp_path: Path) -> None:
    """An unexpected error and a hang are defects, with the seed that repeats them; an allowed error is a refusal."""

    def one(random: Random, _folder: Path) -> None:
        match random.randrange(3):
            case 0:
                raise KeyError("unexpected")
            case 1:
                raise ValueError("documented")
            case _:
                raise fuzzing.HangError

    result = fuzzing.fuzz_one(Target("broken", one, (ValueError,)), 0.0, 1, 60, tmp_path)
    assert result.refused > 10
    assert result.hangs > 10
    assert result.counts["KeyError at test_fuzzing.py:37"] > 10
    assert len(result.defects) == 2


def test_an_input_that_computes_without_end_is_a_hang(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is interrupted after its processor time."""

    def one(_random: Random, _folder: Path) -> None:
        while True:
            pass

    monkeypatch.setattr(fuzzing, "HANG_S", 0.05)
    monkeypatch.setattr(fuzzing, "WAIT_S", 100)
    fuzzing.fuzz(0.0, 1, 0, "no such target")  # sets the handlers
    assert fuzzing.fuzz_one(Target("endless", one, ()), 0.0, 1, 1, tmp_path).hangs == 1
