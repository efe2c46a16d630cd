"""The model of `rover.toml`: everything that can differ from rover to rover, as one frozen object.

The tables that a simulation's TOML also has come from `calibration.parameters`; the others are here. `reader` reads the
file. Every relative path is relative to the file's folder.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path  # pydantic reads it at run time
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, create_model

from regolithd.calibration.parameters import Drivetrain, Length, LoadCells, Mass, Ratio, Rover, Table, Wheel
from regolithd.daemon.config.broker import BrokerSettings
from regolithd.daemon.config.devices import DeviceTable  # noqa: TC001  # pydantic reads it at run time
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.devices.profiles.compose import compose
from regolithd.drivers.devices.registry import DEVICES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.drivers.devices.device import Device

NodeId = Annotated[int, Field(ge=1, le=126, strict=True)]
WheelNumber = Annotated[int, Field(ge=1, le=6, strict=True)]
NodeKey = Annotated[str, Field(pattern=r"^([1-9]|[1-9][0-9]|1[01][0-9]|12[0-6])$")]
SixNodes = Annotated[tuple[NodeId, ...], Field(min_length=6, max_length=6)]
MASTER_NODE = 127
"""The daemon's own node-ID: the drives consume its heartbeat, and stop without it."""


class Identity(Table):
    """`[rover]`: name, mass and dimensions."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,64}$", description="letters, digits, _ and -, 1 to 64")] = (
        "kapvik"
    )
    mass_kg: Mass = 30.0
    wheelbase_m: Length = 0.65
    track_m: Length = 0.55

    @property
    def body(self) -> Rover:
        """Mass and dimensions, as the simulation takes them."""
        return Rover(mass_kg=self.mass_kg, wheelbase_m=self.wheelbase_m, track_m=self.track_m)


class Bus(Table):
    """`[bus]`: the CAN interface, with python-can's names."""

    interface: Literal["socketcan", "virtual", "slcan", "kvaser", "pcan", "udp_multicast"] = "socketcan"
    channel: Annotated[str, Field(min_length=1)] = "can0"
    bitrate: Literal[10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000] = 1_000_000


class SyncTiming(Table):
    """`[sync]`: the SYNC rate, at which every node samples."""

    rate_Hz: Annotated[float, Field(ge=1, le=200)] = 2.0


def _node_ids(device: Device) -> tuple[object, object]:
    """Return the type and the default of a device's key: six node-IDs, one a wheel, or one that may be left out."""
    first = device.default_node_id
    return (SixNodes, tuple(range(first, first + 6))) if device.per_wheel else (NodeId | None, None)


# One key for each registered device: motors, load_cells, inclinometer, ground_speed, …
_NodeIds = create_model(  # type: ignore[call-overload]
    "_NodeIds", __base__=Table, **{device.configuration_key: _node_ids(device) for device in DEVICES}
)


class Nodes(_NodeIds):
    """`[nodes]`: node-IDs on the bus, and time limits; the k-th number of a list of six belongs to wheel k.

    `boot_timeout_s`: from the NMT reset to the boot-up message; `sdo_timeout_s`: until an SDO request is answered.
    """

    mirrored_wheels: tuple[WheelNumber, ...] = ()
    motor_diagnostics: bool = False
    heartbeat_ms: Annotated[int, Field(ge=20, le=10_000)] = 200
    heartbeat_timeout_ms: Annotated[int, Field(ge=50, le=30_000)] = 600
    boot_timeout_s: Annotated[float, Field(ge=0.1, le=120)] = 3.0
    sdo_timeout_s: Annotated[float, Field(ge=0.05, le=60)] = 1.0

    def by_key(self) -> Iterator[tuple[str, NodeDescription]]:
        """Yield every node, as the device that comes with regolithd, with the key of its node-ID: `motors[0]`."""
        for device in DEVICES:
            key = device.configuration_key
            ids = getattr(self, key)
            if device.per_wheel:
                for wheel, node_id in enumerate(ids):
                    yield f"{key}[{wheel}]", self._on_wheel(device, wheel, node_id)
            elif ids is not None:
                yield key, NodeDescription(ids, device, None, required=False)

    def _on_wheel(self, device: Device, wheel: int, node_id: int) -> NodeDescription:
        motor = device is MOTOR_CONTROLLER
        return NodeDescription(
            node_id,
            device,
            wheel,
            diagnostics=self.motor_diagnostics and motor,
            mirrored=wheel + 1 in self.mirrored_wheels and motor,
        )


