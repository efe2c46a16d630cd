"""Reads `rover.toml` and reports every problem in it at once.

    configuration = read_configuration(Path("rover.toml"))

raises `ConfigurationError`, which holds one `Problem` for each mistake: TOML that does not parse, an unknown key, a
value out of range, and values that are valid alone but not together (for example one node-ID used twice).
"""

from __future__ import annotations

import difflib
import re
import tomllib
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from regolithd.daemon.config import wording
from regolithd.daemon.config.broker import broker_contradictions, missing_credentials
from regolithd.daemon.config.configuration import MASTER_NODE, Configuration, Nodes
from regolithd.drivers.devices.profiles.compose import DescriptionError, compose
from regolithd.drivers.errors import DictionaryError
from regolithd.drivers.master.boot_configuration import boot_writes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from pydantic.fields import FieldInfo
    from pydantic_core import ErrorDetails

    from regolithd.daemon.config.devices import DeviceTable
    from regolithd.drivers.devices.node import NodeDescription
    from regolithd.drivers.devices.profiles.choice import DeviceChoice

    Checks = Callable[["Model"], Iterable[tuple[str, str, str, str]]]

Model = TypeVar("Model", bound=BaseModel)

EXIT_STATUS = 78
"""EX_CONFIG of sysexits.h; the systemd unit has it in RestartPreventExitStatus."""


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake: its place, the expected and the found value, and how to correct it."""

    file: str
    line: int | None
    key: str
    expected: str
    found: str
    remedy: str

    def __str__(self) -> str:
        """Return the problem as one line that an editor can jump to."""
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        return f"{place}: {self.key}: expected {self.expected}, found {self.found}. {self.remedy}"


class ConfigurationError(Exception):
    """The configuration cannot be used; `problems` holds every reason."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__("\n".join(str(problem) for problem in problems))
        self.problems = problems


def read_configuration(path: Path) -> Configuration:
    """Read a `rover.toml`. A relative path in it, under whichever key, is relative to the file's folder."""
    return read_tables(path, Configuration, _checks_together)


def parse_configuration(text: str, path: Path) -> Configuration:
    """Return the configuration of a TOML text, or raise with all its problems. `path` is the file that it came from."""
    return _parse(text, path, Configuration, _checks_together)


def missing_files(configuration: Configuration, path: Path) -> list[Problem]:
    """Return a problem for each file that `[mqtt]` of this rover.toml names, and that is not there."""
    return list(_problems_together(missing_credentials(configuration.mqtt), path.read_text(encoding="utf-8-sig"), path))


def read_tables(path: Path, model: type[Model], checks: Checks[Model]) -> Model:
    """Read a TOML file into a model; `checks` yields key, expected, found and remedy of contradictions in it."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigurationError([_whole_file(path, error.strerror or str(error))]) from error
    try:
        text = data.decode("utf-8-sig")  # Windows' editors begin a file with a byte-order mark
    except UnicodeDecodeError as error:
        raise ConfigurationError([_encoding_problem(path, data, error)]) from error
    return _parse(text, path, model, checks)


def _parse(text: str, path: Path, model: type[Model], checks: Checks[Model]) -> Model:
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError([_syntax_problem(path, error)]) from error
    try:
        configuration = model.model_validate(tables)
    except ValidationError as error:
        errors = _without_consequences(_of_one_for_all(error.errors(), tables))
        found = list(dict.fromkeys(_problem(details, text, path, model) for details in errors))
        # Tables that are valid alone may still contradict each other: report that in the same run.
        together = _problems_together(checks(_valid_tables(tables, model)), text, path)
        raise ConfigurationError(found + together) from error
    configuration = _with_absolute_paths(configuration, path.absolute().parent)
    problems = _problems_together(checks(configuration), text, path)
    if isinstance(configuration, Configuration):
        problems += _device_problems(configuration, text, path)
    if problems:
        raise ConfigurationError(problems)
    return configuration


def _whole_file(path: Path, reason: str) -> Problem:
    return Problem(str(path), None, "file", "a readable TOML file", reason, "Give its path with --config.")


def _encoding_problem(path: Path, data: bytes, error: UnicodeDecodeError) -> Problem:
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return Problem(str(path), None, "encoding", "UTF-8", "UTF-16", "Save the file as UTF-8.")
    line = data.count(b"\n", 0, error.start) + 1
    character = data[error.start : error.start + 1].decode("latin-1")
    found = f"byte 0x{data[error.start]:02X}, which is {character} in Latin-1"
    return Problem(str(path), line, "encoding", "UTF-8", found, "Save the file as UTF-8.")


def _syntax_problem(path: Path, error: tomllib.TOMLDecodeError) -> Problem:
    place = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
    line = int(place[1]) if place else None
    what = re.sub(r"\s*\(at .*\)$", "", str(error))
    return Problem(str(path), line, "syntax", "valid TOML", f'"{what}"', "Correct this line; the rest was not read.")


def _valid_tables(tables: Mapping[str, Any], model: type[Model]) -> Model:
    valid: dict[str, BaseModel] = {}
    for name, field in model.model_fields.items():
        table = field.annotation
        if name in tables and isinstance(table, type) and issubclass(table, BaseModel):
            try:
                valid[name] = table.model_validate(tables[name])
            except ValidationError:
                continue  # its own problems are already in the list
    return model.model_validate(valid)


def _of_one_for_all(errors: list[ErrorDetails], tables: Mapping[str, Any]) -> Iterator[ErrorDetails]:
    """Yield the errors; where one number was given for all six wheels, without the wheel's index."""
    for details in errors:
        *outer, last = details["loc"] or ("",)
        given: Any = tables
        for part in outer if isinstance(last, int) else ():
            given = given.get(part) if isinstance(given, dict) else given
        scalar = isinstance(last, int) and isinstance(given, bool | int | float | str)
        yield {**details, "loc": tuple(outer), "input": given} if scalar else details


