"""`regolithd calibrate …`: the bench procedures that give the constants, each from a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.calibration.drivetrain.bench.session import Written

Recorded = Annotated[
    Path | None, typer.Argument(help="CSV or Parquet of `regolithd export`; without it, what to do at the bench")
]
Config = Annotated[Path, typer.Option(help="the rover.toml that the values go into")]
Plot = Annotated[Path | None, typer.Option(help="draw the fit to this PNG or SVG")]
Write = Annotated[bool, typer.Option("--write/--dry-run", help="write, or only say what would be written")]

ROVER_TOML = Path("rover.toml")


def register(app: typer.Typer) -> None:
    """Add the commands."""
    bench = typer.Typer(
        no_args_is_help=True, help="Take load cells, drivetrain and wheel radius from the bench or a comparison."
    )
    bench.command("load-cell", help="Zero and span of the load cells, from known weights.")(load_cell)
    bench.command("wheels-up", help="No-load current against speed, from a spin off the ground.")(wheels_up)
    bench.command("brake", help="Efficiency of the drivetrain against torque, from a brake.")(brake)
    bench.command("radius", help="Wheel radius, from a measured distance.")(radius)
    bench.command("corrected", help="Drivetrain, from what `regolithd mismatch --corrected` wrote.")(corrected)
    app.add_typer(bench, name="calibrate")


def load_cell(recording: Recorded = None, config: Config = ROVER_TOML, plot: Plot = None, write: Write = True) -> None:
    """Fit each wheel that has weights in the recording."""
    from regolithd.calibration.drivetrain.bench import procedures, session

    if recording is None:
        typer.echo(procedures.LOAD_CELLS)
        return
    _finish(lambda: session.load_cells(recording, config, plot), config, write)


def wheels_up(recording: Recorded = None, config: Config = ROVER_TOML, plot: Plot = None, write: Write = True) -> None:
    """Fit each wheel that turned."""
    from regolithd.calibration.drivetrain.bench import procedures, session

    if recording is None:
        typer.echo(procedures.WHEELS_UP)
        return
    _finish(lambda: session.wheels_up(recording, config, plot), config, write)


def brake(recording: Recorded = None, config: Config = ROVER_TOML, plot: Plot = None, write: Write = True) -> None:
    """Fit each wheel that has a brake's torque in the recording."""
    from regolithd.calibration.drivetrain.bench import procedures, session

    if recording is None:
        typer.echo(procedures.BRAKE)
        return
    _finish(lambda: session.brake(recording, config, plot), config, write)


def radius(
    recording: Recorded = None,
    distance: Annotated[float, typer.Option(help="what the tape says, in metres")] = 0.0,
    distance_std: Annotated[float, typer.Option(help="how sure the tape is, in metres")] = 0.005,
    config: Config = ROVER_TOML,
    plot: Plot = None,
    write: Write = True,
) -> None:
    """Divide the distance by what the wheels turned."""
    from regolithd.calibration.drivetrain.bench import procedures, session

    if recording is None:
        typer.echo(procedures.RADIUS)
        return
    _finish(lambda: session.radius(recording, config, distance, distance_std, plot), config, write)


def corrected(
    simulation: Annotated[Path, typer.Argument(help="what `regolithd mismatch --corrected` wrote")],
    config: Config = ROVER_TOML,
    write: Write = True,
) -> None:
    """Copy what the comparison found of the drivetrain."""
    from regolithd.calibration.drivetrain.bench.simulation import drivetrain

    _finish(lambda: drivetrain(simulation, config), config, write)


def _finish(fit: Callable[[], Written], config: Path, write: bool) -> None:
    """Fit, say what came out, and write it."""
    from regolithd.calibration.drivetrain.bench.line import BenchError
    from regolithd.calibration.mismatch.errors import RecordingError

    try:
        written = fit()
    except (BenchError, RecordingError, OSError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    typer.echo("\n".join(written.says))
    if write:
        config.write_text(written.text, encoding="utf-8")
        typer.echo(f"Wrote {config}; comments and order are as they were.")
    else:
        typer.echo(f"{config} is as it was.")
