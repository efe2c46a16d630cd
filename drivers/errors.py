"""The exceptions of the drivers, all derived from `DriverError`.

    DriverError
    ├── BusError (OSError)
    │   ├── BusOpenError (ConnectionError)   no such interface, no permission, no kernel support
    │   ├── BusDownError (ConnectionError)   link down, bus-off or adapter gone: nothing can be sent
    │   └── BusFullError (TimeoutError)      the transmit queue stayed full for the whole retry time
    ├── DictionaryError (ValueError)         an EDS lacks an object, or maps what does not fit a PDO
    ├── SdoError
    │   ├── SdoTimeoutError (TimeoutError)   the node did not answer
    │   ├── SdoInterruptedError (ConnectionResetError)   the node restarted in the middle of the transfer
    │   ├── SdoAbortError                    the node (or we) aborted the transfer; carries the abort code
    │   └── SdoProtocolError (ValueError)    the node answered something that CiA 301 does not allow
    │       └── SdoBlockOfferedError         it answered a segmented upload with a block upload
    └── DriveError (RuntimeError)            a drive did not reach the state, or must not be commanded now

For example, reading 0x1018:01 of a node that is switched off raises

    SdoTimeoutError: node 3, object 0x1018:01: no answer within 0.5 s. Is the node powered, and is its node-ID 3?

Every message names the node, the object where there is one, what happened, and the remedy where one is known. A node
that cannot be booted raises `BootError` (`drivers.master.boot_error`), which is a `DriverError` too.
"""

from __future__ import annotations


class DriverError(Exception):
    """Base class of every exception that the drivers raise.

    Parameters
    ----------
    what
        What happened, without a full stop.
    node_id, index, subindex
        Where it happened; at the start of the message.
    remedy
        What to do about it; at the end of the message.
    """

    def __init__(
        self,
        what: str,
        *,
        node_id: int | None = None,
        index: int | None = None,
        subindex: int = 0,
        remedy: str = "",
    ) -> None:
        self.what = what
        self.node_id = node_id
        self.index = index
        self.subindex = subindex
        self.remedy = remedy
        super().__init__(self._message())

    def locate(self, node_id: int) -> None:
        """Add the node-ID where it was not known when the error was raised."""
        self.node_id = node_id
        self.args = (self._message(),)

    def _message(self) -> str:
        places = []
        if self.node_id is not None:
            places.append(f"node {self.node_id}")
        if self.index is not None:
            places.append(f"object 0x{self.index:04X}:{self.subindex:02X}")
        place = ", ".join(places)
        message = f"{place}: {self.what}" if place else self.what
        return f"{message}. {self.remedy}" if self.remedy else message


class BusError(DriverError, OSError):
    """The bus itself cannot be used."""


class BusOpenError(BusError, ConnectionError):
    """The bus cannot be opened."""


class BusDownError(BusError, ConnectionError):
    """The link is down, the controller is bus-off or the adapter is gone; frames cannot be sent."""


class BusFullError(BusError, TimeoutError):
    """The transmit queue stayed full for the whole retry time; the frame was not sent."""


class DictionaryError(DriverError, ValueError):
    """An EDS file lacks an object, or does not allow a PDO mapping."""


class SdoError(DriverError):
    """An SDO transfer failed."""


class SdoTimeoutError(SdoError, TimeoutError):
    """The node did not answer an SDO request."""


class SdoInterruptedError(SdoError, ConnectionResetError):
    """The node restarted in the middle of a transfer."""


class SdoAbortError(SdoError):
    """An SDO transfer was aborted; `code` is CiA 301's abort code."""

    def __init__(self, code: int, text: str, *, node_id: int | None, index: int, subindex: int) -> None:
        self.code = code
        super().__init__(f"aborted with 0x{code:08X}: {text}", node_id=node_id, index=index, subindex=subindex)


class SdoProtocolError(SdoError, ValueError):
    """A node's SDO answer is not what CiA 301 allows at this point of the transfer."""


class SdoBlockOfferedError(SdoProtocolError):
    """A node answered the request of a segmented upload with a block upload."""


class DriveError(DriverError, RuntimeError):
    """A drive did not reach the wanted state, or must not be commanded in the state it is in."""