def _without_consequences(errors: Iterable[ErrorDetails]) -> list[ErrorDetails]:
    """Return the errors except those of lists that are long enough: pydantic does not count an invalid element."""
    return [
        details
        for details in errors
        if details["type"] != "too_short" or len(details["input"]) < details["ctx"]["min_length"]
    ]


def _problem(details: ErrorDetails, text: str, path: Path, root: type[BaseModel]) -> Problem:
    location = [part for part in details["loc"] if isinstance(part, str) and part != "[key]"]
    index = "".join(f"[{part}]" for part in details["loc"] if isinstance(part, int))
    if details["type"] == "extra_forbidden":
        return _unknown_key(location, ".".join(location) + index, text, path, root)
    model = _model_at(location[:-1], root)
    field = model.model_fields.get(location[-1]) if model else None
    missing = details["type"] == "missing"
    key = ".".join(location) + ("" if missing else index)
    default = _default(field)
    change = "Add it" if missing and not index else "Change it"
    remedy = f"{change}, or leave it out for {default}." if default is not None else f"{change}."
    expected = wording.expected(details, field, location[-1] if location else "")
    return Problem(str(path), line_of(text, location), key, expected, wording.found(details), remedy)


def _unknown_key(location: list[str], key: str, text: str, path: Path, root: type[BaseModel]) -> Problem:
    model = _model_at(location[:-1], root)
    known = list(model.model_fields) if model else []
    near = difflib.get_close_matches(location[-1], known, n=1)
    remedy = f"Did you mean {near[0]}?" if near else "Remove it."
    where = f"[{'.'.join(location[:-1])}]" if location[:-1] else "the file"
    return Problem(
        str(path), line_of(text, location), key, f"a key that {where} has ({', '.join(known)})", location[-1], remedy
    )


def _model_at(location: list[str], root: type[BaseModel]) -> type[BaseModel] | None:
    model = root
    tables: type[BaseModel] | None = None
    for name in location:
        if tables is not None:  # `name` is one that the user gave
            model, tables = tables, None
            continue
        annotation = field.annotation if (field := model.model_fields.get(name)) else None
        if get_origin(annotation) is dict:
            tables = get_args(annotation)[1]
        elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
            model = annotation
        else:
            return None
    return model if tables is None else None


def _default(field: FieldInfo | None) -> str | None:
    if field is None or field.is_required() or field.default_factory or isinstance(field.default, BaseModel):
        return None
    return wording.shown(field.default)


def _problems_together(found: Iterable[tuple[str, str, str, str]], text: str, path: Path) -> list[Problem]:
    return [_at(text, path, *each) for each in found]


def _checks_together(configuration: Configuration) -> Iterator[tuple[str, str, str, str]]:
    nodes = configuration.nodes
    yield from _shared_node_ids(nodes)
    yield from _shared_by_brakes(configuration)
    if nodes.heartbeat_timeout_ms < 2 * nodes.heartbeat_ms:
        yield (
            "nodes.heartbeat_timeout_ms",
            f"at least twice heartbeat_ms ({2 * nodes.heartbeat_ms})",
            str(nodes.heartbeat_timeout_ms),
            "One late heartbeat would count as a lost node: raise it.",
        )
    yield from broker_contradictions(configuration.mqtt)


