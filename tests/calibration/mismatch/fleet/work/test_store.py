"""Results of recordings on disk: what is read back is what was written, and damage is none of it."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from sample_answer import FINDINGS

from regolithd.calibration.mismatch import answer as answers
from regolithd.calibration.mismatch.fleet.work.store import KINDS, Store
from regolithd.calibration.mismatch.inference.findings import Findings

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class Unknown:
    """A class that no file may hold."""

    value: float


def test_findings_with_every_part_come_back(tmp_path: Path) -> None:
    """Equal to what was written."""
    store = Store(tmp_path / "parts")
    store.write("key", FINDINGS)
    assert store.read("key") == FINDINGS


def test_every_part_of_the_findings_may_be_stored() -> None:
    """A data class that is added to the findings has to be added to the store's kinds."""
    parts = {each for each in vars(answers).values() if isinstance(each, type) and is_dataclass(each)}
    of_the_findings = {each for each in parts if any(each.__name__ in str(f.type) for f in fields(Findings))}
    assert len(of_the_findings) >= 4
    assert {each.__name__ for each in of_the_findings} <= set(KINDS)


def test_arrays_and_mappings_come_back(tmp_path: Path) -> None:
    """Arrays keep their type and shape."""
    value: dict[str, Any] = {"sums": np.arange(6, dtype=np.float32).reshape(2, 3), "names": ("a", "b"), "count": 3}
    store = Store(tmp_path)
    store.write("key", value)
    found = store.read("key")
    assert found is not None
    np.testing.assert_array_equal(found["sums"], value["sums"])
    assert found["sums"].dtype == np.float32
    assert (found["names"], found["count"]) == (("a", "b"), 3)


def test_what_is_missing_or_damaged_is_computed_again(tmp_path: Path) -> None:
    """Nothing under a name, half a file, and a file of something else are read as nothing."""
    store = Store(tmp_path)
    assert store.read("key") is None
    store.write("key", {"a": np.ones(100)})
    whole = (tmp_path / "key.npz").read_bytes()
    for damaged in (whole[: len(whole) // 2], b"something else"):
        (tmp_path / "key.npz").write_bytes(damaged)
        assert store.read("key") is None


def test_only_what_is_used_is_kept(tmp_path: Path) -> None:
    """Results of files that have changed go."""
    store = Store(tmp_path)
    for key in ("one", "two"):
        store.write(key, 1.0)
    store.keep_only(["two"])
    assert (store.read("one"), store.read("two")) == (None, 1.0)


def test_an_unknown_class_is_refused_when_it_is_written(tmp_path: Path) -> None:
    """It could not be read back."""
    with pytest.raises(TypeError, match="Unknown is none of the data classes"):
        Store(tmp_path).write("key", Unknown(1.0))
