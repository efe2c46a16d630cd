"""A recording of described devices replays by itself: units at the start of each file, EDS files in the metadata."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import typer

from regolithd.daemon.config.reader import parse_configuration
from regolithd.daemon.recording.candump import read_log
from regolithd.daemon.recording.eds_files import eds_metadata, with_recorded_eds
from regolithd.daemon.recording.mcap_file import McapFile
from regolithd.daemon.recording.recorder import Recorder
from regolithd.daemon.setup import recorded_configuration
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.devices.decoding.signals import Reading
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.motor_controller import MOTOR_SPEED, RAD_S_PER_RPM

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.daemon.config.configuration import Configuration

UNIT = Frame(5_000, 0x581, bytes.fromhex("43A960000047B400"))  # answer to an upload of 0x60A9: rpm
SPEED = Frame(9_000, 0x281, (3000).to_bytes(4, "little"))  # TPDO 2 of node 1


def described(folder: Path) -> Configuration:
    """Return a configuration whose motors are EPOS4, with an EDS file in this folder."""
    (folder / "mine.eds").write_bytes((EDS_FOLDER / "epos4.eds").read_bytes())
    text = f'[devices.motors]\nprofile = "epos4"\neds = "mine.eds"\n[recording]\ndirectory = "{folder}"\n'
    return parse_configuration(text, folder / "rover.toml")


def test_every_file_begins_with_the_frames_that_state_units(tmp_path: Path) -> None:
    """A file of its own decodes as the whole recording does; without these frames the speed has no unit."""
    configuration = described(tmp_path)
    live = Decoder(configuration.described())
    live.decode(UNIT)
    recorder = Recorder(configuration.recording, "can0", {}, preamble=lambda: live.unit_frames)
    paths = recorder.paths
    assert paths is not None
    recorder.frames([SPEED])
    recorder.close()
    frames = list(read_log(paths[1]))
    assert frames == [UNIT, SPEED]
    fresh = Decoder(configuration.described())
    assert fresh.decode(SPEED) == Reading(9_000, 1, 0x281, ())
    fresh.decode(frames[0])
    assert fresh.decode(frames[1]) == Reading(9_000, 1, 0x281, ((MOTOR_SPEED, 3000 * RAD_S_PER_RPM),))


def test_a_recording_replays_where_its_eds_files_are_not(tmp_path: Path) -> None:
    """The files' text is in the metadata, and their objects are those of then."""
    configuration = described(tmp_path)
    metadata = {"configuration": configuration.model_dump_json(), **eds_metadata(configuration)}
    mcap = McapFile((tmp_path / "a.mcap").open("xb"), metadata)
    mcap.close()
    (tmp_path / "mine.eds").unlink()
    found = recorded_configuration(tmp_path / "a.mcap").described()[0].device
    assert [each.index for layout in found.tpdos for each in layout.objects] == [0x6041, 0x30D1, 0x606C]
    assert found.eds.name == "mine.eds"


def test_the_text_of_an_eds_file_is_recorded_whatever_its_encoding(tmp_path: Path) -> None:
    """A file in UTF-16 is in the metadata as text, with the objects that it had."""
    configuration = described(tmp_path)
    text = (tmp_path / "mine.eds").read_text()
    (tmp_path / "mine.eds").write_text(text, encoding="utf-16")
    assert list(eds_metadata(configuration).values()) == [text]


def test_without_the_file_and_its_text_there_is_one_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recording without the text says which file is missing, with exit status 78."""
    configuration = described(tmp_path)
    McapFile((tmp_path / "a.mcap").open("xb"), {"configuration": configuration.model_dump_json()}).close()
    (tmp_path / "mine.eds").unlink()
    from regolithd.drivers.canopen.object_dictionary import object_dictionary  # noqa: PLC0415
    from regolithd.drivers.devices.profiles.compose import compose  # noqa: PLC0415

    object_dictionary.cache_clear()
    compose.cache_clear()
    with pytest.raises(typer.Exit):
        recorded_configuration(tmp_path / "a.mcap")
    assert "mine.eds cannot be read" in capsys.readouterr().err
    assert with_recorded_eds(configuration, {}) is configuration
