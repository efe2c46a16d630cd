"""`regolithd bench` puts the virtual rover on a bus; `regolithd bench-tell` makes something wrong with it."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from regolithd.daemon.simulator.scenario import Scenario
    from regolithd.drivers.virtual import VirtualRover

_CONTROL = Path(tempfile.gettempdir()) / "regolithd-bench.sock"

Control = Annotated[Path, typer.Option(help="UNIX socket through which `regolithd bench-tell` commands it.")]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command()(bench)
    app.command(name="bench-tell")(bench_tell)


def bench(
    *,
    channel: Annotated[str, typer.Option(help="Such as vcan0 or can0.")] = "vcan0",
    interface: Annotated[str, typer.Option(help="Any interface of python-can.")] = "socketcan",
    scenario: Annotated[Path | None, typer.Option(help="TOML: soils along the way, noise, friction, seed.")] = None,
    config: Annotated[Path | None, typer.Option(help="A rover.toml: the nodes that it names are on the bus.")] = None,
    soil: Annotated[list[str] | None, typer.Option(help="A soil, or several 5 m each; instead of the file's.")] = None,
    seed: Annotated[int | None, typer.Option(help="Same seed, same ground and noise.")] = None,
    even: Annotated[bool, typer.Option("--even", help="No noise at all.")] = False,
    seconds: Annotated[float, typer.Option(help="End by itself; 0: run until interrupted.")] = 0.0,
    control: Control = _CONTROL,
) -> None:
    """Run the virtual rover – six drives, six load cells, inclinometer, ground speed – on a CAN bus.

    Says `ready` once all nodes have power. At its end it prints, as one line of JSON, what each node saw and sent.
    """
    import asyncio
    import json

    from regolithd.daemon.setup import configuration_or_exit
    from regolithd.daemon.simulator.virtual_rover import VirtualWorld
    from regolithd.drivers.errors import BusError
    from regolithd.drivers.virtual import KAPVIK, VirtualRover
    from regolithd.drivers.virtual.control_socket import ControlError

    settings = _scenario(scenario, soil or [], seed, even=even)
    nodes = KAPVIK if config is None else configuration_or_exit(config).nodes.described()
    try:
        counts = asyncio.run(_run(interface, channel, VirtualRover(VirtualWorld(settings), nodes), control, seconds))
    except (BusError, ControlError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    typer.echo(json.dumps(counts))


def bench_tell(
    words: Annotated[list[str], typer.Argument(help="A command, such as `off 3`; `help` lists them all.")],
    control: Control = _CONTROL,
) -> None:
    """Tell the running virtual rover what shall go wrong: `regolithd bench-tell off 3`."""
    from regolithd.drivers.virtual.control_socket import ControlError, ask

    try:
        answer = ask(control, " ".join(words))
    except ControlError as error:
        answer = f"error: {error}"
    typer.echo(answer)
    if answer.startswith("error:"):
        raise typer.Exit(1)


def _scenario(path: Path | None, soils: list[str], seed: int | None, *, even: bool) -> Scenario:
    """Return the scenario of the file with the options' changes, or exit 78 with everything that is wrong."""
    from pydantic import ValidationError

    from regolithd.daemon.simulator.scenario import Noise, Scenario, read_scenario

    try:
        scenario = Scenario() if path is None else read_scenario(path)
        changes: dict[str, object] = {}
        if soils:
            ends = [*(5.0 * (number + 1) for number in range(len(soils) - 1)), None]
            stretches = [{"soil": name, "until_m": end} for name, end in zip(soils, ends, strict=True)]
            changes["ground"] = scenario.ground.model_dump() | {"stretches": stretches}
        if seed is not None:
            changes["seed"] = seed
        if even:
            changes["noise"] = Noise.none()
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
    from regolithd.drivers.virtual.control_socket import control_socket

    ended = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    async with open_bus(interface, channel) as bus, control_socket(rover, control), asyncio.TaskGroup() as tasks:
        running = tasks.create_task(rover.run(bus))
        typer.echo(f"ready: {len(rover.nodes)} nodes on {interface} {channel}; commands at {control}")
        try:
            async with asyncio.timeout(seconds or None):
                await ended.wait()
        except TimeoutError:
            pass
        running.cancel()
    return rover.counts()
