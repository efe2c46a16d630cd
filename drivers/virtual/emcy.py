"""EMCY (CiA 301, 7.2.7): error register, error history and message.

byte 0–1  error code      byte 2  error register (0x1001)      byte 3–7  manufacturer-specific
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.drivers.virtual.object_dictionary import Dictionary

REGISTER, HISTORY, COB_ID_OBJECT = 0x1001, 0x1003, 0x1014
_HISTORY_LENGTH = 8
_DISABLED = 0x8000_0000

NO_ERROR = 0x0000
HEARTBEAT_LOST = 0x8130
PDO_TOO_SHORT = 0x8210
PDO_TOO_LONG = 0x8220

_REGISTER_BITS = {0x2: 0x02, 0x3: 0x04, 0x4: 0x08, 0x8: 0x10, 0xFF: 0x80}
"""Error code's class → error register: current, voltage, temperature, communication, manufacturer-specific."""


class EmergencyProducer:
    """Raises and clears a node's errors; `emit` sends a frame."""

    def __init__(self, dictionary: Dictionary, emit: Callable[[int, bytes], None]) -> None:
        self._dictionary = dictionary
        self._emit = emit
        self.active: list[int] = []

    def reset(self) -> None:
        """Clear all errors at a reset; nothing is sent."""
        self.active = []

    def set(self, code: int, detail: bytes = b"") -> None:
        """Report an error, once for as long as it lasts."""
        if code in self.active:
            return
        self.active.append(code)
        self._remember(code)
        self._send(code, detail)

    def report(self, code: int, detail: bytes = b"") -> None:
        """Report an error that does not last."""
        self._remember(code)
        self._send(code, detail)

    def clear(self, code: int | None = None) -> None:
        """End one error, or all (None), and send error code 0 (CiA 301: 'error reset or no error')."""
        before = list(self.active)
        self.active = [] if code is None else [other for other in before if other != code]
        if self.active != before:
            self._send(NO_ERROR, b"")

    def _remember(self, code: int) -> None:
        dictionary = self._dictionary
        for sub in range(_HISTORY_LENGTH, 1, -1):
            dictionary.put(HISTORY, sub, dictionary.get(HISTORY, sub - 1, missing=0))
        dictionary.put(HISTORY, 1, code)
        dictionary.put(HISTORY, 0, min(dictionary.get(HISTORY, 0, missing=0) + 1, _HISTORY_LENGTH))

    def _send(self, code: int, detail: bytes) -> None:
        register = 0
        for active in {*self.active, code} - {NO_ERROR}:
            register |= 0x01 | _REGISTER_BITS.get(active >> 12, 0) | _REGISTER_BITS.get(active >> 8, 0)
        self._dictionary.put(REGISTER, 0, register)
        cob_id = self._dictionary.get(COB_ID_OBJECT, missing=_DISABLED)
        if not cob_id & _DISABLED:
            self._emit(cob_id & 0x7FF, struct.pack("<HB5s", code, register, detail))
