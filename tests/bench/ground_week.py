"""A week of one rover at 10 Hz in the ground's store: its size, how quickly the page gets what it asks, and deletion.

    python tests/bench/ground_week.py [FIGURES.json]

The store is filled directly, with the ground's tables, compression and means: a minute of a virtual rover's messages,
again and again. Then `regolithd ground` runs on it. Needs 5 GB of disk and some five minutes.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
import urllib.request
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from broker import Mosquitto
from ground_rig import GroundRig, until

from regolithd.daemon.closed_loop.simulated_drive import estimates, simulate
from regolithd.daemon.closed_loop.speed_profile import SpeedProfile
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.ground.received import parse
from regolithd.daemon.ground.settings import Store
from regolithd.daemon.ground.store.compression import compress
from regolithd.daemon.ground.store.database import open_writer, words_of
from regolithd.daemon.ground.store.messages import MessageStore
from regolithd.daemon.ground.store.retention import trim, used_bytes
from regolithd.daemon.ground.store.series import SERIES, SPANS_S
from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.examples import example
from regolithd.daemon.messages.header import time_fields
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.publish.encode import encode
from regolithd.daemon.simulator.scenario import Scenario

if TYPE_CHECKING:
    import sqlite3
    from collections.abc import Iterator

DAY_S, DAYS = 86_400, 7
RATES_HZ = {"snapshot": 10, "posterior": 2, "odometry": 2}
VARIANTS = 600
"""Different payloads of each topic."""
RANGES_S = {"4 min": 240, "1 h": 3600, "1 day": DAY_S, "7 days": DAYS * DAY_S}
SESSION = "20261115T000000Z-week"
EXAMPLES = {channel.name: example(channel) for channel in CHANNELS}


def snapshots() -> list[bytes]:
    """Return the snapshots that a daemon publishes in a minute."""
    configuration = Configuration.model_validate(
        {"sync": {"rate_Hz": 10}, "nodes": {"inclinometer": 21, "ground_speed": 22}}
    )
    time_s = np.arange(VARIANTS) / 10
    drive = simulate(Scenario(), configuration, SpeedProfile(time_s, np.full(VARIANTS, 0.3)))
    made = estimates(drive, configuration, load_models(configuration).terrain)
    return [encode(estimate, SESSION)[0] for estimate in made]


def varied(value: Any, random: np.random.Generator) -> Any:
    """Return a message's content with all digits of its numbers changed."""
    if isinstance(value, dict):
        return {name: varied(each, random) for name, each in value.items()}
    if isinstance(value, list):
        return [varied(each, random) for each in value]
    return value * random.normal(1.0, 0.1) if isinstance(value, float) else value


def payload(channel: str, time_ns: int, sequence: int, random: np.random.Generator) -> bytes:
    """Return the JSON of a message."""
    head = time_fields(time_ns) | {"session": SESSION, "sequence": sequence}
    return json.dumps(varied(EXAMPLES[channel], random) | head, separators=(",", ":")).encode()


def fill(connection: sqlite3.Connection, start_ns: int) -> int:
    """Fill the store with the week that begins at a time; return the number of messages."""
    random = np.random.default_rng(1)
    store, words, total = MessageStore(connection), words_of(connection), 0
    for channel, rate_Hz in RATES_HZ.items():
        count = DAYS * DAY_S * rate_Hz
        period_ns = 1_000_000_000 // rate_Hz
        texts = [payload(channel, start_ns + k * period_ns, k, random) for k in range(VARIANTS)]
        texts = snapshots() if channel == "snapshot" else texts
        store.add(parse("p", f"p/kapvik/{channel}", text) for text in (texts[0], texts[-1]))
        packed = [compress(text, words) for text in texts]
        (topic, session) = connection.execute("SELECT topic, session FROM message ORDER BY id DESC").fetchone()
        rows = (
            (topic, session, k, start_ns + k * period_ns, 0, packed[k % VARIANTS]) for k in range(1, count) if k != 599
        )
        connection.execute("BEGIN")
        connection.executemany("INSERT INTO message VALUES (NULL, ?, ?, ?, ?, ?, ?)", rows)
        connection.executemany(
            "INSERT OR REPLACE INTO bucket VALUES (1, ?, ?, ?, ?, 0, ?)", means(channel, texts, start_ns, session)
        )
        connection.execute("COMMIT")
        total += count
    return total


