"""The benchmark of the readers: what is compared, and the figures, without a CAN link."""

from __future__ import annotations

import asyncio
import itertools
import json
import math
import socket
import sys
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Self

import can
import pytest

from regolithd.drivers import benchmark
from regolithd.drivers.benchmark import DATA, LAST, DecodedValues, check, compare, decoding_time, our_decoder
from regolithd.drivers.can.frame import Frame

if TYPE_CHECKING:
    from collections.abc import AsyncIterator
    from pathlib import Path


def test_both_decoders_give_the_same_values() -> None:
    """200 TPDOs of motor 1; the last one has 199 mA and −199 rpm."""
    assert len(DATA) == 200
    values = our_decoder()
    assert values(Frame(0, 0x181, DATA[-1])) == pytest.approx((0x0637, 0.199, -199 * math.pi / 30))
    assert pytest.approx((0x0637, 0.199, -199 * math.pi / 30)) == LAST
    taken: list[tuple[float, ...]] = []
    network = benchmark.their_network(taken.append)
    for data in DATA:
        network.notify(0x181, bytearray(data), 0.0)
    assert len(taken) == 200
    assert taken[7] == pytest.approx(values(Frame(0, 0x181, DATA[7])))
    with pytest.raises(TypeError, match="is no reading"):
        values(Frame(0, 0x701, b"\x05"))


def test_a_wrong_value_ends_the_benchmark() -> None:
    """The times of a decoder that is wrong are of no use."""
    check(LAST)
    with pytest.raises(AssertionError, match="sent was"):
        check((LAST[0], LAST[1], 0.0))


def test_times_are_per_frame_in_microseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ours and theirs are measured one after the other."""
    times = iter([1.0, 1.002, 1.012])
    monkeypatch.setattr(benchmark.time, "process_time", lambda: next(times))
    assert decoding_time() == pytest.approx((10.0, 50.0))


async def test_a_count_of_frames_is_waited_for() -> None:
    """Exactly so many more must come, and the last values are kept."""
    decoded = DecodedValues()
    assert (decoded.count, decoded.last) == (0, (0.0, 0.0, 0.0))
    for count in (3, 2):
        waiting = asyncio.ensure_future(decoded.more(count))
        for number in range(count):
            await asyncio.sleep(0)
            assert not waiting.done()
            decoded.take((0.0, 0.0, float(number)))
        await asyncio.wait_for(waiting, 10)
    assert (decoded.count, decoded.last) == (5, (0.0, 0.0, 1.0))


async def test_rounds_are_taken_in_turns(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a link only the decoders are compared."""
    order: list[str] = []

    async def reading(way: object, channel: str) -> tuple[float, float]:
        order.append("ours" if way is benchmark.ours else "theirs")
        assert channel == "vcan7"
        return (1.0, 2.0) if way is benchmark.ours else (3.0, 4.0)

    def decoding() -> tuple[float, float]:
        order.append("decode")
        return 5.0, 6.0

    monkeypatch.setattr(benchmark, "reading_time", reading)
    monkeypatch.setattr(benchmark, "decoding_time", decoding)
    assert await compare(None) == {"decode": [(5.0, 6.0)] * 15}
    order.clear()
    found = await compare("vcan7")
    assert found == {"decode": [(5.0, 6.0)] * 15, "burst": [(1.0, 3.0)] * 15, "single": [(2.0, 4.0)] * 15}
    assert order == ["decode", "ours", "theirs"] * 15


