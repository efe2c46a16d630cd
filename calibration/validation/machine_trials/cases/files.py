"""A case as the files that a solver may see: the recording, SIM.toml, and the class or FMU that it names."""

from __future__ import annotations

import gzip
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.validation.machine_trials.cases.fmu import build_fmu

if TYPE_CHECKING:
    from regolithd.calibration.validation.machine_trials.cases.generator import Recorded
    from regolithd.calibration.validation.machine_trials.physics.machine import Machine, Units

TEMPLATES = Path(__file__).parent.parent / "first_simulations"
VARIABLES = """[variables]
heater_voltage = "heater_voltage_V"
ambient = "ambient_temperature_degC"
{temperature_variable} = "{temperature}"
heater_current = "{current}"
"""
"""The FMU's variables and the columns that they are."""


def write_simulation(machine: Machine, units: Units, folder: Path) -> list[Path]:
    """Write SIM.toml and what it names; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    module, toml = machine.name.replace("-", "_"), folder / "SIM.toml"
    template = TEMPLATES / f"{module}.py.in"
    if template.exists():
        source = folder / f"{module}.py"
        source.write_text(Template(template.read_text()).substitute(units.words))
        model, variables = f"{module}:{machine.name.title().replace('-', '')}", ""
    else:
        source = build_fmu(module, folder / f"{module}.fmu")
        model, variables = source.name, VARIABLES.format(**units.words)
    tables = [f'[simulation]\nmodel = "{model}"\n', *([variables] if variables else [])]
    for name, known in machine.parameters.items():
        tables.append(f"[parameters.{name}]\nvalue = {known.value!r}\nstd = {known.std!r}\n")
    toml.write_text("\n".join(tables))
    return [toml, source]


def write_recording(recorded: Recorded, units: Units, path: Path) -> Path:
    """Write the recording in long format, one row per instant and axis; a blank is not measured."""
    world, machine = recorded.world, recorded.world.machine
    shape = world.drive.compared.shape
    columns = {units.renamed("t_s"): texts(np.repeat(units.converted("t_s", world.drive.t_s), shape[1]))}
    if world.drive.run is not None:
        columns["run"] = [str(run) for run in np.repeat(world.drive.run, shape[1])]
    if machine.axis_column:
        columns[machine.axis_column] = list(machine.axes) * shape[0]
    for name, values in {**world.drive.columns, **recorded.measured}.items():
        written = texts(units.converted(name, values).ravel())
        seen = recorded.seen.get(name)
        if seen is not None:
            written = [text if there else "" for text, there in zip(written, seen.ravel(), strict=True)]
        columns[units.renamed(name)] = written
    lines = [",".join(columns), *(",".join(row) for row in zip(*columns.values(), strict=True))]
    path.write_bytes(gzip.compress(("\n".join(lines) + "\n").encode(), compresslevel=3, mtime=0))
    return path


def texts(values: np.ndarray) -> list[str]:
    """Return numbers with nine digits."""
    return [f"{value:.9g}" for value in values.tolist()]
