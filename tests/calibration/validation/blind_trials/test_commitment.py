"""Envelopes: what was committed to is what is opened, and only the digest is told before."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.calibration.validation.blind_trials.commitment import Envelope, check_seal, read_opened, seal
from regolithd.calibration.validation.blind_trials.errors import BrokenSealError

if TYPE_CHECKING:
    from pathlib import Path

truths = st.dictionaries(st.text(max_size=8), st.one_of(st.integers(), st.text(max_size=8), st.none()), max_size=4)


@given(truth=truths, other=truths, salt=st.text(alphabet="0123456789abcdef", min_size=32, max_size=32))
def test_a_seal_fits_its_truth_alone(truth: dict[str, object], other: dict[str, object], salt: str) -> None:
    """The same truth opens, whatever the order of its keys; another one does not."""
    committed = seal(salt, truth)
    check_seal(committed, salt, dict(reversed(truth.items())))
    if other != truth:
        with pytest.raises(BrokenSealError):
            check_seal(committed, salt, other)


def test_equal_truths_have_unequal_digests() -> None:
    """The salt keeps anybody from trying likely truths against the commitment."""
    assert Envelope({"effects": []}).digest != Envelope({"effects": []}).digest


def test_a_changed_envelope_is_found_out(tmp_path: Path) -> None:
    """An opened envelope that somebody edits does not read as truth any more."""
    envelope, path = Envelope({"effects": [], "group": "nothing"}), tmp_path / "1.json"
    envelope.open_into(path, envelope.digest)
    assert read_opened(path) == envelope.truth
    opened = json.loads(path.read_text())
    opened["truth"]["group"] = "single"
    path.write_text(json.dumps(opened))
    with pytest.raises(BrokenSealError):
        read_opened(path)


def test_showing_an_envelope_shows_no_truth() -> None:
    """Neither truth nor salt leaks through `repr`, as a traceback or a log line would print it."""
    assert "secret" not in repr(Envelope({"name": "secret"}))
