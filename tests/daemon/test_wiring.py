"""What connects the service to its sinks: the stores' limit, and what the status says of the broker."""

from __future__ import annotations

import logging
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from regolithd.daemon import wiring
from regolithd.daemon.config.configuration import Configuration, Mqtt, Recording
from regolithd.daemon.control.server import ControlSink
from regolithd.daemon.pipeline.onnx_models import load_usable_models
from regolithd.daemon.publish.mqtt_sink import MqttSink
from regolithd.daemon.service import Service

if TYPE_CHECKING:
    from pathlib import Path


def test_the_stores_have_the_limit_in_megabytes(tmp_path: Path) -> None:
    """A megabyte has a million bytes; snapshots have nine tenths of the limit."""
    stores = wiring.open_stores(Mqtt(spool_directory=tmp_path, spool_limit_MB=20))
    try:
        assert [store.limit_bytes for store in stores.both] == [18_000_000, 2_000_000]
        assert stores.problem == ""
    finally:
        stores.close()


def test_messages_are_kept_in_memory_where_no_store_can_be_opened(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The stores say why, and so does the log, by the alarm."""
    (tmp_path / "file").touch()
    configuration = Configuration(
        mqtt=Mqtt(spool_directory=tmp_path / "file" / "spool"),
        recording=Recording(directory=tmp_path / "file" / "recordings"),
    )
    service = Service(configuration, load_usable_models(configuration))
    wiring.connect_sinks(service, wiring.open_stores(configuration.mqtt))
    publishing = service.sinks[0]
    assert isinstance(publishing, MqttSink)
    with caplog.at_level(logging.WARNING):
        publishing._publish_changes()
    problem = publishing.publisher.store_problem
    assert f"{tmp_path}/file" in problem
    assert [record.levelname for record in caplog.records] == ["ERROR", "ERROR"]
    store, recording = caplog.messages
    assert store.startswith(f"alarm store: {problem.rstrip('.')}. ")
    assert "messages are in memory only" in store
    assert recording.startswith(
        f"alarm recording: {tmp_path}/file/recordings: it, or a folder above it, is a file. Remove"
    )


@pytest.mark.parametrize(
    ("problem", "connected", "told"),
    [("", True, "connected"), ("", False, "connecting"), ("not authorised", False, "not authorised")],
)
def test_the_status_says_what_the_publisher_knows_of_the_broker(
    problem: str, connected: bool, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Publisher and control socket are sinks, and the supervisor expects a beat of each."""
    beats: list[str] = []
    expected: list[tuple[str, float]] = []
    publisher = SimpleNamespace(problem=problem, connected=connected)
    given: dict[str, Any] = {}
    monkeypatch.setattr(wiring, "Publisher", lambda *_, **options: given.update(options) or publisher)
    service: Any = SimpleNamespace(
        configuration=Configuration(mqtt=Mqtt(spool_directory=tmp_path)),
        liveness=SimpleNamespace(beat=beats.append, expect=lambda *what: expected.append(what)),
        network="the network",
        sinks=[],
        recorder=None,
    )
    wiring.connect_sinks(service, wiring.open_stores(service.configuration.mqtt))
    (mqtt,) = (sink for sink in service.sinks if isinstance(sink, MqttSink))
    (control,) = (sink for sink in service.sinks if isinstance(sink, ControlSink))
    assert (control._broker(), control._rover()) == (told, "the network")
    control._beat()
    given["beat"]()
    assert beats == ["control", "publishing"]
    assert ("control", 10.0) in expected
    control.problem = "no socket"
    assert mqtt._control_problem() == "no socket"
    control._motion.problem = "wheel 3 (node 3) at 0.000"
    assert mqtt._wheel_problem() == "wheel 3 (node 3) at 0.000"
