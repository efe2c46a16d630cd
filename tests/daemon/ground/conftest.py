"""A store in a temporary folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from regolithd.daemon.ground.store.database import open_reader, open_writer
from regolithd.daemon.ground.store.history import History

if TYPE_CHECKING:
    import sqlite3
    from collections.abc import Iterator
    from pathlib import Path


@pytest.fixture
def writer(tmp_path: Path) -> Iterator[sqlite3.Connection]:
    """The writer's connection to an empty store."""
    connection = open_writer(tmp_path / "ground.sqlite")
    yield connection
    connection.close()


@pytest.fixture
def history(writer: sqlite3.Connection, tmp_path: Path) -> Iterator[History]:
    """A reader of the same store."""
    assert writer
    connection = open_reader(tmp_path / "ground.sqlite")
    yield History(connection)
    connection.close()
