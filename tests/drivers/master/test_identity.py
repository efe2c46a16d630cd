"""Comparison of a node's identity with its EDS, and how an operational node is lost."""

from __future__ import annotations

import asyncio
from dataclasses import fields, replace
from types import SimpleNamespace

import pytest

from regolithd.drivers.canopen.nmt import NmtState
from regolithd.drivers.canopen.object_dictionary import variable
from regolithd.drivers.devices.decoding.signals import NodeState
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.errors import SdoAbortError, SdoTimeoutError
from regolithd.drivers.master.boot_error import REMEDIES, BootReason
from regolithd.drivers.master.bus_load import bus_load
from regolithd.drivers.master.events import Identity
from regolithd.drivers.master.heartbeat_consumer import HeartbeatConsumer, Loss
from regolithd.drivers.master.identity import compare_identity, read_identity
from regolithd.drivers.master.remote_node import RemoteNode
from regolithd.drivers.master.scan import _result
from regolithd.drivers.master.status import NetworkCounters, NetworkSettings, NodePhase, NodeStatus
from regolithd.drivers.virtual.rover import KAPVIK

NODE = NodeDescription(4, MOTOR_CONTROLLER, 3, serial=77)


def own() -> Identity:
    """Return the identity that the EDS describes, with the configured serial number."""
    of = [variable(MOTOR_CONTROLLER.eds, 0x1018, subindex).default for subindex in (1, 2, 3)]
    return Identity(variable(MOTOR_CONTROLLER.eds, 0x1000).default, *of, 77)


def test_the_own_identity_has_no_difference() -> None:
    """Device type, vendor, product, revision and serial number agree; the minor revision may differ."""
    assert compare_identity(NODE, own()) is None
    assert compare_identity(NODE, replace(own(), revision=own().revision ^ 0x0000FFFF)) is None
    assert compare_identity(replace(NODE, serial=None), replace(own(), serial=5)) is None


@pytest.mark.parametrize(
    ("field", "reason"),
    [
        ("device_type", BootReason.WRONG_DEVICE_TYPE),
        ("vendor", BootReason.WRONG_VENDOR),
        ("product", BootReason.WRONG_PRODUCT),
        ("revision", BootReason.WRONG_REVISION),
        ("serial", BootReason.WRONG_SERIAL),
    ],
)
@pytest.mark.parametrize("bit", [0, 15, 16, 31])
def test_any_bit_of_an_identity_is_compared(field: str, reason: BootReason, bit: int) -> None:
    """One bit is a difference, but for the minor revision; the message has both values."""
    value = getattr(own(), field)
    found = compare_identity(NODE, replace(own(), **{field: value ^ 1 << bit}))
    if field == "revision" and bit < 16:
        assert found is None
        return
    mask = 0xFFFF0000 if field == "revision" else 0xFFFFFFFF
    assert found is not None
    assert found[0] is reason
    assert f"0x{(value ^ 1 << bit) & mask:08X}, expected 0x{value & mask:08X} (motor)" in found[1]


def test_the_first_difference_is_reported() -> None:
    """A device of another kind differs in everything; it is its device type that says so."""
    found = compare_identity(NODE, Identity(1, 2, 3, 4, 5))
    assert found is not None
    assert found[0] is BootReason.WRONG_DEVICE_TYPE


async def test_identity_entries_that_a_node_lacks_are_zero() -> None:
    """Sub-indices 2 to 4 of 0x1018 are optional; 0x1000 and sub-index 1 are not."""
    present = {(0x1000, 0): 0x20192, (0x1018, 1): 0xFB, (0x1018, 3): 0x2000}

    class Objects:
        async def read_number(self, index: int, subindex: int = 0) -> int:
            if (index, subindex) not in present:
                raise SdoAbortError(0x06090011, "subindex does not exist", node_id=4, index=index, subindex=subindex)
            return present[index, subindex]

    objects = Objects()
    assert await read_identity(SimpleNamespace(sdo=objects)) == Identity(0x20192, 0xFB, 0, 0x2000, 0)
    del present[0x1018, 1]
    with pytest.raises(SdoAbortError, match="0x1018:01"):
        await read_identity(SimpleNamespace(sdo=objects))


def remote_node() -> RemoteNode:
    """Return an operational node that has booted up once."""
    remote = RemoteNode(SimpleNamespace(), NODE, sdo_timeout_s=0.1)
    for state in (NmtState.BOOT_UP, NmtState.OPERATIONAL):
        remote.take_state(NodeState(5, 4, state))
    return remote


