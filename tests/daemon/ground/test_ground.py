"""What the ground does with a batch of messages, and after a restart."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import pytest
from ground_messages import START_NS, received

from regolithd.daemon.ground import ground as module
from regolithd.daemon.ground.ground import Ground
from regolithd.daemon.ground.settings import GroundSettings
from regolithd.daemon.ground.store.database import StoreError, open_reader
from regolithd.daemon.ground.store.history import History

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def settings(tmp_path: Path) -> GroundSettings:
    """A store in a temporary folder."""
    return GroundSettings.model_validate({"store": {"directory": tmp_path / "store"}})


def closed(ground: Ground) -> None:
    """End a ground."""
    ground.connection.close()
    ground._lock.close()


def test_health_is_shown_and_everything_else_stored(settings: GroundSettings) -> None:
    """Each stored message is told to the pages, and an alarm goes into the journal."""
    ground = Ground(settings)
    changed: list[str] = []
    ground.live.alarms_changed = changed.append  # type: ignore[method-assign]
    ground.take([received("health", 7), received("snapshot", 1), received("alarm/bus", 1, name="bus", active=True)])
    assert ground.live.health["kapvik"]["sequence"] == 7
    assert changed == ["kapvik"]
    assert [report.name for report in ground.journal.reports("kapvik", START_NS)] == ["bus"]
    reader = open_reader(settings.store.database)
    assert set(History(reader).latest("kapvik")) == {"snapshot", "alarm/bus"}
    reader.close()
    closed(ground)


def test_an_alarm_that_is_older_than_the_newest_changes_nothing(settings: GroundSettings) -> None:
    """Stored messages of an outage come late."""
    ground = Ground(settings)
    ground.take([received("alarm/bus", 5, 50.0, name="bus", active=False)])
    ground.take([received("alarm/bus", 4, 40.0, name="bus", active=True, late=True)])
    assert not any(report.active for report in ground.journal.reports("kapvik", START_NS))
    closed(ground)


def test_an_alarm_that_was_stored_but_not_journalled_is_read_again(settings: GroundSettings) -> None:
    """The process may have been killed between the two; what the journal has is not repeated."""
    ground = Ground(settings)
    ground.report = lambda _: None  # type: ignore[method-assign]
    ground.take([received("alarm/bus", 1, name="bus", active=True), received("snapshot", 1)])
    assert ground.journal.reports("kapvik", START_NS) == []
    closed(ground)
    for _ in range(2):
        again = Ground(settings)
        (report,) = again.journal.reports("kapvik", START_NS)
        assert (report.name, report.active) == ("bus", True)
        entries = [entry for _, entry in again.journal.entries(again.connection, "kapvik", 10)]
        assert len(entries) == 1
        closed(again)


def test_two_processes_do_not_write_one_store(settings: GroundSettings) -> None:
    """The second one ends with a message."""
    ground = Ground(settings)
    with pytest.raises(StoreError):
        Ground(settings)
    closed(ground)


async def test_the_store_is_trimmed_each_minute_and_at_once_while_there_is_much(
    settings: GroundSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A batch at a time, so that messages do not wait."""
    deleted, pauses = iter([2000, 2000, 0, 0]), list[float]()

    async def slept(seconds: float) -> None:
        pauses.append(seconds)
        if len(pauses) == 4:
            raise asyncio.CancelledError

    monkeypatch.setattr(module, "trim", lambda *_: next(deleted))
    monkeypatch.setattr(module.asyncio, "sleep", slept)
    ground = Ground(settings)
    with pytest.raises(asyncio.CancelledError):
        await ground._trim()
    assert pauses == [0.05, 0.05, 60.0, 60.0]
    closed(ground)
