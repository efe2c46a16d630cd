"""Why a node could not be booted, and what to do about it."""

from __future__ import annotations

from enum import StrEnum

from regolithd.drivers.errors import DriverError


class BootReason(StrEnum):
    """Why a node could not be booted. The letter is that of CiA 302-2's boot-slave process, where it has one."""

    NO_BOOT_UP = "no-boot-up"  # E/F: silent after the NMT reset
    NO_SDO_ANSWER = "no-sdo-answer"  # B: no answer for 0x1000
    WRONG_DEVICE_TYPE = "wrong-device-type"  # C: 0x1000 is another profile's
    WRONG_VENDOR = "wrong-vendor"  # D: 0x1018:01
    WRONG_PRODUCT = "wrong-product"  # M: 0x1018:02
    WRONG_REVISION = "wrong-revision"  # N: 0x1018:03
    WRONG_SERIAL = "wrong-serial"  # O: 0x1018:04
    CONFIGURATION_REFUSED = "configuration-refused"  # J: the node aborted a write
    FIXED_OTHERWISE = "fixed-otherwise"  # an object that cannot be written has another value than is needed
    UNKNOWN_UNIT = "unknown-unit"  # the device states no unit, or an implausible one
    CONFIGURATION_NOT_KEPT = "configuration-not-kept"  # J: a write was acknowledged, but another value is read back
    FELL_SILENT = "fell-silent"  # J: it stopped answering during the configuration
    RESTARTED = "restarted"  # it booted up again during the configuration
    MALFORMED_ANSWER = "malformed-answer"  # its SDO answers do not comply with CiA 301
    NO_HEARTBEAT = "no-heartbeat"  # K: although one is configured
    NOT_OPERATIONAL = "not-operational"  # it does not enter operational
    UNUSABLE_EDS = "unusable-eds"  # the EDS lacks an object that the boot configuration needs
    BUS_DOWN = "bus-down"  # nothing can be sent


REMEDIES = {
    BootReason.NO_BOOT_UP: "Is it powered and wired, is its node-ID right, and has the bus its two 120 Ω terminators?",
    BootReason.NO_SDO_ANSWER: "Does another device use this node-ID? If not, the node hangs: power it off and on",
    BootReason.WRONG_DEVICE_TYPE: "Another kind of device has this node-ID: correct the wiring, or rover.toml",
    BootReason.WRONG_VENDOR: "Another maker's device has this node-ID: correct the wiring, or name its profile and EDS "
    "in [devices]",
    BootReason.WRONG_PRODUCT: "Another product has this node-ID: correct the wiring, or name its EDS, or `product`, in "
    "[devices]",
    BootReason.WRONG_REVISION: "Where this firmware is meant, state the range: `revisions = [lowest, highest]` in "
    "[devices]",
    BootReason.WRONG_SERIAL: "The device was exchanged: put its serial number into rover.toml, and calibrate it",
    BootReason.CONFIGURATION_REFUSED: "The device does not allow what its EDS says: name the EDS of its firmware in "
    "[devices] eds, or set the object with the maker's program",
    BootReason.FIXED_OTHERWISE: "Set it with the maker's own program, or choose fitting objects and units in [devices]",
    BootReason.UNKNOWN_UNIT: "Set it in the drive with the maker's program, or state the unit in [devices.….objects]",
    BootReason.CONFIGURATION_NOT_KEPT: "The device changes the value by itself: compare its EDS, update its firmware",
    BootReason.FELL_SILENT: "Its supply or its plug may be loose; it is tried again",
    BootReason.RESTARTED: "Its supply may be too weak; it is tried again",
    BootReason.MALFORMED_ANSWER: "Two devices may share this node-ID, or its firmware breaks CiA 301",
    BootReason.NO_HEARTBEAT: "It takes a heartbeat time and sends none: check its firmware",
    BootReason.NOT_OPERATIONAL: "It may refuse because of an error of its own: see its emergency messages",
    BootReason.UNUSABLE_EDS: "`regolithd check` lists what the EDS lacks; name the complete EDS in [devices] eds",
    BootReason.BUS_DOWN: "Bring the link up: `ip link set can0 up type can bitrate 1000000 restart-ms 100`",
}


class BootError(DriverError):
    """A node could not be booted; `reason` says why, and determines the remedy in the message."""

    def __init__(
        self, reason: BootReason, what: str, *, node_id: int, index: int | None = None, subindex: int = 0
    ) -> None:
        self.reason = reason
        super().__init__(what, node_id=node_id, index=index, subindex=subindex, remedy=REMEDIES[reason])