def test_a_boot_up_message_is_counted_and_means_pre_operational() -> None:
    """Every error-control message is counted, and the last one's state and time are kept."""
    fresh = RemoteNode(SimpleNamespace(), NODE, sdo_timeout_s=0.1)
    assert (fresh.state, fresh.heard_ns, fresh.heard, fresh.boot_ups, fresh.answer_cob_id) == (None, None, 0, 0, 0x584)
    fresh.take_state(NodeState(3, 4, NmtState.BOOT_UP))
    assert (fresh.state, fresh.heard_ns, fresh.heard, fresh.boot_ups) == (NmtState.PRE_OPERATIONAL, 3, 1, 1)
    fresh.take_state(NodeState(4, 4, NmtState.STOPPED))
    assert (fresh.state, fresh.heard_ns, fresh.heard, fresh.boot_ups) == (NmtState.STOPPED, 4, 2, 1)


@pytest.mark.parametrize(
    ("state", "loss"),
    [
        (None, Loss("no heartbeat for 0.02 s", silent=True)),
        (NmtState.BOOT_UP, Loss("it restarted by itself", silent=False)),
        (NmtState.STOPPED, Loss("it left operational and reports stopped", silent=False)),
        (NmtState.PRE_OPERATIONAL, Loss("it left operational and reports pre-operational", silent=False)),
    ],
)
async def test_a_node_is_lost_by_silence_a_restart_or_another_state(state: NmtState | None, loss: Loss) -> None:
    """Only silence means that it cannot be booted at once."""
    remote = remote_node()
    consumer = HeartbeatConsumer(0.02 if state is None else 20.0)
    running = asyncio.ensure_future(consumer.run())
    waiting = asyncio.ensure_future(consumer.until_lost(remote))
    await asyncio.sleep(0)
    if state is not None:
        remote.take_state(NodeState(6, 4, NmtState.OPERATIONAL))
        await asyncio.sleep(0)
        assert not waiting.done()
        remote.take_state(NodeState(7, 4, state))
    async with asyncio.timeout(20):
        assert await waiting == loss
    running.cancel()


@pytest.mark.parametrize(
    ("state", "problem", "reason"),
    [
        (None, "no answer within 0.5 s", BootReason.NO_BOOT_UP),
        (
            NmtState.OPERATIONAL,
            "its heartbeat reports operational, but: no answer within 0.5 s",
            BootReason.NO_SDO_ANSWER,
        ),
        (NmtState.STOPPED, "it is in NMT state stopped, in which it answers nothing", None),
    ],
)
def test_a_scan_says_why_a_node_does_not_answer(
    state: NmtState | None, problem: str, reason: BootReason | None
) -> None:
    """The heartbeat tells a node that hangs from one that is off, or stopped."""
    found = _result(SimpleNamespace(node=NODE, state=state), SdoTimeoutError("no answer within 0.5 s", node_id=4))
    assert (found.node, found.answers, found.identity, found.nmt_state) == (NODE, False, None, state)
    assert found.problem == problem
    assert found.remedy == (REMEDIES[reason] if reason else "The daemon resets it when it starts")


def test_the_defaults_of_a_network() -> None:
    """The drives stop before the master has missed five heartbeats, and a node is lost after three of its own."""
    settings = NetworkSettings(nodes=())
    assert (settings.sync_rate_Hz, settings.gear_ratio, settings.master_id) == (2.0, 1400.0, 127)
    assert (settings.master_heartbeat_s, settings.master_lost_after_s) == (0.1, 0.5)
    assert (settings.node_heartbeat_s, settings.node_lost_after_s) == (0.2, 0.7)
    assert (settings.sdo_timeout_s, settings.boot_up_timeout_s) == (1.0, 3.0)
    assert (settings.retry_after_s, settings.retry_at_most_s) == (5.0, 30.0)
    assert bus_load(KAPVIK, sync_rate_Hz=2.0, bitrate=10**6) == bus_load(
        KAPVIK,
        sync_rate_Hz=2.0,
        bitrate=10**6,
        node_heartbeat_s=settings.node_heartbeat_s,
        master_heartbeat_s=settings.master_heartbeat_s,
    )


def test_status_and_counters_start_empty() -> None:
    """A node that has not been heard is booting, and every number is 0."""
    status = NodeStatus(NODE)
    assert status.phase is NodePhase.BOOTING
    assert {field.name for field in fields(status) if getattr(status, field.name) == 0} == {"boots", "emergencies"}
    counters = NetworkCounters()
    numbers = (counters.heartbeats_sent, counters.heartbeats_failed, counters.sdo_transfers, counters.sdo_failures)
    assert numbers == (0, 0, 0, 0)
