"""`regolithd bench`: run the virtual rover on a CAN bus; `regolithd bench-fault`: inject a fault into it."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from regolithd.daemon.simulator.scenario import Scenario
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
        typer.Option(help="Scenario file (TOML): soils, noise, friction, seed; see docs/virtual-rover.toml."),
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
    seconds: Annotated[float, typer.Option(help="Duration in s; 0: run until interrupted.")] = 0.0,
    control: Control = _CONTROL,
) -> None:
    """Run the virtual rover on a CAN bus: six drives, six load cells, inclinometer, ground-speed sensor.

    With --nodes, real nodes take the places of the others: hardware in the loop.

    Prints `ready` once all nodes are on the bus. At its end it prints each node's counters as one line of JSON.
    """
    import asyncio
    import json

    from regolithd.daemon.setup import configuration_or_exit
    from regolithd.daemon.simulator.virtual_rover import VirtualWorld
    from regolithd.drivers.errors import BusError
    from regolithd.drivers.virtual import KAPVIK, VirtualRover
    from regolithd.drivers.virtual.fault_socket import FaultSocketError

    settings = _scenario(scenario, soil or [], seed, no_noise=no_noise)
    described = KAPVIK if config is None else configuration_or_exit(config).described()
    virtual = None if nodes is None else _chosen(nodes, [node.node_id for node in described])
    world = VirtualWorld(settings)
    rover = VirtualRover(world, described, virtual=virtual, follow_loads=world.follow_loads)
    try:
        counts = asyncio.run(_run(interface, channel, rover, control, seconds))
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


async def _run(
    interface: str, channel: str, rover: VirtualRover, control: Path, seconds: float
) -> dict[str, dict[str, int]]:
    import asyncio
    import signal

    from regolithd.drivers.can.open_bus import open_bus
    from regolithd.drivers.virtual.fault_socket import fault_socket

    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    async with open_bus(interface, channel) as bus, fault_socket(rover, control), asyncio.TaskGroup() as tasks:
        running = tasks.create_task(rover.run(bus))
        typer.echo(f"ready: {len(rover.nodes)} nodes on {interface} {channel}; commands at {control}")
        try:
            async with asyncio.timeout(seconds or None):
                await ended.wait()
        except TimeoutError:
            pass
        running.cancel()
    return rover.counts()
