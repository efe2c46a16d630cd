"""Boot failures: each has its own reason, text and remedy, and needs no restart of the master."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rig import rig

from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.errors import DictionaryError
from regolithd.drivers.master.boot_error import REMEDIES, BootReason
from regolithd.drivers.master.events import NodeBooted, NodeBootFailed
from regolithd.drivers.master.network import NodePhase

MOTOR = NodeDescription(4, MOTOR_CONTROLLER, 3)
CELL = NodeDescription(11, LOAD_CELL, 0)

FAULTS = {
    BootReason.NO_BOOT_UP: "no-boot-up 4",
    BootReason.NO_SDO_ANSWER: "no-sdo 4",
    BootReason.WRONG_VENDOR: "identity 4 vendor 0x1",
    BootReason.WRONG_PRODUCT: "identity 4 product 0x999",
    BootReason.WRONG_REVISION: "identity 4 revision 0x99990000",
    BootReason.CONFIGURATION_REFUSED: "refuse 4 0x1A00",
    BootReason.CONFIGURATION_NOT_KEPT: "forget 4 0x1800",
    BootReason.NO_HEARTBEAT: "no-heartbeat 4",
}


@pytest.mark.parametrize("reason", FAULTS)
async def test_a_boot_failure_has_its_reason_and_the_repaired_node_boots(reason: BootReason) -> None:
    """The reason has a remedy, a second node is not affected, and the node boots once the fault is cleared."""
    async with rig([MOTOR, CELL], faults=[FAULTS[reason]]) as r:
        failed = await r.wait_for_event(NodeBootFailed)
        assert (failed.node_id, failed.reason, failed.remedy) == (4, reason, REMEDIES[reason])
        assert "node 4" in failed.text
        assert failed.remedy in failed.text
        await r.wait_for_event(NodeBooted, node_id=11)
        assert r.network.status[4].phase in (NodePhase.FAILED, NodePhase.BOOTING)
        for line in ("clear 4", "off 4", "on 4") if reason is BootReason.NO_BOOT_UP else ("clear 4",):
            assert r.rover.inject_fault(line) == "ok"
        await r.wait_for_event(NodeBooted, node_id=4)
        assert r.network.status[11].boots == 1


async def test_a_node_of_another_profile_is_refused() -> None:
    """A load cell with the node-ID of a motor controller is not booted."""
    async with rig([NodeDescription(4, LOAD_CELL, 3)], known=[MOTOR]) as r:
        failed = await r.wait_for_event(NodeBootFailed)
        assert failed.reason is BootReason.WRONG_DEVICE_TYPE
        assert "0x00020194" in failed.text
        assert "0x00020192" in failed.text


async def test_another_serial_number_is_refused() -> None:
    """Where the serial number is configured, a device with another one is not booted."""
    known = NodeDescription(4, MOTOR_CONTROLLER, 3, serial=77)
    async with rig([MOTOR], known=[known]) as r:
        assert (await r.wait_for_event(NodeBootFailed)).reason is BootReason.WRONG_SERIAL
        r.rover.inject_fault("identity 4 serial 77")
        assert (await r.wait_for_event(NodeBooted)).identity.serial == 77


async def test_a_node_that_restarts_while_it_is_configured_is_booted_again() -> None:
    """A boot-up message during the configuration ends the attempt, with its own reason, and starts the next."""
    async with rig([MOTOR]) as r:
        await r.until_transfers(4, 10)
        r.rover.inject_fault("reset 4")
        failed = await r.wait_for_event(NodeBootFailed)
        assert failed.reason in (BootReason.RESTARTED, BootReason.NO_HEARTBEAT)
        await r.wait_for_event(NodeBooted)


async def test_a_missing_node_is_reported_once_and_the_others_boot() -> None:
    """However often the boot is tried, the same failure is one event."""
    async with rig([CELL], known=[MOTOR, CELL], boot_up_timeout_s=0.2, retry_after_s=0.1) as r:
        await r.wait_for_event(NodeBooted, node_id=11)
        await r.until_attempts(4, 3)
        assert [event.reason for event in r.events_of(NodeBootFailed)] == [BootReason.NO_BOOT_UP]


async def test_a_sensor_with_another_unit_is_refused() -> None:
    """A load cell whose process value has three decimal digits would be read ten times too large."""
    async with rig([CELL], faults=["off 11"]) as r:
        objects = r.rover.nodes[11].dictionary
        objects.entries = {**objects.entries, (0x6132, 1): replace(objects.entries[0x6132, 1], default=3)}
        r.rover.inject_fault("on 11")
        failed = await r.wait_for_event(NodeBootFailed, reason=BootReason.FIXED_OTHERWISE)
        assert "object 0x6132:01: cannot be written, must be 0x2, and reads 0x3" in failed.text


async def test_an_unusable_eds_is_a_boot_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing object in an EDS file does not end the network."""

    def lacking(*_: object, **__: object) -> None:
        raise DictionaryError("the EDS of motor nodes has no such object", index=0x1017)

    monkeypatch.setattr("regolithd.drivers.master.boot.boot_writes", lacking)
    async with rig([MOTOR]) as r:
        failed = await r.wait_for_event(NodeBootFailed)
        assert failed.reason is BootReason.UNUSABLE_EDS
        assert "0x1017" in failed.text
        assert not r.running.done()


def test_every_boot_reason_has_a_remedy() -> None:
    """The table of remedies is complete."""
    assert set(REMEDIES) == set(BootReason)