def _device_problems(configuration: Configuration, text: str, path: Path) -> Iterator[Problem]:
    """Yield a problem for each mistake in `[devices]`, the EDS files that it names included."""
    nodes = configuration.nodes
    known = {name for _, node in nodes.by_key() for name in (str(node.node_id), node.device.configuration_key)}
    for key in configuration.devices.keys() - known:
        expected = "a kind of device of [nodes], or the id of a node that is there"
        yield _at(text, path, f"devices.{key}", expected, key, "Correct it, or add the node to [nodes].")
    reported: set[str] = set()
    for _, node in nodes.by_key():
        chosen = configuration.device_table(node)
        if chosen is None or chosen[0] in reported:
            continue
        reported.add(chosen[0])
        for error in device_problems(node, chosen[1].choice()):
            key = f"devices.{chosen[0]}.{error.key}"
            where = "" if error.index is None else f"object 0x{error.index:04X}:{error.subindex:02X}, "
            yield _at(text, path, key, "a device that can be configured", where + error.what, f"{error.remedy}.")


def device_problems(node: NodeDescription, choice: DeviceChoice) -> Iterator[DescriptionError]:
    """Yield each reason why a node cannot be the device that `[devices]` describes; its boot list is tried as well."""
    device, problems = compose(node.device, choice)
    yield from problems
    if device is None:
        return
    try:
        boot_writes(replace(node, device=device), heartbeat_s=0.2, master_id=MASTER_NODE, master_lost_after_s=0.6)
    except DictionaryError as error:
        mine = any((each.index, each.subindex) == (error.index, error.subindex) for each in choice.settings)
        key = "settings" if mine else "eds"
        yield DescriptionError(error.what, key, index=error.index, subindex=error.subindex, remedy=error.remedy)


def _at(text: str, path: Path, key: str, expected: str, found: str, remedy: str) -> Problem:
    return Problem(str(path), line_of(text, key.split(".")), key, expected, found, remedy)


def _shared_node_ids(nodes: Nodes) -> Iterator[tuple[str, str, str, str]]:
    taken: dict[int, str] = {}
    for name, described in nodes.by_key():
        node = described.node_id
        if node in taken:
            yield (
                f"nodes.{name}",
                "a node id of its own",
                f"{node}, which is {taken[node]}'s",
                "Give every node its own id.",
            )
        taken.setdefault(node, name)


def _shared_by_brakes(configuration: Configuration) -> Iterator[tuple[str, str, str, str]]:
    taken = {str(node.node_id): name for name, node in configuration.nodes.by_key()}
    braked: dict[int, str] = {}
    for key, brake in configuration.brakes.items():
        if key in taken:
            yield (
                f"brakes.{key}",
                "a node id of its own",
                f"{key}, which is {taken[key]}'s",
                "Give the brake its own id.",
            )
        if brake.wheel in braked:
            found = f"{brake.wheel}, which brake {braked[brake.wheel]} has"
            yield f"brakes.{key}.wheel", "a wheel of its own", found, "One brake loads one wheel."
        braked.setdefault(brake.wheel, key)


def _with_absolute_paths(configuration: Model, folder: Path) -> Model:
    """Return the configuration with every path in it absolute; a relative one is relative to `folder`."""
    changed: dict[str, BaseModel | dict[str, DeviceTable]] = {}
    if isinstance(configuration, Configuration):
        changed["devices"] = {
            name: each.model_copy(update={"eds": folder / each.eds}) if each.eds else each
            for name, each in configuration.devices.items()
        }
    for name, table in configuration:
        if not isinstance(table, BaseModel):
            continue
        paths = {key: folder / value for key, value in table if isinstance(value, Path)}
        if paths:
            changed[name] = table.model_copy(update=paths)
    return configuration.model_copy(update=changed)


def line_of(text: str, location: list[str]) -> int | None:
    """Return the line (from 1) where a key stands in a TOML text, or its table's, or None."""
    table, key = (location[:-1], re.sub(r"\[.*", "", location[-1])) if location else ([], "")
    here: list[str] = []
    table_line = None
    for number, line in enumerate(text.splitlines(), start=1):
        if header := re.match(r"\s*\[\s*([^\[\]]+?)\s*\]", line):
            here = header[1].split(".")
            if here in (table, location):
                table_line = number
        elif here == table and re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*=", line):
            return number
    return line_of(text, location[:-1]) if table_line is None and len(location) > 2 else table_line
