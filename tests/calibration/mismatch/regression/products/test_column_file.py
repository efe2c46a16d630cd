"""Columns in a file: they come back as they were written."""

from __future__ import annotations

import contextlib
import errno
import gc
import os
from pathlib import Path

import numpy as np
import pytest

from regolithd.calibration.mismatch.errors import MismatchError
from regolithd.calibration.mismatch.regression.products.column_file import AT_ONCE_BYTES, ColumnFile

COLUMNS = np.random.default_rng(0).normal(size=(7, 2, 50)).astype(np.float32)
BEGINS = np.arange(7)


def written() -> ColumnFile:
    """Return a file with all columns, written in two parts."""
    file = ColumnFile(2, 50)
    file.append(COLUMNS[:3], BEGINS[:3])
    file.append(COLUMNS[3:], BEGINS[3:])
    return file


def test_columns_come_back_in_any_order() -> None:
    """Some of them, one twice, and none."""
    file = written()
    assert file.count == 7
    np.testing.assert_array_equal(file.read([5, 6, 0, 0, 3, 4]), COLUMNS[[5, 6, 0, 0, 3, 4]])
    assert file.read([]).shape == (0, 2, 50)


def test_a_part_of_time_comes_back_for_one_wheel() -> None:
    """Of the columns that are asked for."""
    found = np.empty((3, 25), np.float32)
    written().read_part(found, [4, 0, 5], 1, 10)
    np.testing.assert_array_equal(found, COLUMNS[[4, 0, 5], 1, 10:35])


def test_long_columns_are_few_at_once() -> None:
    """As many as have room, and one at least."""
    assert ColumnFile(2, 50).at_once == AT_ONCE_BYTES // 400
    assert ColumnFile(6, AT_ONCE_BYTES).at_once == 1


def test_a_full_disk_is_one_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """It names the folder and the cure."""

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    file = written()
    monkeypatch.setattr(os, "pwrite", full)
    with pytest.raises(MismatchError, match=r"do not fit into .* \(No space left on device\); set TMPDIR"):
        file.append(COLUMNS, BEGINS)


def test_the_file_is_gone_with_its_object() -> None:
    """It has no name, and its descriptor is closed."""
    gc.collect()  # files of tests before this one
    open_before = without_names()
    file = written()
    (own,) = without_names() - open_before
    del file
    gc.collect()
    assert own not in without_names()


def without_names() -> set[str]:
    """Return this process's open files that are in no folder any more."""
    found = set()
    for each in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # the descriptor by which this folder is listed
            found.add(str(each.readlink()))
    return {target for target in found if target.endswith("(deleted)")}
