"""An emulated LAWICEL adapter: a pty behind the kernel's slcan driver, which makes of it a real CAN link with states.

The kernel's side is a link that `ip` lists (`slcan0`, …); this side says what the wire would: frames, error counters,
bus-off. The lines are those of the LAWICEL protocol, as linux/drivers/net/can/slcan reads them.
"""

from __future__ import annotations

import fcntl
import os
import pty
import subprocess
import termios
import threading
import tty
from typing import Self

_N_SLCAN = 17  # line discipline
_SIOCGIFNAME = 0x8910


class Adapter:
    """A link with an emulated adapter behind it; `with Adapter() as adapter: … adapter.link`."""

    def __enter__(self) -> Self:
        self._ours, self._kernels = pty.openpty()
        tty.setraw(self._kernels)
        fcntl.ioctl(self._kernels, termios.TIOCSETD, _N_SLCAN.to_bytes(4, "little"))
        name = fcntl.ioctl(self._kernels, _SIOCGIFNAME, bytes(16))
        self.link = name.split(b"\0")[0].decode()
        self._may_take = threading.Event()
        self._may_take.set()
        self._taking = threading.Thread(target=self._take, daemon=True)
        self._taking.start()
        self.ip("link", "set", self.link, "type", "can", "bitrate", "1000000")
        self.ip("link", "set", self.link, "up")
        return self

    def __exit__(self, *_: object) -> None:
        self._may_take.set()
        self.ip("link", "set", self.link, "down")
        self.unplug()

    def unplug(self) -> None:
        """Take the adapter away: the kernel's link vanishes."""
        if self._kernels >= 0:
            os.close(self._kernels)
            self._kernels = -1
            self._taking.join(5)
            os.close(self._ours)

    def ip(self, *words: str) -> None:
        """Run `ip`."""
        subprocess.run(["ip", *words], check=True)

    def say(self, line: str) -> None:
        """Let the adapter say a line."""
        os.write(self._ours, line.encode() + b"\r")

    def frame(self, can_id: int, data: bytes) -> None:
        """Let a frame arrive from the wire."""
        self.say(f"t{can_id:03X}{len(data)}{data.hex()}")

    def block(self) -> None:
        """Take nothing more from the kernel: nobody acknowledges on the wire."""
        self._may_take.clear()

    def unblock(self) -> None:
        """Take again."""
        self._may_take.set()

    def _take(self) -> None:
        while True:
            self._may_take.wait()
            try:
                if not os.read(self._ours, 256):
                    return
            except OSError:
                return  # the kernel's side is closed
