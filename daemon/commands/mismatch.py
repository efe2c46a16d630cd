"""`regolithd mismatch`: name the physics that a simulation leaves out, from a recording."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003  # typer reads the annotations when it runs
from typing import Annotated, Literal

import typer

RoverFrom = Literal["column", "metadata", "folder"]
Level = Literal["shared", "rover", "recording"]
EXIT_DATA = 65
"""EX_DATAERR: recording or simulation cannot be used."""


def register(app: typer.Typer) -> None:
    """Add the command."""

    @app.command()
    def mismatch(
        recordings: Annotated[
            list[Path] | None,
            typer.Argument(help="CSV(.gz), Parquet, or MCAP of the daemon; each is a run of its own, of its rover."),
        ] = None,
        simulation: Annotated[Path | None, typer.Option(help="SIM.toml: the simulation and its parameters.")] = None,
        json: Annotated[Path | None, typer.Option(help="Write the answer here, as JSON.")] = None,
        report: Annotated[Path | None, typer.Option(help="Write a self-contained HTML report here.")] = None,
        corrected: Annotated[Path | None, typer.Option(help="Write the corrected SIM.toml here.")] = None,
        empirical: Annotated[
            bool,
            typer.Option("--empirical", help="Add a curve of what stays unexplained to --corrected, labelled as such."),
        ] = False,
        catalogue: Annotated[
            Path | None,
            typer.Option(help="Write what was found in which recording here (.parquet); continues a stopped run."),
        ] = None,
        rover_from: Annotated[
            RoverFrom | None,
            typer.Option(help="What names a recording's rover: by default the column `rover` or an MCAP's metadata."),
        ] = None,
        parameters: Annotated[
            Level | None, typer.Option(help="Of several rovers: whose the simulation's parameters are (rover).")
        ] = None,
        scheduler: Annotated[
            str | None, typer.Option(metavar="ADDRESS", help="Compare recordings on this Dask cluster.")
        ] = None,
        effects: Annotated[
            bool,
            typer.Option("--effects", help="List the effects that are looked for (by --simulation), and nothing else."),
        ] = False,
        init: Annotated[
            tuple[str, Path] | None,
            typer.Option(
                metavar="KIND FOLDER",
                help="Write annotated files to start from into a folder, and nothing else: rover-wheel, class or fmu.",
            ),
        ] = None,
    ) -> None:
        """Name the physics that a simulation leaves out, from a recording.

        Prints each effect with size and interval, indistinguishable effects, and the held-out error before and after.
        """
        from regolithd.daemon.one_thread import compute_with_one_thread

        compute_with_one_thread()
        from regolithd.calibration.mismatch.errors import MismatchError

        try:
            if init:
                _write_templates(*init)
                return
            if effects:
                _print_effects(simulation)
                return
            if not recordings or simulation is None:
                raise typer.BadParameter(
                    "a recording and --simulation SIM.toml are needed, or --effects, or --init KIND FOLDER"
                )
            from regolithd.daemon.mismatch.files import Outputs
            from regolithd.daemon.mismatch.fleet import FleetOptions
            from regolithd.daemon.mismatch.run import run

            fleet = FleetOptions(rover_from, parameters, catalogue, scheduler)
            run(recordings, simulation, Outputs(json, report, corrected, empirical=empirical), fleet)
        except (MismatchError, OSError) as error:
            typer.echo(f"regolithd mismatch: {error}", err=True)
            raise typer.Exit(EXIT_DATA) from error


def _write_templates(kind: str, folder: Path) -> None:
    from regolithd.calibration.mismatch.templates import write_templates

    for path in write_templates(kind, folder):
        typer.echo(f"wrote {path}")


def _print_effects(simulation: Path | None) -> None:
    from regolithd.calibration.mismatch.reference.effects import effects_as_text, effects_of
    from regolithd.calibration.mismatch.simulation.load import load_simulation

    typer.echo(effects_as_text(*effects_of(load_simulation(simulation) if simulation else None)))
