"""Writes the results of a recording: a long table (CSV, Parquet), or NetCDF with the dimensions time and wheel."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

import numpy as np

from regolithd.daemon.messages.header import iso_time
from regolithd.daemon.pipeline.snapshot import WHEELS
from regolithd.daemon.recording.replacement import NO_ROW, ExportError, replacing

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from regolithd.daemon.recording.results import Results

UNITS = {
    "_Nm": "N m",
    "_N": "N",
    "_rad_s": "rad s-1",
    "_m_s": "m s-1",
    "_rad": "rad",
    "_Pa": "Pa",
    "_A": "A",
    "_V": "V",
    "_degC": "degC",
    "_onset_s": "s",
}
"""Ending of a name → unit, in the notation of UDUNITS; without any, 1."""
NEEDS_PYARROW = "needs pyarrow: pip install 'regolithd[calibration]', or export to .csv"
NEEDS_SCIPY = "needs SciPy: pip install 'regolithd[calibration]', or export to .csv"


def export_results(results: Results, out: Path) -> int:
    """Write CSV, Parquet or NetCDF by the name of `out`; return the number of instants.

    Where this fails, a file that was there before stays as it was.

    Raises
    ------
    ExportError
        `out` has another suffix, a library is missing, or there is no instant.
    """
    write: Callable[[Results, Path], None] | None = {".csv": _csv, ".parquet": _parquet, ".nc": _netcdf}.get(out.suffix)
    if write is None:
        raise ExportError(f"{out}: the suffix {out.suffix!r} is not supported. Name it .csv, .parquet or .nc.")
    if not len(results.time_ns):
        raise ExportError(NO_ROW.format(out))
    with replacing(out) as beside:
        write(results, beside)
    return len(results.time_ns)


def _csv(results: Results, out: Path) -> None:
    start = int(results.time_ns[0])
    names = ["time", "time_ms", "t_s", "wheel", *results.of_wheels, *results.of_rover]
    wheels, rover = list(results.of_wheels.values()), list(results.of_rover.values())
    with out.open("w", newline="", encoding="ascii") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        for number, time_ns in enumerate(results.time_ns.tolist()):
            head = [iso_time(time_ns), time_ns // 1_000_000, (time_ns - start) / 1e9]
            shared = [_blank(column[number]) for column in rover]
            for wheel in range(WHEELS):
                writer.writerow([*head, wheel + 1, *(_blank(column[number, wheel]) for column in wheels), *shared])


def _blank(value: float) -> float | str:
    return float(value) if np.isfinite(value) else ""


def _parquet(results: Results, out: Path) -> None:
    try:
        import pyarrow as pa  # noqa: PLC0415  # the rover does not have it
        import pyarrow.parquet as pq  # noqa: PLC0415  # likewise
    except ImportError as error:
        raise ExportError(f"Parquet {NEEDS_PYARROW}") from error
    time_ns = np.repeat(results.time_ns, WHEELS)
    columns = {
        "time": pa.array(time_ns, pa.timestamp("ns", "UTC")),
        "time_ms": pa.array(time_ns // 1_000_000),
        "t_s": pa.array((time_ns - results.time_ns[0]) / 1e9),
        "wheel": pa.array(np.tile(np.arange(1, WHEELS + 1, dtype=np.int8), len(results.time_ns))),
    }
    columns |= {name: pa.array(values.ravel(), from_pandas=True) for name, values in results.of_wheels.items()}
    columns |= {
        name: pa.array(np.repeat(values, WHEELS), from_pandas=True) for name, values in results.of_rover.items()
    }
    pq.write_table(pa.table(columns), str(out), compression="zstd")


def _netcdf(results: Results, out: Path) -> None:
    try:
        from scipy.io import netcdf_file  # noqa: PLC0415  # the rover does not have it
    except ImportError as error:
        raise ExportError(f"NetCDF {NEEDS_SCIPY}") from error
    with netcdf_file(str(out), "w", version=2) as file:
        file.Conventions = "CF-1.8"
        file.title = "Measurements and estimates of a rover, by regolithd"
        file.createDimension("time", len(results.time_ns))
        file.createDimension("wheel", WHEELS)
        time = file.createVariable("time", "f8", ("time",))
        time[:] = results.time_ns / 1e9
        time.units, time.calendar = "seconds since 1970-01-01 00:00:00", "proleptic_gregorian"
        wheel = file.createVariable("wheel", "i4", ("wheel",))
        wheel[:] = np.arange(1, WHEELS + 1)
        wheel.long_name = "odd left, even right; 1, 2 front, 3, 4 middle, 5, 6 rear"
        for dimensions, variables in ((("time", "wheel"), results.of_wheels), (("time",), results.of_rover)):
            for name, values in variables.items():
                made = file.createVariable(name, "f8", dimensions)
                made[:] = values
                made.units = unit_of(name)


def unit_of(name: str) -> str:
    """Return the unit of a variable, from the end of its name; of the posterior, from the quantity in it."""
    quantity = name.removeprefix("posterior_")
    for level in ("_mean", "_low_90", "_low_50", "_median", "_high_50", "_high_90"):
        quantity = quantity.removesuffix(level) if name.startswith("posterior_") else quantity
    return next((unit for ending, unit in UNITS.items() if quantity.endswith(ending)), "1")
