"""The benchmark of the readers: what is compared, and the figures, without a CAN link."""

from __future__ import annotations

import asyncio
import json
import math
from typing import TYPE_CHECKING

import pytest

from regolithd.drivers import benchmark
from regolithd.drivers.benchmark import DATA, LAST, DecodedValues, check, compare, decoding_time, our_decoder
from regolithd.drivers.can.frame import Frame

if TYPE_CHECKING:
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
    monkeypatch.setattr(benchmark.time, "perf_counter", lambda: next(times))
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
