"""Connects a service to its sinks: the MQTT publisher and the control socket."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.daemon.control.metrics import NAME as METRICS
from regolithd.daemon.control.metrics import MetricsSink
from regolithd.daemon.control.protocol import CONNECTED
from regolithd.daemon.control.server import ControlSink
from regolithd.daemon.publish.comparison import publish_comparison
from regolithd.daemon.publish.mqtt_sink import PUBLISHING, MqttSink
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.spool import SpoolUnusableError
from regolithd.daemon.publish.stores import Stores

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Mqtt
    from regolithd.daemon.service import Service

CONTROL = "control"
CONTROL_TIMEOUT_S = 10.0
"""The control task counts as hung when it has not reported for this long."""
_MEGABYTE = 1_000_000


def connect_sinks(service: Service, stores: Stores) -> None:
    """Add the MQTT sink, which sends what is in the stores, and the control sink to a service."""
    configuration, liveness = service.configuration, service.liveness
    publisher = Publisher(configuration, stores, beat=lambda: liveness.beat(PUBLISHING))
    control = ControlSink(
        configuration,
        lambda: service.network,
        broker=lambda: publisher.problem or (CONNECTED if publisher.connected else "connecting"),
        publish_comparison=lambda result: publish_comparison(publisher, result),
        beat=lambda: liveness.beat(CONTROL),
    )
    liveness.expect(CONTROL, CONTROL_TIMEOUT_S)
    publishing = MqttSink(
        service,
        publisher,
        control_problem=lambda: control.problem,
        wheel_problem=lambda: control.wheel_problem,
    )
    metrics = MetricsSink(configuration.control.socket.with_name(METRICS), publishing.metrics)
    service.sinks += [publishing, control, metrics]


def open_stores(mqtt: Mqtt) -> Stores:
    """Return the stores in `[mqtt] spool_directory`; where one cannot be used, both are in memory only, and say why.

    To be opened before anything else is: a second daemon ends here, and leaves no file behind.

    Raises
    ------
    SpoolError
        Another process uses the store.
    """
    try:
        return Stores.open(mqtt.spool_directory, int(mqtt.spool_limit_MB * _MEGABYTE))
    except SpoolUnusableError as error:
        return Stores.memory_only(mqtt.spool_directory, str(error))
