"""The candump log: one line a frame, as can-utils write and read it (`candump -L`, `canplayer`, `log2asc`).

    (1436509052.249713) can0 181#3702F8FF00000000 R

Time in seconds with microseconds, interface, identifier in hex (three digits; eight where extended, or with the error
flag 0x20000000), data in hex (`R` for a remote request), and `T` for a frame that this computer sent, `R` for one that
it received. All of can-utils read microseconds, the duration of one bit at 1 Mbit/s; kernel times are
truncated to them.
"""

from __future__ import annotations

import re
from typing import IO, TYPE_CHECKING

from regolithd.drivers.can.frame import Frame

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path

ERROR_FLAG = 0x2000_0000
_LINE = re.compile(
    r"\((\d+)\.(\d{6}|\d{9})\) (\S+) ([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(R\d?|(?:[0-9A-Fa-f]{2})*)(?: ([TR]))?\n"
)


def frame_line(frame: Frame, interface: str) -> str:
    """Return a frame as a line of the log, newline included."""
    seconds, rest = divmod(frame.time_ns, 1_000_000_000)
    if frame.error:
        identifier = f"{frame.can_id | ERROR_FLAG:08X}"
    else:
        identifier = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
    data = "R" if frame.remote else frame.data.hex().upper()
    return f"({seconds}.{rest // 1000:06d}) {interface} {identifier}#{data} {'T' if frame.sent else 'R'}\n"


def parse_line(line: str) -> Frame | None:
    """Return the frame of a line, or None where it is not a whole line of a candump log."""
    match = _LINE.fullmatch(line)
    if match is None:
        return None
    seconds, fraction, _, identifier, data, direction = match.groups()
    can_id = int(identifier, 16)
    error = len(identifier) == 8 and bool(can_id & ERROR_FLAG)
    remote = data.startswith("R")
    return Frame(
        time_ns=int(seconds) * 1_000_000_000 + int(fraction.ljust(9, "0")),
        can_id=can_id & ~ERROR_FLAG if error else can_id,
        data=b"" if remote else bytes.fromhex(data),
        extended=len(identifier) == 8 and not error,
        remote=remote,
        error=error,
        sent=direction == "T",
    )


def open_log(path: Path) -> AbstractContextManager[IO[str]]:
    """Open a log for reading."""
    return path.open(encoding="ascii", errors="replace")


def read_log(
    path: Path,
    opening: Callable[[Path], AbstractContextManager[IO[str]]] = open_log,
    on_unreadable: Callable[[int], None] = lambda _: None,
) -> Iterator[Frame]:
    """Yield the frames of a log in their order; lines that are not frames are skipped.

    `on_unreadable` is called with the number of each, from 1; not of an incomplete last one, as a killed program leaves
    it.
    """
    with opening(path) as lines:
        for number, line in enumerate(lines, start=1):
            frame = parse_line(line)
            if frame is not None:
                yield frame
            elif line.endswith("\n"):
                on_unreadable(number)
