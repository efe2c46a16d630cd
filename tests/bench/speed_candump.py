"""candump beside our reader: both log the same frames of a saturated bus, at the same time. `speed` runs it on vcan.

    tests/bench/with-vcan python tests/bench/speed_candump.py SECONDS RESULT.json     sends, and measures both
    python tests/bench/speed_candump.py log FILE                                      our reader, until SIGTERM

Both ask for the same receive buffer and write the same candump log; the processor time is that of each process alone.
"""

from __future__ import annotations

import asyncio
import json
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from process_cpu import cpu_s

from regolithd.daemon.recording.candump import frame_line
from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.can.recvmmsg import CAN_FRAME

CHANNEL = "vcan0"
FASTEST_BUS = 9009
"""Frames per second of a bus with 1 Mbit/s: 111 bits each (11-bit identifier, 8 bytes of data, no stuff bits)."""
BUFFER_BYTES = 4 << 20
START_TIMEOUT_S = 60.0
REST_S = 2.0
"""Time for both to read what is left."""


async def log_frames(path: Path) -> None:
    """Log all frames, as the daemon's recorder does."""
    async with open_bus("socketcan", CHANNEL) as bus:
        with path.open("w", encoding="ascii") as log:
            async for batch in bus:
                log.write("".join([frame_line(frame, CHANNEL) for frame in batch]))


def send_frames(seconds: float) -> int:
    """Send at the rate of a saturated bus, every 2 ms what is due; return how many were sent."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sender:
        sender.bind((CHANNEL,))
        began, sent = time.monotonic(), 0
        while (elapsed_s := time.monotonic() - began) < seconds:
            while sent < elapsed_s * FASTEST_BUS:
                sender.send(CAN_FRAME.pack(0x180 + sent % 0x400, 8, sent.to_bytes(8, "little")))
                sent += 1
            time.sleep(0.002)
        return sent


def wait_for_logs(folder: Path) -> None:
    """Wait until both read the bus: each has opened its log then."""
    deadline = time.monotonic() + START_TIMEOUT_S
    while len(list(folder.glob("*.log"))) < 2:
        if time.monotonic() > deadline:
            raise TimeoutError(f"the readers did not start within {START_TIMEOUT_S:g} s")
        time.sleep(0.1)
    time.sleep(0.5)  # candump opens its socket at about the same time


def compare(seconds: float, folder: Path) -> dict[str, float | int]:
    """Return what was sent, and the processor time and the frames lost of both."""
    ours = [sys.executable, __file__, "log", str(folder / "ours.log")]
    theirs = ["candump", "-l", "-r", str(BUFFER_BYTES), CHANNEL]
    readers = [subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL) for command in (ours, theirs)]
    try:
        wait_for_logs(folder)
        used_s = [-cpu_s(reader.pid) for reader in readers]
        began = time.monotonic()
        sent = send_frames(seconds)
        rate = sent / (time.monotonic() - began)
        time.sleep(REST_S)
        used_s = [before + cpu_s(reader.pid) for before, reader in zip(used_s, readers, strict=True)]
    finally:
        for reader in readers:
            reader.terminate()
            reader.wait(10)
    (their_log,) = folder.glob("candump-*.log")
    logged = [len(path.read_text().splitlines()) for path in (folder / "ours.log", their_log)]
    return {
        "sent": sent,
        "sent_per_s": rate,
        "our_us": 1e6 * used_s[0] / sent,
        "their_us": 1e6 * used_s[1] / sent,
        "we_lost": sent - logged[0],
        "they_lost": sent - logged[1],
    }


async def log_until_terminated(path: Path) -> None:
    """Log until SIGTERM."""
    task = asyncio.ensure_future(log_frames(path))
    asyncio.get_running_loop().add_signal_handler(15, task.cancel)
    await asyncio.wait([task])


if __name__ == "__main__":
    if sys.argv[1] == "log":
        asyncio.run(log_until_terminated(Path(sys.argv[2])))
    else:
        with tempfile.TemporaryDirectory() as name:
            found = compare(float(sys.argv[1]), Path(name))
        Path(sys.argv[2]).write_text(json.dumps(found), encoding="utf-8")
