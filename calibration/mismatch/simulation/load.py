"""SIM.toml names its simulation: `rover-wheel`, a class of the user's own, or an FMU."""

from __future__ import annotations

import importlib
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.errors import SimulationError, did_you_mean, listed
from regolithd.calibration.mismatch.simulation.checked import checked
from regolithd.calibration.mismatch.simulation.corrected_curves import stated_curves
from regolithd.calibration.mismatch.simulation.corrected_effects import stated_effects
from regolithd.calibration.mismatch.simulation.simulation import Simulation
from regolithd.calibration.mismatch.simulation.stated_priors import check_keys_of_simulation
from regolithd.calibration.mismatch.simulation.toml_place import line_of
from regolithd.calibration.mismatch.simulation.user_code import defined_at, user_line

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

OF_CLASS = ("model", "path", "motor_constant_at_degC", "without_effects")
"""Keys of `[simulation]` of a class that reads none of its own."""
MODELS = 'model must be "rover-wheel", "package.module:ClassName" or "machine.fmu"'


def read_tables(path: Path) -> dict[str, Any]:
    """Return the tables of a SIM.toml.

    Raises
    ------
    SimulationError
        When the file is not there or is no TOML; with line and column.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise SimulationError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SimulationError(f"{path} is not UTF-8 (byte {error.start}): save it as UTF-8") from error
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        cure = " Text needs quotes, a number a point, and a key stands once." if "line" in str(error) else ""
        raise SimulationError(f"{path} is not TOML: {error}.{cure}") from error


def load_simulation(
    source: Path | Mapping[str, Any], *, beside: Path | None = None, announce: Callable[[str], None] = lambda _: None
) -> Simulation:
    """Return the simulation that a SIM.toml, or its tables, name.

    A module or an FMU is looked for beside SIM.toml, or in `[simulation] path`, which is relative to SIM.toml.

    Parameters
    ----------
    source: path of SIM.toml, or its tables
    beside: the folder that `[simulation] path` is relative to; by default SIM.toml's own, or the current one
    announce: called with a sentence before code that SIM.toml names is run: a Python module, or an FMU

    Raises
    ------
    SimulationError
        When the model is unknown, cannot be loaded, or its tables are wrong; with file and line.
    """
    if not isinstance(source, Path):
        return _loaded(source, beside or Path.cwd(), None, announce)
    try:
        return _loaded(read_tables(source), beside or source.resolve().parent, source, announce)
    except SimulationError as error:
        if str(source) in str(error):
            raise
        line = line_of(source.read_text(encoding="utf-8-sig"), error.keys)
        place = f"{source}, line {line}" if line else str(source)
        raise SimulationError(f"{place}: {error}", error.keys) from error


def model_folder(tables: Mapping[str, Any], beside: Path) -> Path:
    """Return the folder in which a module or FMU is looked for first."""
    path = tables["simulation"].get("path", ".")
    if not isinstance(path, str):
        raise SimulationError(f"[simulation] path must be a folder's name, not {path!r}", ("simulation", "path"))
    return beside / path


def _loaded(
    tables: Mapping[str, Any], beside: Path, source: Path | None, announce: Callable[[str], None]
) -> Simulation:
    if "simulation" not in tables:
        there = listed(f"[{name}]" for name in tables)
        raise SimulationError(f"there is no table [simulation], whose {MODELS}; the file has {there}")
    table = tables["simulation"]
    model = table.get("model") if isinstance(table, dict) else None
    if not isinstance(model, str):
        raise SimulationError(f"[simulation] {MODELS}, not {model!r}", ("simulation", "model"))
    _check_effects(tables.get("effects", []))
    made = _of_model(model, tables, model_folder(tables, beside), announce)
    made.corrected_effects, made.empirical_curves = stated_effects(tables), stated_curves(tables)
    made.source = source
    made.without_effects = (*made.without_effects, *_without_effects(table.get("without_effects", [])))
    made.motor_constant_at_degC = _stated_temperature(table, made.motor_constant_at_degC)
    found = checked(made)
    if "without_effects" in table:
        found.candidates(library())  # a name that no effect has is told with its line
    return found


def _of_model(model: str, tables: Mapping[str, Any], folder: Path, announce: Callable[[str], None]) -> Simulation:
    """Return the built-in simulation, an FMU, or a class of the user's own."""
    if model == "rover-wheel":
        from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel  # noqa: PLC0415  # soil physics

        return RoverWheel.from_tables(tables)
    place = folder.resolve()
    announce(f"running the code of {model} from {place}, which SIM.toml names: use only files that you trust")
    if model.endswith(".fmu"):
        from regolithd.calibration.mismatch.simulation.fmu import FmuSimulation  # noqa: PLC0415  # needs FMPy

        return FmuSimulation.from_file(folder / model, tables)
    if model.count(":") != 1:
        raise SimulationError(f"[simulation] {MODELS}, not {model!r}", ("simulation", "model"))
    return _made(_imported(model, folder), tables)


