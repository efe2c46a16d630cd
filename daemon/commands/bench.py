"""`regolithd bench`: run the virtual rover on a CAN bus; `regolithd bench-fault`: inject a fault into it."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regolithd.daemon.terminal import finite

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.simulator.brake import Brakes
    from regolithd.daemon.simulator.scenario import Scenario
    from regolithd.daemon.simulator.virtual_rover import VirtualWorld
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.virtual import VirtualRover

_CONTROL = Path(tempfile.gettempdir()) / "regolithd-bench.sock"

Control = Annotated[Path, typer.Option(help="UNIX socket on which `regolithd bench-fault` reaches the virtual rover.")]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("bench")(bench)
    app.command("bench-fault")(bench_fault)


def bench(
    *,
    channel: Annotated[str, typer.Option(help="CAN interface, such as vcan0 or can0.")] = "vcan0",
    interface: Annotated[str, typer.Option(help="python-can's name of the interface type.")] = "socketcan",
    scenario: Annotated[
        Path | None,
        typer.Option(help="Scenario file (TOML): soils, noise, friction, seed; see docs/reference/virtual-rover.toml."),
    ] = None,
    config: Annotated[Path | None, typer.Option(help="A rover.toml: simulate its nodes instead of Kapvik's.")] = None,
    nodes: Annotated[
        str | None,
        typer.Option(help="Simulate these nodes only, such as 11-16,21,22; the world follows the real ones' PDOs."),
    ] = None,
    soil: Annotated[
        list[str] | None, typer.Option(help="Name of a soil; repeated: several, 5 m each. Overrides the scenario file.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of terrain and noise.")] = None,
    no_noise: Annotated[bool, typer.Option("--no-noise", help="Noise-free sensors, no terrain roughness.")] = False,
    seconds: Annotated[float, typer.Option(callback=finite, help="Duration in s; 0: run until interrupted.")] = 0.0,
    control: Control = _CONTROL,
) -> None:
    """Run the virtual rover on a CAN bus: six drives, six load cells, inclinometer, ground-speed sensor.

    With --nodes, real nodes take the places of the others: hardware in the loop. A brake of --config ([brakes.ID])
    loads the real motor of its wheel with the torque of the virtual soil.

    Prints `ready` once all nodes are on the bus. At its end it prints each node's counters as one line of JSON.
    """
    import asyncio
    import json

    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.setup import configuration_or_exit
    from regolithd.daemon.simulator.virtual_rover import VirtualWorld
    from regolithd.drivers.errors import BusError
    from regolithd.drivers.virtual import KAPVIK, VirtualRover
    from regolithd.drivers.virtual.fault_socket import FaultSocketError

    configuration = Configuration() if config is None else configuration_or_exit(config)
    settings = _scenario(scenario, soil or [], seed, no_noise=no_noise)
    described = KAPVIK if config is None else configuration.described()
    virtual = None if nodes is None else _chosen(nodes, [node.node_id for node in described])
    world = VirtualWorld(settings)
    brakes = brakes_of(configuration, described, virtual, world)
    rover = VirtualRover(world, described, virtual=virtual, follow_loads=world.follow_loads, on_frame=brakes.take)
    try:
        counts = asyncio.run(_run(interface, channel, rover, brakes, control, seconds))
    except (BusError, FaultSocketError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    typer.echo(json.dumps(counts))


def bench_fault(
    fault: Annotated[list[str], typer.Argument(help="A fault and its node, such as `off 3`; `help` lists all.")],
    control: Control = _CONTROL,
) -> None:
    """Inject a fault into the running virtual rover, such as `regolithd bench-fault off 3`."""
    from regolithd.drivers.virtual.fault_socket import FaultSocketError, send_command

    try:
        answer = send_command(control, " ".join(fault))
    except FaultSocketError as error:
        answer = f"error: {error}"
    typer.echo(answer)
    if answer.startswith("error:"):
        raise typer.Exit(1)


def _chosen(text: str, known: list[int]) -> set[int]:
    """Return the node-IDs of `11-16,21`, or exit with 78 and the reason."""
    chosen: set[int] = set()
    try:
        for part in text.split(","):
            first, _, last = part.partition("-")
            chosen |= set(range(int(first), int(last or first) + 1))
    except ValueError:
        typer.echo(f"--nodes {text}: expected node-IDs and ranges, such as 11-16,21,22", err=True)
        raise typer.Exit(78) from None
    if absent := sorted(chosen - set(known)):
        typer.echo(f"--nodes {text}: there is no node {absent[0]}; there are {', '.join(map(str, known))}", err=True)
        raise typer.Exit(78)
    return chosen


def _scenario(path: Path | None, soils: list[str], seed: int | None, *, no_noise: bool) -> Scenario:
    """Return the scenario of the file with the options' changes, or exit with 78 and a list of all errors."""
    from pydantic import ValidationError

    from regolithd.daemon.simulator.scenario import Scenario, SensorNoise, read_scenario

    try:
        scenario = Scenario() if path is None else read_scenario(path)
        changes: dict[str, object] = {}
        if soils:
            ends = [*(5.0 * (number + 1) for number in range(len(soils) - 1)), None]
            stretches = [{"soil": name, "until_m": end} for name, end in zip(soils, ends, strict=True)]
            changes["ground"] = scenario.ground.model_dump() | {"stretches": stretches}
        if seed is not None:
            changes["seed"] = seed
        if no_noise:
            changes["noise"] = SensorNoise.none()
        return Scenario.model_validate(scenario.model_dump() | changes)
    except ValidationError as error:
        for problem in error.errors():
            typer.echo(f"{path or 'options'}: {'.'.join(map(str, problem['loc']))}: {problem['msg']}", err=True)
    except (OSError, ValueError) as error:
        typer.echo(f"{path}: {error}", err=True)
    raise typer.Exit(78)


