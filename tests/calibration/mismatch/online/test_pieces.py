"""Rows of a growing recording become pieces of equal time, whatever batches they come in."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch import RecordingError
from regolithd.calibration.mismatch.online.pieces import Cutter, Piece, together


def rows(time_s: list[float]) -> dict[str, np.ndarray]:
    """Return rows of two wheels; `value` is the time as it stands in the recording."""
    both = np.repeat(time_s, 2)
    return {"t_s": both, "wheel": np.tile([1.0, 2.0], len(time_s)), "value": both.copy()}


def cut(batches: list[dict[str, np.ndarray]], interval_s: float = 10.0) -> tuple[list[Piece], Cutter]:
    """Return the pieces of batches, the last one included."""
    cutter = Cutter(interval_s, "wheel")
    return [*(piece for batch in batches for piece in cutter.add(batch)), *cutter.rest()], cutter


def values(pieces: list[Piece]) -> list[list[float]]:
    """Return the first wheel's values of each piece."""
    return [piece.recording.channel("value")[:, 0].tolist() if piece.recording else [] for piece in pieces]


def test_the_pieces_do_not_depend_on_the_batches() -> None:
    """Rows that come one by one, and all at once, give the same pieces."""
    time_s = [float(t) for t in range(100, 135)]
    at_once, _ = cut([rows(time_s)])
    singly, _ = cut([rows([t]) for t in time_s])
    assert values(at_once) == values(singly)
    assert [piece.start_s for piece in at_once] == [0.0, 10.0, 20.0, 30.0]
    assert values(at_once)[1] == time_s[10:20]


def test_a_gap_gives_empty_pieces_with_a_reason() -> None:
    """An interval without rows is a piece that says so."""
    pieces, _ = cut([rows([0.0, 1.0, 2.0]), rows([31.0, 32.0])])
    assert [bool(piece.recording) for piece in pieces] == [True, False, False, True]
    assert pieces[1].reason == "nothing was recorded"


def test_a_piece_is_held_back_until_a_later_row_comes() -> None:
    """A piece is complete when a row of a later one is there."""
    cutter = Cutter(10.0, "wheel")
    assert not list(cutter.add(rows([0.0, 9.9])))
    assert len(list(cutter.add(rows([10.0])))) == 1


def test_a_clock_that_is_set_back_begins_the_next_interval() -> None:
    """Time goes on, from the next interval on, and no row is lost."""
    pieces, cutter = cut([rows([1000.0, 1005.0, 1012.0, 1013.0]), rows([3.0, 8.0]), rows([14.0, 15.0])])
    assert cutter.clock_set_back == 1
    assert sum(len(each) for each in values(pieces)) == 8
    assert [piece.first_s for piece in pieces] == [0.0, 12.0, 20.0, 31.0]


def test_rows_that_come_too_late_are_counted() -> None:
    """A row of a piece that is out is left out, and counted."""
    pieces, cutter = cut([rows([0.0, 1.0, 2.0, 11.0]), rows([4.0, 12.0])])
    assert cutter.late_rows == 2
    assert values(pieces)[1] == [11.0, 12.0]


def test_a_piece_of_one_instant_says_why_it_is_none() -> None:
    """A piece that is no recording has the reason."""
    pieces, _ = cut([rows([0.0])])
    assert "only one instant" in pieces[0].reason


def test_milliseconds_are_read_as_such() -> None:
    """A column `t_ms` is time too."""
    batch = rows([0.0, 5000.0, 15000.0, 16000.0])
    batch["t_ms"] = batch.pop("t_s")
    pieces, _ = cut([batch])
    assert [piece.start_s for piece in pieces] == [0.0, 10.0]


def test_rows_without_time_are_an_error() -> None:
    """The message names the columns that time may be in."""
    with pytest.raises(RecordingError, match="no column of time"):
        list(Cutter(10.0, "wheel").add({"wheel": np.ones(3)}))


def test_together_keeps_each_wheel_in_its_column() -> None:
    """A wheel that a piece lacks is not measured there."""
    whole, _ = cut([rows([0.0, 1.0])])
    alone = {name: column[1::2] for name, column in rows([12.0, 13.0]).items()}
    cutter = Cutter(10.0, "wheel")
    pieces = [*whole, *cutter.add({**alone, "t_s": alone["t_s"] - 12.0}), *cutter.rest()]
    recording, elapsed = together(pieces)
    assert recording.wheels == (1, 2)
    assert np.isnan(recording.channel("value")[2:, 0]).all()
    assert recording.channel("value")[2:, 1].tolist() == [12.0, 13.0]
    assert len(elapsed) == 4
