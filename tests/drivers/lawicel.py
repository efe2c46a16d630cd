"""An emulated LAWICEL adapter: a pty for the kernel's slcan driver, which makes it a CAN link with controller states.

The kernel's side is a link that `ip` lists (`slcan0`, …); this side sends what an adapter reports of the bus: frames,
error counters, bus-off. The lines are those of the LAWICEL protocol, as linux/drivers/net/can/slcan reads them.
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
    """A link with an emulated adapter; `with Adapter() as adapter: … adapter.link`."""

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
        """Close the adapter: the kernel's link vanishes."""
        if self._kernels >= 0:
            os.close(self._kernels)
            self._kernels = -1
            self._taking.join(5)
            os.close(self._ours)

    def ip(self, *words: str) -> None:
        """Run `ip`."""
        subprocess.run(["ip", *words], check=True)

    def send_line(self, line: str) -> None:
        """Send a line to the kernel."""
        os.write(self._ours, line.encode() + b"\r")

    def frame(self, can_id: int, data: bytes) -> None:
        """Send a received frame to the kernel."""
        self.send_line(f"t{can_id:03X}{len(data)}{data.hex()}")

    def block(self) -> None:
        """Stop reading from the kernel, as if no node acknowledged."""
        self._may_take.clear()

    def unblock(self) -> None:
        """Read again."""
        self._may_take.set()

    def _take(self) -> None:
        while True:
            self._may_take.wait()
            try:
                if not os.read(self._ours, 256):
                    return
            except OSError:
                return  # the kernel's side is closed
