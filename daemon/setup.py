"""What a command does first: read the configuration, load the ONNX models; on an error, print it and exit with 78."""

from __future__ import annotations

from typing import TYPE_CHECKING, NoReturn

import typer
from pydantic import ValidationError

from regolithd.calibration.models.onnx_session import ModelError
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.config.reader import EXIT_STATUS, ConfigurationError, read_configuration
from regolithd.daemon.pipeline.onnx_models import OnnxModels, load_models
from regolithd.drivers.devices.profiles.compose import DescriptionError

if TYPE_CHECKING:
    from pathlib import Path


def configuration_or_exit(path: Path | None) -> Configuration:
    """Return the configuration of a file, or the defaults; print all problems and exit where there are any."""
    if path is None:
        return Configuration()
    try:
        return read_configuration(path)
    except ConfigurationError as error:
        _end([str(problem) for problem in error.problems])


def models_or_exit(configuration: Configuration) -> OnnxModels:
    """Return the ONNX models that the configuration names; print why and exit where one cannot be used."""
    try:
        return load_models(configuration)
    except ModelError as error:
        _end([str(error)])


def recorded_configuration(recording: Path) -> Configuration:
    """Return the configuration that a recording was made with.

    Prints why and exits where there is none, or it is damaged.
    """
    from regolithd.daemon.recording.eds_files import with_recorded_eds  # noqa: PLC0415
    from regolithd.daemon.recording.mcap_file import (  # noqa: PLC0415  # only few commands read recordings
        DamagedRecordingError,
        read_metadata,
    )

    try:
        metadata = read_metadata(recording) if recording.is_file() else {}
        content = metadata.get("configuration")
        if not content:
            why = "holds no configuration" if recording.is_file() else "is not there"
            _end([f"{recording} {why}, so the rover is unknown. Give its rover.toml with --config."])
        configuration = with_recorded_eds(Configuration.model_validate_json(content), metadata)
        configuration.described()
    except (DamagedRecordingError, ValidationError, DescriptionError) as error:
        _end([f"{recording}: its configuration cannot be read; give one with --config. {error}"])
    return configuration


def _end(problems: list[str]) -> NoReturn:
    for problem in problems:
        typer.echo(problem, err=True)
    raise typer.Exit(EXIT_STATUS)
