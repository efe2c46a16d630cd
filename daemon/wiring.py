"""What a service is equipped with before it runs: its outlets to the broker and to the control socket."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.daemon.control.server import ControlOutlet
from regolithd.daemon.publish.mqtt_sink import PATIENCE_S, PUBLISHING, MqttOutlet
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.spool import Spool

if TYPE_CHECKING:
    from regolithd.daemon.service import Service

CONTROL = "control"
_MEGABYTE = 1_000_000


def equip(service: Service) -> None:
    """Give a service everything that it has on a rover.

    Raises
    ------
    SpoolError
        The store of what is to be published cannot be used.
    """
    configuration, pulses = service.configuration, service.pulses
    mqtt = configuration.mqtt
    spool = Spool(mqtt.spool_directory, int(mqtt.spool_limit_MB * _MEGABYTE))
    publisher = Publisher(configuration, spool, beat=lambda: pulses.beat(PUBLISHING))
    control = ControlOutlet(
        configuration,
        lambda: service.network,
        broker=lambda: publisher.problem or ("connected" if publisher.connected else "connecting"),
        beat=lambda: pulses.beat(CONTROL),
    )
    pulses.expect(CONTROL, PATIENCE_S)
    service.outlets += [MqttOutlet(service, publisher, control_trouble=lambda: control.problem), control]