def means(channel: str, texts: list[bytes], start_ns: int, session: int) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of a channel's means; each is that of the first messages."""
    values = np.array([SERIES[channel].values(json.loads(text)) for text in texts])
    known = np.isfinite(values)
    for span_s in SPANS_S:
        per_span = span_s * RATES_HZ[channel] / len(texts)
        sums = np.stack([known.sum(0) * per_span, np.where(known, values, 0).sum(0) * per_span]).tobytes()
        first = start_ns // 1_000_000_000
        for start_s in range(first - first % span_s, first + DAYS * DAY_S, span_s):
            yield channel, span_s, start_s, session, sums


def timed(address: str) -> tuple[float, int]:
    """Return how many seconds an answer took, and its bytes."""
    begun = time.monotonic()
    with urllib.request.urlopen(address, timeout=120) as answer:
        size = len(answer.read())
    return time.monotonic() - begun, size


def answers(rig: GroundRig, end_ns: int) -> dict[str, float]:
    """Return the seconds that the page waits for each kind of answer."""
    to_ms = end_ns // 1_000_000
    paths = {"state": "/api/state", "events": "/api/log/kapvik"}
    paths |= {name: f"/api/history/kapvik?from={to_ms - 1000 * span}&to={to_ms}" for name, span in RANGES_S.items()}
    paths["1 h as CSV"] = f"/download/kapvik/snapshot.csv?from={to_ms - 3_600_000}&to={to_ms}"
    return {name: timed(rig.url + path)[0] for name, path in paths.items()}


def deletion(connection: sqlite3.Connection, end_ns: int) -> dict[str, float]:
    """Delete a twentieth of the store by its limit; return the time of the longest batch, and messages a second."""
    limit_MB = 0.95 * used_bytes(connection) / 1e6
    longest, deleted, begun = 0.0, 0, time.monotonic()
    while True:
        started = time.monotonic()
        count = trim(connection, Store(limit_MB=limit_MB), end_ns)
        longest = max(longest, time.monotonic() - started)
        if not count:
            break
        deleted += count
    return {"longest_batch_s": longest, "deleted_per_s": deleted / (time.monotonic() - begun)}


def main(figures: Path | None) -> None:
    """Fill, ask, delete, and print."""
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        (place / "data").mkdir()
        end_ns = time.time_ns() // 1_000_000_000 * 1_000_000_000
        with closing(open_writer(place / "data/ground.sqlite")) as connection:
            begun = time.monotonic()
            count = fill(connection, end_ns - DAYS * DAY_S * 1_000_000_000)
            found: dict[str, float] = {"messages": count, "filled_s": time.monotonic() - begun}
            found["size_GB"] = used_bytes(connection) / 1e9
        rig = GroundRig(place, Mosquitto(place))
        try:
            rig.broker.start()
            begun = time.monotonic()
            rig.start_ground()
            until(lambda: rig.get("/api/state")["rovers"], "the rover is known")
            found["started_s"] = time.monotonic() - begun
            found |= {f"{name}_s": seconds for name, seconds in answers(rig, end_ns).items()}
            rig.stop("ground")
        finally:
            rig.end()
            rig.broker.stop()
        with closing(open_writer(place / "data/ground.sqlite")) as connection:
            found |= deletion(connection, end_ns)
    for name, value in found.items():
        print(f"{name:20} {value:.4g}")
    if figures:
        figures.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
