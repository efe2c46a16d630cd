"""Why the connection to the broker ended, by what aiomqtt raises, and for how long it is told."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest
from aiomqtt import MqttCodeError, MqttError
from aiomqtt.exceptions import MqttConnectError
from paho.mqtt.client import convert_connack_rc_to_reason_code
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.reasoncodes import ReasonCode

from regolithd.daemon.config.broker import BrokerSettings
from regolithd.daemon.config.configuration import Configuration, Mqtt
from regolithd.daemon.publish.connection_errors import reason_of
from regolithd.daemon.publish.publisher import STABLE_CONNECTION_S, Publisher
from regolithd.daemon.wiring import open_stores

if TYPE_CHECKING:
    from pathlib import Path

TAKEN_OVER = MqttCodeError(ReasonCode(PacketTypes.DISCONNECT, identifier=142))
LOST = "the connection was lost. If it repeats immediately, another client uses the same [rover] name."
TAKEN = "another client uses the same [rover] name and took the connection over. Give each rover its own name."
REFUSED = "a client without a user name is refused. Set [mqtt] username and password_file, or correct the broker's"


def caused(error: Exception, by: Exception) -> Exception:
    """Return an error with its cause."""
    error.__cause__ = by
    return error


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (MqttCodeError(4, "Could not publish message"), LOST),  # paho: not connected; no refusal of MQTT 3.1.1
        (MqttCodeError(5, "Could not publish message"), LOST),
        (MqttCodeError(7, "Could not publish message"), LOST),
        (TAKEN_OVER, TAKEN),
        (caused(MqttError("Disconnected during message iteration"), TAKEN_OVER), TAKEN),
        (caused(MqttCodeError(4, "Could not publish message"), TAKEN_OVER), TAKEN),
        (MqttConnectError(ReasonCode(PacketTypes.CONNACK, identifier=135)), REFUSED),
        (MqttConnectError(convert_connack_rc_to_reason_code(4)), REFUSED),
        (MqttConnectError(convert_connack_rc_to_reason_code(5)), REFUSED),
    ],
)
def test_the_brokers_reason_is_told_apart_from_the_librarys(error: Exception, told: str) -> None:
    """Only a code of the broker is a refusal: with two rovers of one name it refuses nobody."""
    assert told in reason_of(error, BrokerSettings())


def test_a_connection_that_ends_again_and_again_is_a_recent_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two rovers of one name disconnect each other once a second, and are connected between."""
    configuration = Configuration(mqtt=Mqtt(spool_directory=tmp_path))
    publisher = Publisher(configuration, open_stores(configuration.mqtt))
    now_s = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: now_s)
    assert publisher.recent_problem == ""
    for _ in range(3):
        publisher._on_disconnected("lost")
        publisher._connection = SimpleNamespace(up=True)  # type: ignore[assignment]
        publisher._on_connected()
        now_s += STABLE_CONNECTION_S
        assert (publisher.problem, publisher.recent_problem) == ("", "lost")
    now_s += 0.1
    assert publisher.recent_problem == ""