def test_the_best_round_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The figures are the smallest time of each, and their ratio; the channel is vcan0 unless another is given."""
    asked: list[str] = []

    async def reachable(channel: str) -> str:
        asked.append(channel)
        return channel

    async def rounds(_channel: str | None) -> dict[str, list[tuple[float, float]]]:
        return {"decode": [(4.0, 9.0), (2.0, 10.0), (3.0, 8.0)]}

    monkeypatch.setattr(benchmark, "reachable", reachable)
    monkeypatch.setattr(benchmark, "compare", rounds)
    monkeypatch.setattr(benchmark, "FIGURES", tmp_path / "figures" / "benchmark.json")
    for arguments in (["benchmark"], ["benchmark", "can1"]):
        monkeypatch.setattr(benchmark.sys, "argv", arguments)
        benchmark.main()
    assert asked == ["vcan0", "can1"]
    assert json.loads((tmp_path / "figures/benchmark.json").read_text()) == {
        "decode_ours_us": 2.0,
        "decode_theirs_us": 8.0,
        "decode_ratio": 4.0,
    }
    assert capsys.readouterr().out.splitlines()[:2] == [
        "µs per frame        ours   python-can, canopen   times",
        "decode              2.00                  8.00     4.0",
    ]


async def test_a_link_that_is_not_there_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    """The decoders alone are compared then."""
    assert await benchmark.reachable("no-such-link") is None
    assert capsys.readouterr().err.endswith("\nThe decoders alone:\n")


class Sender:
    """A raw CAN socket whose frames the reader under test decodes at the loop's next turn."""

    def __init__(self) -> None:
        self.decoded, self.bound, self.sent = DecodedValues(), "", 0
        self._values = our_decoder()

    def opened(self, *kind: int) -> Self:
        """Return it in the place of socket.socket()."""
        assert kind == (socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is open."""

    def bind(self, address: tuple[str]) -> None:
        """Note the channel."""
        (self.bound,) = address

    def send(self, data: bytes) -> None:
        """Decode struct can_frame: identifier, length, padding, data."""
        can_id, length = int.from_bytes(data[:4], sys.byteorder), data[4]
        assert (can_id, length, len(data)) == (0x181, 8, 16)
        self.sent += 1
        asyncio.get_running_loop().call_soon(self.decoded.take, self._values(Frame(0, can_id, data[8:])))


async def test_a_burst_and_single_frames_are_timed_per_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two hundred frames at once, then one by one, in microseconds: the clock advances by 2 ms between two looks."""
    sender = Sender()
    ticks = itertools.count(0.0, 0.002)

    @asynccontextmanager
    async def way(channel: str) -> AsyncIterator[DecodedValues]:
        assert channel == "vcan7"
        yield sender.decoded

    monkeypatch.setattr(benchmark.socket, "socket", sender.opened)
    monkeypatch.setattr(benchmark.time, "process_time", lambda: next(ticks))
    burst_us, single_us = await benchmark.reading_time(way, "vcan7")
    assert burst_us == pytest.approx(2000 / 200)
    assert single_us == pytest.approx(2000)
    assert (sender.bound, sender.sent, sender.decoded.count) == ("vcan7", 400, 400)


async def test_our_reader_decodes_every_frame_of_every_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    """As the bus gives them."""
    batches = [[Frame(0, 0x181, data) for data in DATA[:150]], [Frame(0, 0x181, data) for data in DATA[150:]]]

    async def reading() -> AsyncIterator[list[Frame]]:
        for batch in batches:
            yield batch
        await asyncio.sleep(60)

    @asynccontextmanager
    async def opened(interface: str, channel: str) -> AsyncIterator[AsyncIterator[list[Frame]]]:
        assert (interface, channel) == ("socketcan", "vcan7")
        yield reading()

    monkeypatch.setattr(benchmark, "open_bus", opened)
    async with asyncio.timeout(20), benchmark.ours("vcan7") as decoded:
        await decoded.more(200)
        assert decoded.last == pytest.approx(LAST)


async def test_their_reader_is_python_can_s_notifier(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a virtual link here; it hears its own frames, as ours does."""
    given: list[tuple[str, dict[str, object]]] = []

    def opened(channel: str, **options: object) -> can.BusABC:
        given.append((channel, options))
        return can.interface.Bus(channel, interface="virtual", receive_own_messages=True)

    monkeypatch.setattr(benchmark.can, "Bus", opened)
    async with asyncio.timeout(20), benchmark.theirs("benchmark") as decoded:
        with can.interface.Bus("benchmark", interface="virtual") as other:
            for data in DATA[-3:]:
                other.send(can.Message(0, 0x181, is_extended_id=False, data=data))
            await decoded.more(3)
        assert decoded.last == pytest.approx(LAST)
    assert given == [("benchmark", {"interface": "socketcan", "receive_own_messages": True})]