class Brake(Table):
    """`[brakes.ID]`: a drive in torque mode that `regolithd bench` gives the torque of the virtual soil.

    `gear_ratio` is in turns of the brake per turn of the wheel. The daemon only knows that the node is there.
    """

    wheel: WheelNumber
    gear_ratio: Ratio = 1.0
    mirrored: bool = False


class Slip(Table):
    """`[slip]`: the slip where the ground speed is not measured, and the speed below which a wheel stands still."""

    constant: Annotated[float, Field(gt=-1, lt=1)] = 0.025
    standstill_rad_s: Annotated[float, Field(ge=0.0001, le=5.0)] = 0.05


class Smoothing(Table):
    """`[smoothing]`: the filter that removes momentary current drops (docs/decisions/016-smoothing.md)."""

    window_s: Annotated[float, Field(ge=0, le=60)] = 3.5
    threshold: Annotated[float, Field(ge=0, le=10)] = 2.5
    time_constant_s: Annotated[float, Field(ge=0, le=60)] = 1.5


class Estimator(Table):
    """`[estimator]`: the terrain network's file; without it, the network that comes with regolithd."""

    model: Path | None = None


class PosteriorSettings(Table):
    """`[posterior]`: credible intervals of the soil under the rover; needs a calibrated drivetrain."""

    enabled: bool = True
    model: Path | None = None
    window_s: Annotated[float, Field(ge=0.5, le=20)] = 10.0
    soil: Literal["lete-sand", "sandy-loam", "clayey-soil", "medium-soil"] | None = None


class Change(Table):
    """`[change]`: the soil-change alarm; needs a calibrated drivetrain, and `[posterior]`."""

    enabled: bool = True
    threshold: Annotated[float, Field(ge=3, le=100)] = 10.8


class Recording(Table):
    """`[recording]`: folder, size limit and file length of the recordings."""

    directory: Path = Path("/var/lib/regolithd/recordings")
    limit_MB: Annotated[float, Field(ge=1, le=1e8)] = 4000.0
    file_minutes: Annotated[float, Field(ge=0.1, le=1440)] = 60.0
    enabled: bool = True


class Mqtt(BrokerSettings):
    """`[mqtt]`: the broker, and the store for messages that it has not acknowledged."""

    spool_directory: Path = Path("/var/lib/regolithd/spool")
    spool_limit_MB: Annotated[float, Field(ge=0.01, le=1e6)] = 200.0


class Control(Table):
    """`[control]`: the local socket that takes commands, and the limits of a traverse."""

    socket: Path = Path("/run/regolithd/control.sock")
    group: str = "regolithd"
    speed_limit_m_s: Annotated[float, Field(ge=0.0001, le=2.0)] = 0.05
    distance_limit_m: Annotated[float, Field(ge=0.001, le=100_000.0)] = 1000.0


class Configuration(Table):
    """The whole of `rover.toml`; a table that is left out has Kapvik's values."""

    rover: Identity = Identity()
    bus: Bus = Bus()
    sync: SyncTiming = SyncTiming()
    nodes: Nodes = Nodes()
    devices: dict[str, DeviceTable] = Field(default_factory=dict)
    brakes: dict[NodeKey, Brake] = Field(default_factory=dict)
    wheel: Wheel = Wheel()
    load_cells: LoadCells = LoadCells()
    drivetrain: Drivetrain = Drivetrain()
    slip: Slip = Slip()
    smoothing: Smoothing = Smoothing()
    estimator: Estimator = Estimator()
    posterior: PosteriorSettings = PosteriorSettings()
    change: Change = Change()
    recording: Recording = Recording()
    mqtt: Mqtt = Mqtt()
    control: Control = Control()

    def described(self) -> tuple[NodeDescription, ...]:
        """Return the description of every node, in the order of the device registry.

        Raises
        ------
        DescriptionError
            `[devices]` describes a device that cannot be; `reader` reports each of them as a problem.
        """
        return tuple(self._described(node) for _, node in self.nodes.by_key())

    def device_table(self, node: NodeDescription) -> tuple[str, DeviceTable] | None:
        """Return the key and the table in `[devices]` that count for a node, or None."""
        for key in (str(node.node_id), node.device.configuration_key):
            if key in self.devices:
                return key, self.devices[key]
        return None

    def _described(self, node: NodeDescription) -> NodeDescription:
        chosen = self.device_table(node)
        if chosen is None:
            return node
        device, problems = compose(node.device, chosen[1].choice())
        if device is None:
            raise problems[0]
        return replace(node, device=device, serial=chosen[1].serial)
