"""A damaged model file is refused, or gives the same numbers."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.models import TERRAIN_MODEL
from regolithd.calibration.models.digest import is_damaged, with_digest
from regolithd.calibration.models.onnx_session import ModelError, open_session

if TYPE_CHECKING:
    from pathlib import Path

BATCH = np.array([[50.0, 0.02, 0.08]], np.float32)


def answer(path: Path) -> bytes:
    """Return the numbers that a terrain network gives."""
    session = open_session(path, "")
    (numbers,) = session.run(None, {session.get_inputs()[0].name: BATCH})
    return np.asarray(numbers).tobytes()


def test_any_flipped_bit_is_noticed_or_changes_no_number(tmp_path: Path) -> None:
    """Of 400 single flipped bits of the network that comes with regolithd, none gives another number."""
    whole, path = TERRAIN_MODEL.read_bytes(), tmp_path / "damaged.onnx"
    right = answer(TERRAIN_MODEL)
    refused = 0
    for bit in random.Random(3).sample(range(8 * len(whole)), 400):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        try:
            assert answer(path) == right, bit
        except ModelError:
            refused += 1
    assert refused > 390


def test_models_that_come_with_regolithd_have_a_digest() -> None:
    """Both files end in the digest of their content."""
    for path in (TERRAIN_MODEL, TERRAIN_MODEL.with_name("posterior.onnx")):
        data = path.read_bytes()
        assert b"regolithd.sha256" in data
        assert not is_damaged(data)


def test_what_is_appended_or_cut_off_is_noticed() -> None:
    """A model with a digest and bytes after it, or with a part of the digest, is damaged; one without any is not."""
    data = with_digest(b"model")
    assert not is_damaged(data)
    assert is_damaged(data + b"x")
    assert is_damaged(data[:-1])
    assert not is_damaged(b"model")


def test_a_file_that_cannot_be_read_is_one_message(tmp_path: Path) -> None:
    """A folder in its place, and bytes that are no model, are named with the remedy."""
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no model")
    for path in (tmp_path, broken):
        with pytest.raises(ModelError, match="Train one"):
            open_session(path, "Train one.")
