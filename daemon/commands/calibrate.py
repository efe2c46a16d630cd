"""`regolithd calibrate …`: fit load cells, drivetrain and wheel radius from bench recordings into `rover.toml`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from pydantic import ValidationError

from regolithd.daemon.terminal import HELP_MARKUP, finite

if TYPE_CHECKING:
    from collections.abc import Callable

    from regolithd.calibration.drivetrain.bench.configuration_update import ConfigurationUpdate

Recorded = Annotated[
    Path | None,
    typer.Argument(help="CSV or Parquet of `regolithd export`. Without it, the bench procedure is printed."),
]
Config = Annotated[Path, typer.Option(help="The rover.toml to write the values into.")]
Plot = Annotated[Path | None, typer.Option(help="Draw the fit to this PNG or SVG.")]
Write = Annotated[bool, typer.Option("--write/--dry-run", help="Write, or only print what would be written.")]

ROVER_TOML = Path("rover.toml")


def register(app: typer.Typer) -> None:
    """Add the commands."""
    bench = typer.Typer(
        no_args_is_help=True,
        rich_markup_mode=HELP_MARKUP,
        help="Calibrate load cells, drivetrain and wheel radius from recordings, and write them into rover.toml.",
    )
    bench.command("load-cell")(load_cell)
    bench.command("wheels-up")(wheels_up)
    bench.command("brake")(brake)
    bench.command("radius")(radius)
    bench.command("corrected")(corrected)
    app.add_typer(bench, name="calibrate")


def load_cell(recording: Recorded = None, config: Config = ROVER_TOML, plot: Plot = None, write: Write = True) -> None:
    """Zero and span of the load cells, from known weights (kg) in the recording."""
    from regolithd.calibration.drivetrain.bench import from_recording, procedures

    if recording is None:
        typer.echo(procedures.LOAD_CELLS)
        return
    _finish(lambda: from_recording.load_cells(recording, config, plot), config, write)


def wheels_up(recording: Recorded = None, config: Config = ROVER_TOML, plot: Plot = None, write: Write = True) -> None:
    """No-load current against motor speed, from a spin with the wheels off the ground."""
    from regolithd.calibration.drivetrain.bench import from_recording, procedures

    if recording is None:
        typer.echo(procedures.WHEELS_UP)
        return
    _finish(lambda: from_recording.wheels_up(recording, config, plot), config, write)


def brake(recording: Recorded = None, config: Config = ROVER_TOML, plot: Plot = None, write: Write = True) -> None:
    """Drivetrain efficiency against torque, from a brake test."""
    from regolithd.calibration.drivetrain.bench import from_recording, procedures

    if recording is None:
        typer.echo(procedures.BRAKE)
        return
    _finish(lambda: from_recording.brake(recording, config, plot), config, write)


def radius(
    recording: Recorded = None,
    distance: Annotated[float, typer.Option(callback=finite, help="Measured distance in m.")] = 0.0,
    distance_std: Annotated[
        float, typer.Option(callback=finite, help="Standard deviation of the distance in m.")
    ] = 0.005,
    config: Config = ROVER_TOML,
    plot: Plot = None,
    write: Write = True,
) -> None:
    """Wheel radius, from a measured distance and the wheels' rotation."""
    from regolithd.calibration.drivetrain.bench import from_recording, procedures

    if recording is None:
        typer.echo(procedures.RADIUS)
        return
    _finish(lambda: from_recording.radius(recording, config, distance, distance_std, plot), config, write)


def corrected(
    simulation: Annotated[Path, typer.Argument(help="TOML written by `regolithd mismatch --corrected`.")],
    config: Config = ROVER_TOML,
    write: Write = True,
) -> None:
    """Drivetrain constants, from a simulation that `regolithd mismatch --corrected` wrote."""
    from regolithd.calibration.drivetrain.bench.from_corrected_simulation import copy_drivetrain

    _finish(lambda: copy_drivetrain(simulation, config), config, write)


def _finish(fit: Callable[[], ConfigurationUpdate], config: Path, write: bool) -> None:
    """Fit, print the results, and write them unless `write` is false."""
    from regolithd.calibration.drivetrain.bench.line_fit import BenchError
    from regolithd.calibration.mismatch.errors import RecordingError
    from regolithd.daemon.setup import configuration_or_exit

    if not config.is_file():
        typer.echo(f"{config}: there is no such file. Name the rover's rover.toml with --config.", err=True)
        raise typer.Exit(1)
    try:
        update = fit()
    except ValidationError as error:
        configuration_or_exit(config)  # says what is wrong in rover.toml, if it is that file
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    except (BenchError, RecordingError, OSError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from error
    typer.echo("\n".join(update.messages))
    if write:
        config.write_text(update.text, encoding="utf-8")
        typer.echo(f"Wrote {config}; comments and order are kept.")
    else:
        typer.echo(f"{config} is unchanged.")
