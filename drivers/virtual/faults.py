"""The faults that a virtual node can have; `drivers.virtual.fault_injection` sets them by command."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(slots=True)
class Faults:
    """The present faults of one node; none as constructed."""

    silent: bool = False  # sends no PDO, though its heartbeat reports operational
    frozen: bool = False  # repeats the last values
    deaf: bool = False  # ignores RPDOs
    no_boot_up: bool = False
    no_heartbeat: bool = False
    no_sdo: bool = False
    refused: set[int] = field(default_factory=set)  # indices whose writing is aborted with 0x06060000
    forgotten: set[int] = field(default_factory=set)  # indices whose writing is acknowledged, and not done
    identity: dict[int, int] = field(default_factory=dict)  # sub-index of 0x1018 → value that it reports instead
    delay_ns: int = 0  # its TPDOs are this late
    missing_bytes: int = 0  # its TPDOs are this many bytes too short
    status: int = 0  # bits that are set in its status object (0x6150 of a load cell), besides its own
