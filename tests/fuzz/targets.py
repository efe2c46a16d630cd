"""What is fuzzed: for each kind of input a generator, the code that reads it, and the errors that it may raise."""

from __future__ import annotations

import shutil
import tempfile
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq
from estimates import estimate
from mutations import damaged_bytes, damaged_text
from typer.testing import CliRunner

from regolithd.calibration.mismatch.errors import MismatchError
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.calibration.models import POSTERIOR_MODEL, TERRAIN_MODEL
from regolithd.calibration.models.onnx_session import ModelError
from regolithd.daemon.cli import app
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.config.reader import EXIT_STATUS, ConfigurationError, parse_configuration, read_configuration
from regolithd.daemon.control.protocol import REQUEST
from regolithd.daemon.mismatch.recordings import read_recordings
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.publish.segment_format import MAGIC, pack, unpack
from regolithd.daemon.recording.candump import read_log
from regolithd.daemon.recording.content import ESTIMATE, SNAPSHOT, estimate_json, snapshot_json
from regolithd.daemon.recording.export import ExportError, export
from regolithd.daemon.recording.mcap_file import DamagedRecordingError, McapFile, read_metadata
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen.object_dictionary import object_dictionary
from regolithd.drivers.canopen.sdo import download, upload
from regolithd.drivers.devices.decoding.decoder import Decoder
from regolithd.drivers.errors import SdoError

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "drivers/devices/eds"
EDS = (
    *(("motors", FOLDER / name) for name in ("cia402.eds", "epos2.eds", "motor.eds")),
    *(("load_cells", FOLDER / name) for name in ("cia404.eds", "load-cell.eds")),
)
SIMULATION = ROOT / "docs/examples/husky/SIM.toml"
EVERY = 40
"""Of the inputs of a file, one in so many is also given to the command, which must end with its exit status."""


class WrongExitError(AssertionError):
    """A command ended with another exit status than documented, or with a traceback."""


@dataclass
class Target:
    """One kind of input. `one` reads one random input, and raises one of `allowed`, or nothing."""

    name: str
    one: Callable[[Random, Path], None]
    allowed: tuple[type[BaseException], ...] = ()
    share: float = 1.0
    state: dict[str, object] = field(default_factory=dict)


def _ends(arguments: list[str], statuses: set[int]) -> None:
    """Run a command in this process, and check its exit status."""
    result = CliRunner().invoke(app, arguments)
    if result.exit_code not in statuses or not (result.exception is None or isinstance(result.exception, SystemExit)):
        raise WrongExitError(f"{arguments}: {result.exit_code}, {result.exception!r}: {result.output[-300:]}")


@cache
def _chain() -> Chain:
    configuration = Configuration()
    return Chain(configuration, load_models(configuration))


def frames(random: Random, _folder: Path) -> None:
    """A batch of frames: random ones, and those of the rover's nodes with random lengths and data."""
    known = [*_chain().decoder.expected, 0x080, 0x701, 0x08D, 0x58D]
    batch = [
        Frame(
            random.choice((random.randrange(1 << 62), 1_700_000_000_000_000_000 + random.randrange(10**9))),
            random.choice(known) if random.random() < 0.8 else random.randrange(1 << 29),
            random.randbytes(random.randrange(9)),
            extended=random.random() < 0.05,
            remote=random.random() < 0.05,
            error=random.random() < 0.05,
            sent=random.random() < 0.3,
        )
        for _ in range(200)
    ]
    _chain().feed(batch)


def sdo(random: Random, _folder: Path) -> None:
    """An SDO transfer that is answered by random frames, most of them with a valid command specifier."""
    transfer = (
        upload(0x1018, 1) if random.random() < 0.5 else download(0x1017, 0, random.randbytes(random.randrange(20)))
    )
    next(transfer)
    try:
        for _ in range(30):
            specifier = random.choice(
                (0x40, 0x41, 0x43, 0x60, 0x20, 0x30, 0x00, 0x10, 0x80, 0xC0, random.randrange(256))
            )
            body = random.choice((b"\x18\x10\x01", b"\x17\x10\x00", random.randbytes(3)))
            answer = bytes([specifier]) + body + random.randbytes(4)
            transfer.send(answer[: random.choice((8, 8, 8, random.randrange(9)))])
    except StopIteration:
        return


def eds(random: Random, folder: Path) -> None:
    """An EDS file of the rover's, damaged, named by `[devices]`."""
    path = folder / f"device-{random.randrange(1 << 62):x}.eds"  # what was read is kept by its path
    kind, source = random.choice(EDS)
    path.write_bytes(damaged_text(source.read_text(encoding="latin-1"), random, "="))
    object_dictionary.cache_clear()
    text = f'[devices.{kind}]\neds = "{path}"\n'
    try:
        parse_configuration(text, folder / "rover.toml")
    finally:
        path.unlink()
        object_dictionary.cache_clear()


def rover_toml(random: Random, folder: Path) -> None:
    """The repository's rover.toml, damaged; sometimes through a command, which must end with 78 where it is refused."""
    path = folder / "rover.toml"
    path.write_bytes(damaged_text(_rover_toml(), random, "="))
    try:
        read_configuration(path)
    except ConfigurationError:
        if random.randrange(EVERY) == 0:
            _ends(["status", "--config", str(path)], {EXIT_STATUS})
        raise


@cache
def _rover_toml() -> str:
    return (ROOT / "rover.toml").read_text()


