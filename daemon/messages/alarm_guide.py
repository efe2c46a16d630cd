"""What each alarm means and what an operator can do: the source of docs/reference/alarms.md and of the ground's page.

Texts are for people; code is in backticks. `ALARM_GUIDE` has every name but those of single nodes (`node-3`), which
share the entry `node`.
"""

from __future__ import annotations

from dataclasses import dataclass

NODE = "node"
"""Entry of the alarms `node-1`, `node-2`, …"""


@dataclass(frozen=True, slots=True)
class AlarmGuide:
    """An alarm: its meaning, what it costs, possible causes with what to do, and what ends it."""

    name: str
    meaning: str
    consequence: str
    actions: tuple[str, ...]
    ends: str


_GUIDES = (
    AlarmGuide(
        "bus",
        "The CAN bus does not work: its interface cannot be opened or is down, or the controller counts so many errors "
        "that it is in state error-warning, error-passive or bus-off (CiA 301; ISO 11898-1).",
        "Error-warning: nothing yet. Error-passive: values are late or missing. Bus-off or down: nothing is measured, "
        "and the drives stop because the daemon's heartbeat is missing.",
        (
            "`regolithd check` says whether the interface exists, is up and has the right bit rate.",
            "Bus-off with a single node: bit rate or termination is wrong (120 Ω at both ends, 60 Ω measured).",
            "Errors that come and go: look at plugs, and at the cable where it bends.",
            "`ip -details -statistics link show can0` counts the errors.",
            "Interface down: `systemctl restart regolithd-can@can0`.",
        ),
        "the controller is error-active again; after bus-off it is restarted by itself within 100 ms.",
    ),
    AlarmGuide(
        "kernel",
        "The Linux kernel dropped CAN frames because the daemon did not read them in time.",
        "Values of some SYNCs are missing. None is wrong, as a frame is dropped whole.",
        (
            "See in `health` (`cpu_s`) and with `top` which program uses the processor, and end it.",
            "Lower `[sync] rate_Hz`.",
            "`sysctl net.core.rmem_max` must be 4194304, as `make install` sets it.",
        ),
        "the daemon is restarted: the count is of this run.",
    ),
    AlarmGuide(
        "node-id",
        "Two devices answer with one node-ID: its PDOs or heartbeats come twice in a SYNC period.",
        "Nothing that comes with this node-ID is published, as nobody can tell whose it is.",
        (
            "Find the device that was added or replaced last, and switch it off.",
            "Give it a node-ID of its own: DIP switches, LSS (CiA 305), or the maker's program.",
        ),
        "only one of them has sent for some seconds.",
    ),
    AlarmGuide(
        "master",
        "Something else on the bus acts as a master: it sends SYNC, NMT commands or the daemon's heartbeat.",
        "With a second SYNC, samples of the wheels are not from one instant, and are not published.",
        (
            "End the other program: a configuration tool that was left running, or a second daemon.",
            "A drive that is itself a SYNC producer: clear bit 30 of its object 0x1005.",
            "`candump can0,080:7FF,000:7FF` shows the frames; `regolithd scan` the devices.",
        ),
        "nothing of it has come for some seconds.",
    ),
    AlarmGuide(
        "unexpected-node",
        "A device that is not in `[nodes]` or `[brakes]` is on the bus.",
        "Its values are ignored. It takes a share of the bus.",
        (
            "`regolithd scan` says what it is, and which lines of rover.toml it would need.",
            "Add it, or take it off the bus.",
        ),
        "it is silent, or in the configuration after a restart.",
    ),
    AlarmGuide(
        "undecodable",
        "For some time frames have come that cannot be decoded: too short for the PDO that they should be, extended "
        "identifiers, or remote frames.",
        "The values that they should carry are missing. Nothing is invented.",
        (
            "`regolithd check` compares the node's PDO mapping with `[devices]`.",
            "`candump -e can0` shows the frames; the text of the alarm names node and reason.",
            "Extended identifiers and remote frames come from devices that do not belong on this bus.",
        ),
        "no such frame has come for some seconds.",
    ),
    AlarmGuide(
        "store",
        "Messages that wait for the broker were lost, damaged on the disk, or are kept in memory only.",
        "Acquisition and recording go on. The text says how many messages are lost; `health` counts them (`dropped`, "
        "`damaged`, `unstored`, `torn`).",
        (
            "Lost because the store was full: restore the connection, or raise `[mqtt] spool_limit_MB`.",
            "In memory only, or refused by the disk: see `df` and `dmesg`; free space, or mount it writable.",
            "Damaged: the disk or SD card returns other bytes than were written. Replace it, and keep the recordings.",
            "An incomplete last message after a power failure needs nothing.",
        ),
        "the daemon is restarted with a store that works.",
    ),
    AlarmGuide(
        "recording",
        "The recording cannot be written (an error); or the disk has less room than `[recording] limit_MB`, and the "
        "oldest recordings are deleted earlier (a warning).",
        "Acquisition and publishing go on. What is measured meanwhile is in the broker's clients only.",
        (
            "`df /var/lib/regolithd`: free space, or lower `[recording] limit_MB` below what the disk has.",
            "`ls -ld` of `[recording] directory`: it must belong to the user regolithd.",
            "Read-only file system: `dmesg` says why; check the disk.",
        ),
        "a new pair of files could be written, which is tried every ten seconds; or recordings and free space together "
        "are as much as the limit.",
    ),
    AlarmGuide(
        "broker",
        "There has been no lasting connection to the MQTT broker for some time, or it refuses what is published.",
        "Nothing is lost while the store has room: messages are sent, marked late, once there is a connection. Until "
        "then `regolithd status` and the journal say so.",
        (
            "The text says what failed, and which key to correct; `regolithd check` tries it again.",
            "Refused certificates: `docs/how-to/mqtt-tls.md` explains each message.",
            "Two rovers with the same `[rover] name`: the broker disconnects one for the other, about once a second.",
        ),
        "the daemon is connected; after one connection after another was lost, once one has lasted five seconds.",
    ),
    AlarmGuide(
        "model",
        "The terrain network or the posterior's model cannot be used: absent, damaged (its digest differs), or trained "
        "for another drivetrain.",
        "Measurements are published and recorded, without the estimates of this model.",
        (
            "`regolithd check` names the file.",
            "Copy it again, train it again (`regolithd train`), or leave the key out for the model that comes along.",
        ),
        "the daemon is restarted with a model that fits.",
    ),
    AlarmGuide(
        "control",
        "The control socket cannot be created.",
        "The rover cannot be commanded: no traverse can begin. Measuring and publishing go on.",
        (
            "Another daemon runs: stop it.",
            "The group of `[control] group` is absent: `groupadd --system regolithd`.",
            "The folder of `[control] socket` does not belong to the daemon's user.",
        ),
        "the socket could be created; that is tried every five seconds.",
    ),
    AlarmGuide(
        "wheel",
        "In the last traverse a wheel did not turn at the commanded speed, within a fifth, or has turned less than the "
        "distance. The text names wheel and node.",
        "The traverse was ended by a quick stop, or was driven and is not complete: a rover that drags a wheel digs "
        "itself in.",
        (
            "Look at the wheel: blocked, dug in, a coupling or a gear broken.",
            "All wheels too slow: the drives are at their limit (object 0x607F, or the supply). Drive more slowly.",
            "`regolithd status` shows the drive's state; `emcy` and `event` what it reported.",
            "A drive that turns in the maker's program, and not here: see its RPDO 1 with `regolithd check`.",
        ),
        "the next traverse begins.",
    ),
    AlarmGuide(
        "clock",
        "The computer's clock was set by more than half a second while the daemon ran.",
        "Times before and after are not comparable. Order, and the intervals within a SYNC, are right.",
        (
            "Let the clock be synchronised before the daemon starts (`systemctl enable systemd-time-wait-sync`).",
            "A Raspberry Pi has no clock of its own without a battery: add one (RTC), or wait for the network.",
        ),
        "a minute has passed. It latches: acknowledge and reset it on the ground.",
    ),
    AlarmGuide(
        "sensor",
        "A reading has been exactly constant for seconds while those of other wheels change.",
        "The reading is published as it comes. Estimates of this wheel are wrong if the sensor hangs.",
        (
            "Switch the node off and on.",
            "Check its connector; replace the sensor or its amplifier.",
        ),
        "the reading changes.",
    ),
    AlarmGuide(
        "soil-change",
        "The wheels need less, or more, torque than the soil of the last minutes gives for the measured load and slip: "
        "the soil has changed.",
        "On weaker soil wheels dig in. The evidence says which wheels, since when, and how probable it is that "
        "cohesion, friction angle and drawbar margin fell.",
        (
            "Stop, and look at the wheels that it names.",
            "Drive on with less slip, another way, or back on the tracks.",
            "After a slope or on stones it may be a false alarm: one in 8 h is expected (`[change] threshold`).",
        ),
        "two minutes have passed without another change. It latches: acknowledge and reset it on the ground.",
    ),
    AlarmGuide(
        "event-rate",
        "A node sends EMCY messages, or changes its state, so often that they are summarised once a second.",
        "Snapshots are not delayed by it. Single events are not published; `suppressed` counts them.",
        (
            "Look at what it sends: `emcy` and `event`, or `candump can0,080:780`.",
            "Correct the cause that the EMCY code names, or switch the node off.",
        ),
        "its messages have come at a normal rate for some seconds.",
    ),
    AlarmGuide(
        NODE,
        "A node is lost (its heartbeat ended) or could not be booted. The alarm has the node-ID in its name: `node-3`.",
        "Its values are marked as missing. If it is required, no traverse begins, and a running one stops.",
        (
            "`regolithd status` says why: no answer, a wrong device, an object that it refuses.",
            "Check its supply, its plug and its node-ID.",
            "`regolithd check` compares its objects with rover.toml and the EDS file.",
        ),
        "it has booted. It is tried again whenever it sends something, and from time to time.",
    ),
    AlarmGuide(
        "mismatch",
        "`regolithd compare` found that the simulation leaves out physics, or that an effect of the corrected "
        "simulation has changed. It is raised by the comparison after a traverse, not by a measurement now.",
        "The rover is not in danger. Something of it has changed (friction, a motor, a load cell), or the simulation "
        "never had it.",
        (
            "Read the report, linked on the ground's page.",
            "Repair the rover; or accept the effect: copy the corrected simulation, beside the report, to SIM.toml.",
        ),
        "a comparison finds nothing new.",
    ),
)
ALARM_GUIDE = {guide.name: guide for guide in _GUIDES}


def guide_of(alarm: str) -> AlarmGuide | None:
    """Return the entry of an alarm, given its name, or None for one that this version does not know."""
    name, _, number = alarm.rpartition("-")
    return ALARM_GUIDE[NODE] if name == NODE and number.isdigit() else ALARM_GUIDE.get(alarm)
