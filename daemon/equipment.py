"""What a service is equipped with before it runs: its outlets."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from daemon.messages import EventMessage
from daemon.publish.publisher import Publisher
from daemon.publish.spool import Spool

if TYPE_CHECKING:
    from daemon.service import Service
    from daemon.snapshot import Estimate
    from drivers.events import NetworkEvent

PUBLISHING = "publishing"
PATIENCE_S = 5.0
_MEGABYTE = 1_000_000


class MqttOutlet:
    """Estimates and events, over MQTT."""

    def __init__(self, service: Service) -> None:
        mqtt, pulses = service.configuration.mqtt, service.pulses
        spool = Spool(mqtt.spool_directory, int(mqtt.spool_limit_MB * _MEGABYTE))
        self.publisher = Publisher(service.configuration, spool, beat=lambda: pulses.beat(PUBLISHING))
        self._pulses = pulses

    def estimate(self, estimate: Estimate) -> None:
        """Publish one SYNC."""
        self.publisher.estimate(estimate)

    def event(self, event: NetworkEvent) -> None:
        """Publish what happened, in words."""
        kind = re.sub(r"(?<=[a-z])(?=[A-Z])", "-", type(event).__name__).lower()
        node_id = getattr(event, "node_id", None)
        self.publisher.say("event", EventMessage, time_ns=event.time_ns, kind=kind, node_id=node_id, text=event.text)

    async def run(self) -> None:
        """Deliver until cancelled."""
        self._pulses.expect(PUBLISHING, PATIENCE_S)
        await self.publisher.run()


def equip(service: Service) -> None:
    """Give a service everything that it has on a rover.

    Raises
    ------
    SpoolError
        The store of what is to be published cannot be used.
    """
    service.outlets.append(MqttOutlet(service))
