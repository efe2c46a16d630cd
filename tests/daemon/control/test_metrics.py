"""The metrics socket: valid text for Prometheus, for every local user, whatever other clients do."""

from __future__ import annotations

import asyncio
import shutil
import socket
import stat
import subprocess
from contextlib import ExitStack, asynccontextmanager, suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from prometheus_client.parser import text_string_to_metric_families
from recorded_traverse import ROVER, daemon

from regolithd.daemon.control.metrics import MAX_CLIENTS, MetricsSink
from regolithd.daemon.health.alarms import alarm_names
from regolithd.daemon.health.prometheus import DaemonState, exposition
from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.examples import example
from regolithd.daemon.messages.health import HealthMessage

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Mapping
    from pathlib import Path

Samples = dict[tuple[str, frozenset[tuple[str, str]]], float]
REQUEST = b"GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n"
HEALTH = HealthMessage.model_validate(next(example(each) for each in CHANNELS if each.name == "health"))
STATE = DaemonState("kapvik", HEALTH, connected=True, nodes={3: True, 13: False}, alarms={"bus": True})


def parsed(text: str) -> Samples:
    """Return the samples by name and labels, as Prometheus's own library reads them."""
    families = list(text_string_to_metric_families(text))
    assert all(family.documentation for family in families)
    assert all(family.type in {"gauge", "counter"} for family in families)
    samples = [sample for family in families for sample in family.samples]
    found = {(sample.name, frozenset(sample.labels.items())): sample.value for sample in samples}
    assert len(found) == len(samples)
    return found


def value(samples: Samples, name: str, **labels: str) -> float:
    """Return one sample of the rover kapvik."""
    return samples[name, frozenset({"rover": "kapvik", **labels}.items())]


def test_the_numbers_are_those_of_health() -> None:
    """In base units; nodes and alarms are 1 or 0."""
    health, samples = STATE.health, parsed(exposition(STATE))
    assert health.sync is not None
    assert value(samples, "process_resident_memory_bytes") == pytest.approx(health.memory_MB * 1e6)
    assert value(samples, "process_cpu_seconds_total") == health.cpu_s
    assert value(samples, "regolithd_sync_total", result="produced") == health.sync.produced
    assert value(samples, "regolithd_sync_worst_late_seconds") == pytest.approx(health.sync.worst_late_ms / 1e3)
    assert value(samples, "regolithd_mqtt_messages_total", result="acknowledged") == health.publishing.acknowledged
    assert value(samples, "regolithd_mqtt_connected") == 1.0
    assert value(samples, "regolithd_node_operational", node_id="3") == 1.0
    assert value(samples, "regolithd_node_operational", node_id="13") == 0.0
    assert value(samples, "regolithd_alarm_active", alarm="bus") == 1.0


def test_parts_that_are_not_there_are_left_out() -> None:
    """Without a bus or a recording there is no metric of them, and the text is still valid."""
    health = STATE.health.model_copy(
        update={"sync": None, "acquisition": None, "recording": None, "bus": {}, "undecodable": {}}
    )
    samples = parsed(exposition(replace(STATE, health=health)))
    assert value(samples, "regolithd_bus_open") == 0.0
    assert not [name for name, _ in samples if "sync" in name or "recording" in name]


def test_a_label_may_hold_any_text() -> None:
    """Quotes, backslashes and line ends are escaped as the format says."""
    reason = 'a "wrong"\\length\nof a PDO'
    health = STATE.health.model_copy(update={"undecodable": {reason: 3}})
    samples = parsed(exposition(replace(STATE, health=health)))
    assert value(samples, "regolithd_undecodable_frames_total", reason=reason) == 3.0


@asynccontextmanager
async def serving(path: Path, texts: Mapping[int, str]) -> AsyncIterator[list[int]]:
    """Serve the metrics; yield the list of the texts that were made."""
    made: list[int] = []

    def text() -> str:
        made.append(len(made))
        return texts.get(len(made), "up 1\n")

    running = asyncio.create_task(MetricsSink(path, text).run())
    try:
        while not path.exists():  # noqa: ASYNC110, ASYNC240  # a file has no event
            await asyncio.sleep(0.01)
        yield made
    finally:
        running.cancel()
        with suppress(asyncio.CancelledError):
            await running


async def answer(path: Path) -> bytes:
    """Return the whole answer to a request; empty if the connection is closed without one."""
    reader, writer = await asyncio.open_unix_connection(path)
    writer.write(REQUEST)
    try:
        async with asyncio.timeout(10):
            return await reader.read()
    except ConnectionResetError:
        return b""
    finally:
        writer.close()


async def test_many_requests_cost_one_text(tmp_path: Path) -> None:
    """Everybody may ask, the text is made once a second, and the file is removed at the end."""
    path = tmp_path / "metrics.sock"
    async with serving(path, {}) as made:
        assert stat.S_IMODE(path.stat().st_mode) == 0o666
        answers = [await answer(path) for _ in range(20)]
        assert len(made) <= 2
    assert {each.partition(b"\r\n\r\n")[2] for each in answers} == {b"up 1\n"}
    assert answers[0].startswith(b"HTTP/1.0 200 OK\r\nContent-Type: text/plain; version=0.0.4")
    assert not path.exists()


async def test_clients_that_send_nothing_are_disconnected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They hold their place for a bounded time, and a line without an end is refused; then others are served."""
    monkeypatch.setattr("regolithd.daemon.control.metrics.REQUEST_TIMEOUT_S", 0.3)
    path = tmp_path / "metrics.sock"
    async with serving(path, {}):
        with ExitStack() as opened:
            silent = [opened.enter_context(socket.socket(socket.AF_UNIX)) for _ in range(MAX_CLIENTS)]
            for each in silent:
                each.connect(str(path))
            await asyncio.sleep(0.1)
            assert await answer(path) == b""
            await asyncio.sleep(0.5)
            assert b"up 1" in await answer(path)
            endless = opened.enter_context(socket.socket(socket.AF_UNIX))
            endless.connect(str(path))
            endless.send(b"x" * 20_000)
            assert b"up 1" in await answer(path)


def test_a_running_daemon_answers_curl(tmp_path: Path) -> None:
    """Beside the control socket; every alarm is there, and none of the test's own."""
    if shutil.which("curl") is None:
        pytest.skip("no curl here: apt-get install curl")
    (tmp_path / "rover.toml").write_text(ROVER.format(port=1))
    command = ["curl", "--silent", "--retry", "20", "--retry-all-errors", "--retry-delay", "1"]
    with daemon(tmp_path):
        done = subprocess.run(
            [*command, "--unix-socket", tmp_path / "metrics.sock", "http://localhost/metrics"],
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        )
    samples = parsed(done.stdout)
    assert value(samples, "process_cpu_seconds_total") > 0.0
    assert value(samples, "regolithd_mqtt_connected") == 0.0
    shown = {dict(labels)["alarm"] for name, labels in samples if name == "regolithd_alarm_active"}
    assert shown >= set(alarm_names([])) or not shown
