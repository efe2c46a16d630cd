"""The ground process: subscription, store, live updates, retention and web server, each a task of one group."""

from __future__ import annotations

import asyncio
import logging
import time
from typing import TYPE_CHECKING

from regolithd.daemon.ground.alarms.journal import AlarmJournal
from regolithd.daemon.ground.live import Live
from regolithd.daemon.ground.received import parse
from regolithd.daemon.ground.store.database import lock, open_reader, open_writer
from regolithd.daemon.ground.store.history import History
from regolithd.daemon.ground.store.messages import MessageStore
from regolithd.daemon.ground.store.retention import trim
from regolithd.daemon.ground.subscription import Subscription, is_stored

if TYPE_CHECKING:
    from regolithd.daemon.ground.received import Received
    from regolithd.daemon.ground.settings import GroundSettings

TRIM_PERIOD_S = 60.0
TRIM_PAUSE_S = 0.05
"""Between two batches that are deleted, so that messages do not wait."""

_log = logging.getLogger(__name__)


class Ground:
    """Everything but the web server. Create it in the process that writes the store; only one may.

    Raises
    ------
    StoreError
        The store cannot be used.
    """

    def __init__(self, settings: GroundSettings) -> None:
        self.settings = settings
        self._lock = lock(settings.store.database.parent)
        self.connection = open_writer(settings.store.database)
        self.messages = MessageStore(self.connection)
        self.journal = AlarmJournal(self.connection)
        self.subscription = Subscription(settings.mqtt, self.take)
        self.live = Live(self.journal, lambda: self.subscription.problem, time.time_ns)
        self._report_newest_alarms()

    def take(self, batch: list[Received]) -> None:
        """Store a batch of messages and tell the pages."""
        for message in batch:
            if not is_stored(message):
                self.live.take_health(message)
        for stored in self.messages.add(message for message in batch if is_stored(message)):
            self.live.take(stored)
            if stored.newest and stored.message.channel == "alarm":
                self.report(stored.message)

    def report(self, message: Received) -> None:
        """Take an alarm message into the journal."""
        if self.journal.report(message):
            self.live.alarms_changed(message.rover)

    def _report_newest_alarms(self) -> None:
        """Take the newest alarms into the journal again: the process may have ended between store and journal."""
        reader = open_reader(self.settings.store.database)
        history = History(reader)
        for rover in history.rovers():
            for topic, message in history.latest(rover).items():
                if topic.startswith("alarm/"):
                    self.report(parse("stored", f"stored/{rover}/{topic}", message.payload))
        reader.close()

    async def run(self) -> None:
        """Receive, store, send and trim until cancelled."""
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self.subscription.run())
                tasks.create_task(self.live.run())
                tasks.create_task(self._trim())
        finally:
            self.connection.close()
            self._lock.close()

    async def _trim(self) -> None:
        while True:
            deleted = trim(self.connection, self.settings.store, time.time_ns())
            await asyncio.sleep(TRIM_PAUSE_S if deleted else TRIM_PERIOD_S)
