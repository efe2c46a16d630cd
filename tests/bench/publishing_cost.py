"""Measure the CPU time of publishing one SYNC: encode, store and send its snapshot, and the wheels' messages.

    python -m tests.bench.publishing_cost [RATE_Hz] [SECONDS]

Needs mosquitto. Writes build/figures/publishing_cost.json.
"""

from __future__ import annotations

import asyncio
import json
import sys
import tempfile
import time
from pathlib import Path

from regolithd.daemon.config.configuration import Configuration, Mqtt, SyncTiming
from regolithd.daemon.publish.encode import encode
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.spool import Spool
from regolithd.daemon.publish.stores import Stores
from tests.bench.broker import Mosquitto
from tests.bench.estimates import estimate

ROOT = Path(__file__).resolve().parents[2]


async def paced(count: int, rate_Hz: float, act: object) -> float:
    """Call `act(k)` at a rate; return the CPU time of each call, the event loop's included [µs]."""
    assert callable(act)
    loop = asyncio.get_running_loop()
    began, used = loop.time(), time.process_time()
    for k in range(count):
        act(k)
        await asyncio.sleep(max(0.0, began + (k + 1) / rate_Hz - loop.time()))
    return (time.process_time() - used) / count * 1e6


def alone(act: object, times: int = 2000) -> float:
    """Return the CPU time of a plain call [µs]."""
    assert callable(act)
    used = time.process_time()
    for k in range(times):
        act(k)
    return (time.process_time() - used) / times * 1e6


async def measure(rate_Hz: float, seconds: float) -> dict[str, float | int]:
    """Return all figures by name."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        broker = Mosquitto(place)
        broker.start()
        mqtt = Mqtt(host=broker.host, port=broker.port, spool_directory=place / "spool")
        configuration = Configuration(sync=SyncTiming(rate_Hz=rate_Hz), mqtt=mqtt)
        stores = Stores.open(configuration.mqtt.spool_directory, 100_000_000)
        publisher = Publisher(configuration, stores)
        task = asyncio.create_task(publisher.run())
        while not publisher.connected:  # noqa: ASYNC110  # the publisher has no event for it
            await asyncio.sleep(0.05)
        estimates = [estimate(k) for k in range(100)]
        snapshot, wheels = encode(estimates[0], publisher.session)
        count = int(rate_Hz * seconds)
        nothing = await paced(count, rate_Hz, lambda _: None)
        everything = await paced(count, rate_Hz, lambda k: publisher.estimate(estimates[k % 100]))
        while publisher.report.queued:  # noqa: ASYNC110  # likewise
            await asyncio.sleep(0.05)
        other = Spool(place / "other", 100_000_000)
        figures: dict[str, float | int] = {
            "rate_Hz": rate_Hz,
            "snapshots": count,
            "acknowledged": publisher.report.acknowledged,
            "snapshot_bytes": len(snapshot),
            "wheel_bytes": len(wheels[0]),
            "cpu_us_per_sync": everything - nothing,
            "cpu_us_encode": alone(lambda k: encode(estimates[k % 100], publisher.session)),
            "cpu_us_store": alone(lambda _: other.append("snapshot", snapshot)),
            "cpu_percent_at_this_rate": (everything - nothing) * rate_Hz / 1e4,
        }
        task.cancel()
        await asyncio.wait([task])
        broker.stop()
        for each in (stores, other):
            each.close()
        return figures


def main() -> None:
    """Print the figures and write them."""
    given = [float(argument) for argument in sys.argv[1:]]
    rate, seconds = (given + [100.0, 10.0][len(given) :])[:2]
    figures = asyncio.run(measure(rate, seconds))
    folder = ROOT / "build" / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "publishing_cost.json").write_text(json.dumps(figures, indent=2) + "\n")
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