def _stated_temperature(table: Mapping[str, Any], default: float | None) -> float | None:
    name = "motor_constant_at_degC"
    value = table.get(name, default)
    if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise SimulationError(f"[simulation] {name} must be a number, not {value!r}", ("simulation", name))
    return value


def _without_effects(names: object) -> list[str]:
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        told = f'[simulation] without_effects must be a list of names, ["grade-resistance"], not {names!r}'
        raise SimulationError(told, ("simulation", "without_effects"))
    return names


def _check_effects(effects: object) -> None:
    if not isinstance(effects, list) or not all(isinstance(effect, dict) for effect in effects):
        raise SimulationError("effects are tables, [[effects]], as --corrected writes them", ("effects",))


def _made(kind: type[Simulation], tables: Mapping[str, Any]) -> Simulation:
    """Make the user's simulation; what its constructor raises is told with file and line."""
    try:
        made = kind.from_tables(tables)
    except SimulationError:
        raise
    except Exception as error:  # a user's constructor may raise anything
        told = f"{kind.__name__} cannot be made{user_line(error) or defined_at(kind)}: {type(error).__name__}: {error}"
        raise SimulationError(told, ("simulation", "model")) from error
    if not isinstance(made, Simulation):
        raise SimulationError(f"{kind.__name__}.from_tables must return a {kind.__name__}, not {type(made).__name__}")
    _check_keys(made, tables["simulation"])
    return made


def _check_keys(made: Simulation, table: Mapping[str, Any]) -> None:
    """Check that every key of `[simulation]` is one that is read, unless the class may read more of it by itself."""
    reads_by_itself = type(made).from_tables.__func__ is not Simulation.from_tables.__func__  # type: ignore[attr-defined]
    if not (reads_by_itself or "simulation" in made.own_tables):
        check_keys_of_simulation(table, OF_CLASS)


def _imported(model: str, folder: Path) -> type[Simulation]:
    """Import a user's class; what its module raises is told with file and line."""
    module_name, class_name = model.split(":")
    keys = ("simulation", "model")
    _make_room(module_name, folder)
    place = str(folder.resolve())
    sys.path[:] = [place, *(each for each in sys.path if each != place)]
    try:
        module = importlib.import_module(module_name)
        found = getattr(module, class_name, None)
    except (Exception, SystemExit) as error:  # a user's module may raise anything
        told = f"the simulation {model} cannot be imported{user_line(error)}: {type(error).__name__}: {error}"
        if not user_line(error):
            told += f". It is looked for in {folder}; say where it is with [simulation] path"
        raise SimulationError(told, keys) from error
    if found is None:
        classes = [name for name, each in vars(module).items() if _is_simulation(each) and each is not Simulation]
        raise SimulationError(f"{model}: {module_name} has no {class_name}; {did_you_mean(class_name, classes)}", keys)
    if not _is_simulation(found):
        raise SimulationError(
            f"{model}: {class_name} in {module_name} must be a subclass of regolithd.calibration.mismatch.Simulation",
            keys,
        )
    return found


def _is_simulation(found: object) -> bool:
    return isinstance(found, type) and issubclass(found, Simulation)


def _make_room(module_name: str, folder: Path) -> None:
    """Forget a module of the same name from another folder, as an earlier SIM.toml of this process had it."""
    first = module_name.split(".", maxsplit=1)[0]
    found = [path for path in (folder / f"{first}.py", folder / first / "__init__.py") if path.is_file()]
    if not found or first not in sys.modules:
        return
    if first in sys.stdlib_module_names:
        raise SimulationError(
            f"rename {found[0].name}: Python has a module {first} of its own", ("simulation", "model")
        )
    if Path(getattr(sys.modules[first], "__file__", None) or folder) != found[0].resolve():
        for name in [name for name in sys.modules if name == first or name.startswith(f"{first}.")]:
            del sys.modules[name]
        importlib.invalidate_caches()