def brakes_of(
    configuration: Configuration, described: Sequence[NodeDescription], virtual: set[int] | None, world: VirtualWorld
) -> Brakes:
    """Return the brakes of the wheels whose motors are real; say which brakes are left alone."""
    import numpy as np

    from regolithd.daemon.simulator.brake import BrakeDescription, Brakes, HeartbeatWatch
    from regolithd.drivers.virtual.real_nodes import MISSING_SYNCS

    here = {node.node_id for node in described} if virtual is None else virtual
    real = [node for node in described if node.device.commanded and node.node_id not in here]
    wheels = {node.wheel for node in real}
    chosen = []
    for key, brake in configuration.brakes.items():
        if brake.wheel - 1 in wheels:
            chosen.append(BrakeDescription(int(key), brake.wheel - 1, brake.gear_ratio, brake.mirrored))
        else:
            typer.echo(f"brake: node {key} is left alone: the motor of wheel {brake.wheel} is virtual", err=True)
    lost_after_s = configuration.nodes.heartbeat_timeout_ms / 1000
    return Brakes(
        chosen,
        real,
        lambda: np.zeros(6) if world.truth is None else world.truth.torque_Nm,
        stale_after_s=MISSING_SYNCS / configuration.sync.rate_Hz,
        watch=HeartbeatWatch(min(here), lost_after_s) if here else None,
        report=lambda text: typer.echo(text, err=True),
    )


async def _run(
    interface: str, channel: str, rover: VirtualRover, brakes: Brakes, control: Path, seconds: float
) -> dict[str, dict[str, int]]:
    import asyncio
    import signal

    from regolithd.drivers.can.open_bus import open_bus
    from regolithd.drivers.virtual.fault_socket import fault_socket

    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    async with open_bus(interface, channel) as bus, fault_socket(rover, control), asyncio.TaskGroup() as tasks:
        running, braking = tasks.create_task(rover.run(bus)), tasks.create_task(brakes.run(bus))
        typer.echo(f"ready: {len(rover.nodes)} nodes on {interface} {channel}; commands at {control}")
        try:
            async with asyncio.timeout(seconds or None):
                await ended.wait()
        except TimeoutError:
            pass
        braking.cancel()
        await asyncio.wait([braking])  # the rover's task still takes the answers to the last writes
        running.cancel()
    return rover.counts()
