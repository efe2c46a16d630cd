"""What can be wrong with a node; `drivers.virtual.fault_injection` makes it so by command."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(slots=True)
class Faults:
    """What is wrong with one node at present; as constructed, nothing."""

    silent: bool = False  # sends no PDO, though its heartbeat says operational
    frozen: bool = False  # repeats the last values for ever
    deaf: bool = False  # ignores what PDOs tell it
    no_boot_up: bool = False
    no_heartbeat: bool = False
    no_sdo: bool = False
    refused: set[int] = field(default_factory=set)  # indices whose writing is aborted with 0x06060000
    forgotten: set[int] = field(default_factory=set)  # indices whose writing is answered, and not done
    identity: dict[int, int] = field(default_factory=dict)  # sub-index of 0x1018 → what it says instead
    delay_ns: int = 0  # its PDOs come this late
    missing_bytes: int = 0  # its PDOs are this much too short
    status: int = 0  # bits of a load cell's 0x6150 that are set besides its own