def sim_toml(random: Random, folder: Path) -> None:
    """An example's SIM.toml, damaged; its own module is beside it."""
    for module in SIMULATION.parent.glob("*.py"):
        if not (folder / module.name).exists():
            shutil.copy(module, folder)
    path = folder / "SIM.toml"
    path.write_bytes(damaged_text(SIMULATION.read_text(), random, "="))
    load_simulation(path)


def csv(random: Random, folder: Path) -> None:
    """A recording as CSV, damaged."""
    path = folder / "drive.csv"
    path.write_bytes(damaged_text(_csv(), random, ","))
    read_recordings([path], "wheel")


@cache
def _csv() -> str:
    rows = [
        f"{k / 10},{wheel},{20 + wheel + k % 7},{0.1 * k},{0.05 + k % 3 / 100}" for k in range(40) for wheel in (1, 2)
    ]
    return "\n".join(["t_s,wheel,load_N,motor_speed_rad_s,motor_current_A", *rows, ""])


@cache
def _parquet() -> bytes:
    names, *rows = [line.split(",") for line in _csv().split()]
    table = pa.table({name: [float(row[place]) for row in rows] for place, name in enumerate(names)})
    stream = pa.BufferOutputStream()
    pq.write_table(table, stream)
    return stream.getvalue().to_pybytes()


def parquet(random: Random, folder: Path) -> None:
    """A recording as Parquet, damaged."""
    path = folder / "drive.parquet"
    path.write_bytes(damaged_bytes(_parquet(), random))
    read_recordings([path], "wheel")


def mcap(random: Random, folder: Path) -> None:
    """A recording of the daemon, damaged: read, exported, and its metadata read."""
    path = folder / "drive.mcap"
    path.write_bytes(damaged_bytes(_mcap(), random))
    if random.randrange(EVERY) == 0:
        _ends(["export", str(path), "--to", str(folder / "out.csv")], {0, 1})
    export([path], folder / "out.csv", on_gap=lambda _: None)
    read_metadata(path)


@cache
def _mcap() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "whole.mcap"
        file = McapFile(path.open("wb"), {"configuration": Configuration().model_dump_json(), "started_ns": "1"})
        for sequence in range(12):
            made = estimate(sequence)
            file.write(SNAPSHOT, made.snapshot.time_ns, snapshot_json(made.snapshot), sequence)
            file.write(ESTIMATE, made.snapshot.time_ns, estimate_json(made), sequence)
            if sequence % 4 == 3:
                file.flush()
        file.close()
        return path.read_bytes()


def candump(random: Random, folder: Path) -> None:
    """A candump log, damaged, decoded."""
    path = folder / "drive.log"
    identifiers = (0x080, 0x18D, 0x181, 0x701)
    lines = [
        f"({1_700_000_000 + k / 100:.6f}) can0 {random.choice(identifiers):03X}#{random.randbytes(8).hex().upper()} R"
        for k in range(60)
    ]
    path.write_bytes(damaged_text("\n".join(lines), random, " "))
    decoder = _decoder()
    for frame in read_log(path):
        decoder.decode(frame)


@cache
def _decoder() -> Decoder:
    return Decoder(Configuration().described())


def control_line(random: Random, _folder: Path) -> None:
    """A line of the control socket, damaged."""
    line = random.choice(
        ('{"command": "stop", "quick": true}', '{"command": "traverse", "distance_m": 1.0, "speed_m_s": 0.02}')
    )
    REQUEST.validate_json(damaged_text(line, random, ":"))


def model(random: Random, folder: Path) -> None:
    """An ONNX model of the daemon, damaged."""
    kind, source = random.choice((("estimator", TERRAIN_MODEL), ("posterior", POSTERIOR_MODEL)))
    path = folder / "model.onnx"
    whole = source.read_bytes()
    unchecked = whole[: whole.index(b"regolithd.sha256") - 4]  # as version 0.1 and other programs write it
    path.write_bytes(damaged_bytes(random.choice((whole, unchecked)), random))
    drivetrain = {"no_load_current_A": [0.03] * 6}
    load_models(Configuration.model_validate({kind: {"model": path}, "drivetrain": drivetrain}))


def store(random: Random, _folder: Path) -> None:
    """A file of the store, damaged: it may hold no message that was not stored."""
    stored = [("snapshot" if k % 3 else "event", b'{"sequence":%d}' % k) for k in range(20)]
    data = MAGIC + b"".join(pack(k, topic, payload) for k, (topic, payload) in enumerate(stored))
    for record in unpack(damaged_bytes(data, random), 0).records:
        if (record.topic, record.payload) != stored[record.index]:
            raise WrongExitError(f"record {record.index} was never stored: {record}")


TARGETS = (
    Target("CAN frames", frames),
    Target("SDO answers", sdo, (SdoError,), 0.5),
    Target("EDS files", eds, (ConfigurationError,), 2.0),
    Target("rover.toml", rover_toml, (ConfigurationError,), 2.0),
    Target("SIM.toml", sim_toml, (MismatchError,)),
    Target("CSV", csv, (MismatchError,)),
    Target("Parquet", parquet, (MismatchError,)),
    Target("MCAP", mcap, (DamagedRecordingError, ExportError)),
    Target("candump logs", candump),
    Target("control requests", control_line, (ValueError,), 0.3),
    Target("ONNX models", model, (ModelError,)),
    Target("files of the store", store, (), 0.5),
)
