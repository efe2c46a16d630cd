"""Commitments: only the committed truth can be opened, and the digest reveals nothing."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from regolithd.calibration.validation.blind_trials.commitment import Commitment, commitment_digest, read_opened, verify
from regolithd.calibration.validation.blind_trials.errors import CommitmentError

if TYPE_CHECKING:
    from pathlib import Path

truths = st.dictionaries(st.text(max_size=8), st.one_of(st.integers(), st.text(max_size=8), st.none()), max_size=4)


@given(truth=truths, other=truths, salt=st.text(alphabet="0123456789abcdef", min_size=32, max_size=32))
def test_a_digest_fits_one_truth_only(truth: dict[str, object], other: dict[str, object], salt: str) -> None:
    """The same truth is verified whatever the order of its keys; another one is not."""
    committed = commitment_digest(salt, truth)
    verify(committed, salt, dict(reversed(truth.items())))
    if other != truth:
        with pytest.raises(CommitmentError):
            verify(committed, salt, other)


def test_equal_truths_have_different_digests() -> None:
    """Because of the salt, equal truths have different digests."""
    assert Commitment({"effects": []}).digest != Commitment({"effects": []}).digest


def test_a_changed_truth_is_detected(tmp_path: Path) -> None:
    """Reading an opened commitment whose truth was edited is an error."""
    commitment, path = Commitment({"effects": [], "group": "nothing"}), tmp_path / "1.json"
    commitment.open_into(path, commitment.digest)
    assert read_opened(path) == commitment.truth
    opened = json.loads(path.read_text())
    opened["truth"]["group"] = "single"
    path.write_text(json.dumps(opened))
    with pytest.raises(CommitmentError):
        read_opened(path)


def test_repr_shows_no_truth() -> None:
    """Neither truth nor salt is in the `repr`, which a traceback or a log line may contain."""
    assert "secret" not in repr(Commitment({"name": "secret"}))
