"""A virtual rover whose sensors tell the time, to the millisecond. For tests that run it in another process.

    python counting_rover.py CHANNEL

Wheel n reads 20 n + (t mod 2 s) · 10 N/s and n + (t mod 1 s) · 1 A/s, t being the time of the SYNC: so a value that is
lost, repeated, of another SYNC or of another wheel shows. Prints `ready`; at its end (SIGTERM) what it counted, as a
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


class Clock:
    """The plant: nothing but time."""

    def measure(self, time_s: float, motor_speed_rad_s: np.ndarray) -> Measurement:
        """Return the time in every channel."""
        del motor_speed_rad_s
        time_ms = round(1000 * time_s)
        return Measurement(
            motor_current_A=WHEEL + time_ms % 1000 / 1000,
            load_N=20 * WHEEL + time_ms % 2000 / 100,
        )


async def main(channel: str) -> None:
    """Run until SIGTERM."""
    rover = VirtualRover(Clock())
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
