"""Single flipped bits in files that the daemon reads: each is noticed, or changes nothing."""

from __future__ import annotations

import json
import random
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from driven import batches

from regolithd.calibration.models import TERRAIN_MODEL
from regolithd.calibration.models.onnx_session import ModelError, open_session
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.publish.spool import Spool
from regolithd.daemon.recording.mcap_file import McapFile, read_messages
from regolithd.daemon.recording.recorder import Recorder
from regolithd.daemon.recording.replay import replay_logs

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

RECORDS, MESSAGES, SNAPSHOTS = 60, 40, 12


@dataclass
class Flips:
    """Bits flipped in one kind of file, and what came of them. `silent`: other content without a word."""

    bits: int = 0
    harmless: int = 0
    noticed: int = 0
    silent: int = 0
    fatal: int = 0


def flip_bits(whole: bytes, bits: int, seed: int, read: Callable[[bytes], bool | None]) -> Flips:
    """Flip each of `bits` random bits alone; `read` returns None where nothing differs, or whether it was noticed."""
    chance, found = random.Random(seed), Flips()
    for _ in range(bits):
        damaged = bytearray(whole)
        bit = chance.randrange(8 * len(whole))
        damaged[bit // 8] ^= 1 << bit % 8
        try:
            noticed = read(bytes(damaged))
        except Exception:  # noqa: BLE001  # the daemon, or the command, would have ended
            found.fatal += 1
        else:
            found.harmless += noticed is None
            found.noticed += noticed is True
            found.silent += noticed is False
        found.bits += 1
    return found


def queue_file(folder: Path, bits: int, seed: int) -> Flips:
    """A file of the store: all records come back, or those that do not are counted."""
    stored = {k: ("snapshot" if k % 3 else "alarm/bus", json.dumps({"sequence": k}).encode()) for k in range(RECORDS)}
    spool = Spool(folder / "queue", 1_000_000)
    for topic, payload in stored.values():
        spool.append(topic, payload)
    spool.close()
    (path,) = (folder / "queue").glob("*.segment")

    def read(damaged: bytes) -> bool | None:
        path.write_bytes(damaged)
        opened = Spool(folder / "queue", 1_000_000)
        try:
            records = opened.read(0)
            if any((record.topic, record.payload) != stored[record.index] for record in records):
                return False
            missing = RECORDS - len(records)
            return (opened.counters.damaged + opened.counters.torn >= missing) if missing else None
        finally:
            opened.close()

    return flip_bits(path.read_bytes(), bits, seed, read)


def cursor(folder: Path, bits: int, seed: int) -> Flips:
    """The file that says what is acknowledged: nothing that waits is forgotten; repetitions are allowed."""
    spool = Spool(folder / "cursor", 1_000_000)
    for k in range(RECORDS):
        spool.append("snapshot", b"%d" % k)
    spool.acknowledge(RECORDS // 2, RECORDS // 2)
    spool.close()
    path = folder / "cursor/acknowledged"

    def read(damaged: bytes) -> bool | None:
        path.write_bytes(damaged)
        opened = Spool(folder / "cursor", 1_000_000)
        try:
            indices = [record.index for record in opened.read(opened.first)]
            if indices[-1:] != [RECORDS - 1] or indices[0] > RECORDS // 2:
                return False
            return None if indices[0] == RECORDS // 2 else True
        finally:
            opened.close()

    return flip_bits(path.read_bytes(), bits, seed, read)


def recording(folder: Path, bits: int, seed: int) -> Flips:
    """A recording (MCAP): each message that is read was recorded so, and a gap is named where one is missing."""
    path = folder / "flipped.mcap"
    file = McapFile(path.open("wb"), {"configuration": "{}"})
    for k in range(MESSAGES):
        file.write("event" if k % 3 else "snapshot", k, json.dumps({"sequence": k, "load_N": [k / 7] * 6}).encode(), k)
        if k % 10 == 9:
            file.flush()
    file.close()
    expected = list(read_messages(path))

    def read(damaged: bytes) -> bool | None:
        path.write_bytes(damaged)
        gaps: list[str] = []
        messages = list(read_messages(path, on_gap=gaps.append))
        if any(message not in expected for message in messages):
            return False
        return None if messages == expected else bool(gaps)

    return flip_bits(path.read_bytes(), bits, seed, read)


def log(folder: Path, bits: int, seed: int) -> Flips:
    """A candump log: it has no checksum, but a replay that gives other numbers than were recorded says so."""
    configuration = Configuration()
    models = load_models(configuration)
    recorder = Recorder(configuration.recording.model_copy(update={"directory": folder / "log"}), "can0", {})
    chain = Chain(configuration, models)
    for batch in batches(SNAPSHOTS, seed):
        recorder.frames(batch)
        for estimate in chain.feed(batch):
            recorder.estimate(estimate)
    recorder.close()
    (path,) = (folder / "log").glob("*.log")
    digest = str(replay_logs([path], configuration, models).digest)

    def read(damaged: bytes) -> bool | None:
        path.write_bytes(damaged)
        result = replay_logs([path], configuration, models)
        return None if str(result.digest) == digest else bool(result.different)

    return flip_bits(path.read_bytes(), bits, seed, read)


def model(folder: Path, bits: int, seed: int) -> Flips:
    """An ONNX model: it is refused, or gives the same numbers."""
    path = folder / "flipped.onnx"
    inputs = np.array([[50.0, 0.02, 0.08]], np.float32)

    def answer(source: Path) -> bytes:
        session = open_session(source, "")
        (numbers,) = session.run(None, {session.get_inputs()[0].name: inputs})
        return np.asarray(numbers).tobytes()

    right = answer(TERRAIN_MODEL)

    def read(damaged: bytes) -> bool | None:
        path.write_bytes(damaged)
        try:
            return None if answer(path) == right else False
        except ModelError:
            return True

    return flip_bits(TERRAIN_MODEL.read_bytes(), bits, seed, read)


KINDS = {
    "files of the store": queue_file,
    "acknowledgement files": cursor,
    "recordings (MCAP)": recording,
    "logs (candump)": log,
    "ONNX models": model,
}
SHARES = {"logs (candump)": 0.04}
"""Share of the bits of one kind; the others get equal parts of the rest. A replay takes long."""


def flip_all(folder: Path, bits: int, seed: int) -> dict[str, Flips]:
    """Flip so many bits in all, and return the result of each kind of file."""
    rest = (1 - sum(SHARES.values())) / (len(KINDS) - len(SHARES))
    return {name: kind(folder, round(bits * SHARES.get(name, rest)), seed) for name, kind in KINDS.items()}
