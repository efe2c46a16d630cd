"""The check of bus and nodes, with a link and a bus that the test makes."""

from __future__ import annotations

from contextlib import asynccontextmanager
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from regolithd.daemon.check import bus as bus_module
from regolithd.daemon.check.bus import check_bus, check_link, check_load, judge_link
from regolithd.daemon.config.configuration import Bus, Configuration
from regolithd.daemon.control.protocol import NodeLine, Status
from regolithd.drivers.errors import BusOpenError
from regolithd.drivers.master.scan import ScanResult

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from pathlib import Path


@pytest.fixture
def links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that makes a network link with a type and flags."""
    monkeypatch.setattr(bus_module, "_LINKS", tmp_path)

    def make(name: str, kind: str, flags: str) -> None:
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        (folder / "type").write_text(kind + "\n")
        (folder / "flags").write_text(flags + "\n")

    return make


def test_a_missing_link_is_reported_with_those_that_are_there(links: Any) -> None:
    """Links of another type are not listed."""
    (found,) = check_link(Bus(), {})
    assert (found.verdict, found.text) == ("wrong", "there is no link 'can0'; there is no CAN link at all")
    links("can3", "280", "0x1")
    links("can1", "280", "0x0")
    links("eth0", "1", "0x1")
    (found,) = check_link(Bus(), {})
    assert found.text == "there is no link 'can0'; there are can1, can3"
    (found,) = check_link(Bus(channel="eth0"), {})
    assert (found.verdict, found.text) == ("wrong", "'eth0' is no CAN link")


@pytest.mark.parametrize(
    ("flags", "verdict"), [("0x40080", "wrong"), ("0x40081", "good"), ("0x1", "good"), ("", "wrong")]
)
def test_a_link_is_up_by_its_first_flag(links: Any, flags: str, verdict: str) -> None:
    """IFF_UP is bit 0; the remedy for a link that is down has the command."""
    links("can0", "280", flags)
    (found,) = check_link(Bus(bitrate=500_000), {})
    assert found.verdict == verdict
    if verdict == "wrong":
        assert found.text == "can0 is down"
        assert "`sudo ip link set can0 up type can bitrate 500000`" in found.remedy


@pytest.mark.parametrize(
    ("data", "verdict", "text"),
    [
        (
            {"bittiming": {"bitrate": 1_000_000}, "state": "ERROR-ACTIVE"},
            "good",
            "can0 is up: 1000000 bit/s, error-active",
        ),
        ({"bittiming": {"bitrate": 500_000}}, "wrong", "can0 runs at 500000 bit/s, [bus] bitrate says 1000000"),
        ({"state": "BUS-OFF"}, "wrong", "can0 is in state bus-off"),
        ({"state": "ERROR-PASSIVE"}, "warning", "can0 is in state error-passive"),
        ({"state": "ERROR-WARNING"}, "warning", "can0 is in state error-warning"),
        ({}, "good", "can0 is up: a vcan link, which has no bit rate"),
    ],
)
def test_a_link_is_judged_by_bit_rate_and_state(data: dict[str, Any], verdict: str, text: str) -> None:
    """As iproute2 reports them."""
    found = judge_link(Bus(), {"linkinfo": {"info_kind": "vcan", "info_data": data}})
    assert (found.verdict, found.text) == (verdict, text)
    assert bool(found.remedy) == (verdict != "good")


@pytest.mark.parametrize(("rate_Hz", "verdict"), [(100, []), (150, ["warning"]), (200, ["wrong"])])
def test_a_bus_load_above_80_per_cent_is_a_warning_and_above_100_wrong(rate_Hz: float, verdict: list[str]) -> None:
    """A load that is low enough gives no line."""
    configuration = Configuration.model_validate({"bus": {"bitrate": 250_000}, "sync": {"rate_Hz": rate_Hz}})
    assert [found.verdict for found in check_load(configuration)] == verdict


def test_the_master_s_heartbeat_has_half_the_nodes_period(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both are in the bus load, from heartbeat_ms."""
    asked: dict[str, Any] = {}

    def load(_nodes: object, **given: Any) -> float:
        asked.update(given)
        return 0.8

    monkeypatch.setattr(bus_module, "bus_load", load)
    assert check_load(Configuration.model_validate({"nodes": {"heartbeat_ms": 300}})) == []
    assert asked == {"sync_rate_Hz": 2.0, "bitrate": 1_000_000, "node_heartbeat_s": 0.3, "master_heartbeat_s": 0.15}


def status(*phases: str) -> Status:
    """Return the status of a running daemon."""
    nodes = tuple(
        NodeLine(node_id=1 + k, kind="motor", wheel=k + 1, phase=phase, drive_state=None, text="")
        for k, phase in enumerate(phases)
    )
    return Status(rover="k", bus="active", broker="online", rate_Hz=2.0, snapshots=0, traverse=None, nodes=nodes)


async def test_an_interface_inside_a_process_is_not_checked() -> None:
    """There is nothing to probe."""
    (found,) = await check_bus(Configuration.model_validate({"bus": {"interface": "virtual"}}), None)
    assert (found.subject, found.verdict) == ("bus", "not checked")


async def test_nodes_are_probed_only_over_a_bus_that_is_up(links: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a link they are not checked; beside a running daemon its own status counts; else they are scanned."""
    found = await check_bus(Configuration(), None)
    assert [(each.subject, each.verdict) for each in found] == [("bus", "wrong"), ("nodes", "not checked")]
    links("can0", "280", "0x1")
    found = await check_bus(Configuration(), status("operational", "lost"))
    assert [(each.subject, each.verdict) for each in found] == [("bus", "good"), ("nodes", "good"), ("node 2", "wrong")]
    opened = []

    @asynccontextmanager
    async def open_bus(interface: str, channel: str, *, bitrate: int) -> AsyncIterator[Any]:
        opened.append((interface, channel, bitrate))
        yield SimpleNamespace()

    async def scan(_bus: object, nodes: Any) -> list[ScanResult]:
        return [ScanResult(node, answers=True, identity=None, nmt_state=None) for node in nodes]

    monkeypatch.setattr(bus_module, "open_bus", open_bus)
    monkeypatch.setattr(bus_module, "scan", scan)
    found = await check_bus(Configuration(), None)
    assert [(each.subject, each.verdict) for each in found] == [("bus", "good"), ("nodes", "good")]
    assert found[1].text == "12 of 12 answer with the expected identity: 6 motor, 6 load-cell"
    found = await check_bus(Configuration.model_validate({"bus": {"interface": "pcan", "channel": "p"}}), None)
    assert found[0].text == "pcan p is open"
    assert opened == [("socketcan", "can0", 1_000_000), ("pcan", "p", 1_000_000)]


async def test_a_bus_that_cannot_be_opened_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the driver's text and remedy."""

    @asynccontextmanager
    async def open_bus(*_arguments: object, **_options: object) -> AsyncIterator[Any]:
        raise BusOpenError("no adapter", remedy="Plug it in")
        yield

    monkeypatch.setattr(bus_module, "open_bus", open_bus)
    found = await check_bus(Configuration.model_validate({"bus": {"interface": "pcan"}}), None)
    assert [(each.subject, each.verdict, each.text, each.remedy) for each in found] == [
        ("bus", "wrong", "no adapter", "Plug it in"),
        ("nodes", "not checked", "they cannot be probed without the bus", ""),
    ]
