"""The identity that a device is expected to have (0x1000, 0x1018): from EDS, profile and `rover.toml`.

Of each entry, the first that is known counts:

    `rover.toml` or the profile ▸ default in the EDS (0x1000, 0x1018) ▸ [DeviceInfo] of the EDS
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.object_dictionary import known_variable, object_dictionary

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Device

DEVICE_TYPE, IDENTITY = 0x1000, 0x1018
ALL_BITS = 0xFFFFFFFF
PROFILE_BITS = 0x0000FFFF  # of the device type: the device profile's number


@dataclass(frozen=True, slots=True)
class ExpectedIdentity:
    """What is expected; None is not known. Of `device_type`, the bits of `device_type_mask` are known.

    `revision` is the one whose major number must agree; where there is a range, `revisions`, only that counts.
    """

    device_type: int | None
    device_type_mask: int
    vendor: int | None
    product: int | None
    revision: int | None
    revisions: tuple[int, int] | None


def expected_identity(device: Device) -> ExpectedIdentity:
    """Return the identity that a device is expected to have."""
    known = device.identity
    device_type = _default(device, DEVICE_TYPE)
    revision = _first(_default(device, IDENTITY, 3), _device_info(device, "revision_number"))
    return ExpectedIdentity(
        device_type=known.profile_number if device_type is None else device_type,
        device_type_mask=PROFILE_BITS if device_type is None else ALL_BITS,
        vendor=_first(known.vendor, _default(device, IDENTITY, 1), _device_info(device, "vendor_number")),
        product=_first(known.product, _default(device, IDENTITY, 2), _device_info(device, "product_number")),
        revision=None if known.revisions else revision,
        revisions=known.revisions,
    )


def identity_entries(device: Device) -> dict[int, int]:
    """Return the expected identity as a virtual node holds it: sub-indices of 0x1018, and 0x1000 at 0."""
    expected = expected_identity(device)
    own_revision = _first(_default(device, IDENTITY, 3), _device_info(device, "revision_number"))
    lowest = expected.revisions[0] if expected.revisions else None
    inside = expected.revisions and own_revision and expected.revisions[0] <= own_revision <= expected.revisions[1]
    revision = _first(own_revision if inside or lowest is None else lowest)
    known = {0: expected.device_type, 1: expected.vendor, 2: expected.product, 3: revision}
    return {subindex: value for subindex, value in known.items() if value is not None}


def _first(*values: int | None) -> int | None:
    return next((value for value in values if value is not None), None)


def _default(device: Device, index: int, subindex: int = 0) -> int | None:
    entry = known_variable(device.eds, index, subindex)
    default = None if entry is None else entry.default
    return default if isinstance(default, int) else None


def _device_info(device: Device, name: str) -> int | None:
    value = getattr(object_dictionary(device.eds).device_information, name)
    return value if isinstance(value, int) and value else None
