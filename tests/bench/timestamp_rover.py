"""A virtual rover whose readings encode the time of the SYNC, to 1 ms. For tests that run it in another process.

    python timestamp_rover.py CHANNEL

Wheel n reads 20 n + (t mod 2 s) · 10 N/s and n + (t mod 1 s) · 1 A/s, t being the time of the SYNC: a reading that is
lost, repeated, or of another SYNC or wheel can be identified. Prints `ready`; at its end (SIGTERM) its counters, as a
line of JSON.
"""

from __future__ import annotations

import asyncio
import json
import signal
import sys

import numpy as np

from regolithd.drivers.can.open_bus import open_bus
from regolithd.drivers.virtual import Measurement, VirtualRover

WHEEL = np.arange(1, 7)


class TimestampPlant:
    """A plant whose loads and currents encode the time."""

    def measure(self, time_s: float, motor_speed_rad_s: np.ndarray) -> Measurement:
        """Return loads and currents that encode the wheel's number and the time."""
        del motor_speed_rad_s
        time_ms = round(1000 * time_s)
        return Measurement(
            motor_current_A=WHEEL + time_ms % 1000 / 1000,
            load_N=20 * WHEEL + time_ms % 2000 / 100,
        )


async def main(channel: str) -> None:
    """Run until SIGTERM."""
    rover = VirtualRover(TimestampPlant())
    ended = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ended.set)
    async with open_bus("socketcan", channel) as bus, asyncio.TaskGroup() as tasks:
        running = tasks.create_task(rover.run(bus))
        print("ready", flush=True)
        await ended.wait()
        running.cancel()
    print(json.dumps(rover.counts() | {"reader": bus.counters.as_dict()}), flush=True)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
