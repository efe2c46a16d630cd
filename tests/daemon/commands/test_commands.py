"""The commands in this process: what they ask for, what they print, and their exit status."""

from __future__ import annotations

import inspect
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_type_hints

import numpy as np
import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

from regolithd.calibration.drivetrain.bench import from_recording, procedures
from regolithd.calibration.drivetrain.bench.line_fit import BenchError
from regolithd.daemon.check.finding import Finding
from regolithd.daemon.cli import app
from regolithd.daemon.commands import bench, check, mismatch, prove
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.simulator.brake import BrakeDescription

# What docs and --help promise: the defaults of each command's options.
DEFAULTS: dict[str, dict[str, Any]] = {
    "bench": {"channel": "vcan0", "interface": "socketcan", "seed": None, "no_noise": False, "seconds": 0.0},
    "check": {"config": Path("/etc/regolithd/rover.toml"), "syntax": False, "json": False},
    "demo": {"out": Path("build/demo"), "seconds": 44.0},
    "evaluate": {"rovers": 10_000, "drives": 400, "hours": 1.0, "part": "all", "seed": 31_907_442},
    "loop": {"seed": 1, "out": Path("build/loop"), "case": None, "short": False, "picture": None},
    "prove": {"recordings": 200, "seed": None, "jobs": 0, "solver": "", "keep": False, "duration": 1800.0},
    "reproduce": {"docs": Path("docs"), "trainings": 20},
    "run": {"config": Path("/etc/regolithd/rover.toml"), "verbose": False},
    "sizing": {"trainings": 100, "epochs": 10_000, "timing_epochs": 1000},
    "status": {"config": None, "json": False},
    "stop": {"quick": False, "config": None},
    "train": {"neurons": 64, "trainings": 100, "epochs": 10_000, "seed": 1, "config": None},
    "train-posterior": {"rovers": 1_500_000, "steps": 40_000, "seed": 1},
    "traverse": {"speed": 0.022, "config": None},
}
LIMITS = {
    ("demo", "seconds"): (5, 600),
    ("evaluate", "rovers"): (100, None),
    ("evaluate", "drives"): (10, None),
    ("evaluate", "hours"): (0.1, None),
    ("loop", "seed"): (0, None),
    ("reproduce", "trainings"): (2, None),
    ("sizing", "trainings"): (2, None),
    ("sizing", "epochs"): (1, None),
    ("sizing", "timing_epochs"): (1, None),
    ("train", "neurons"): (1, None),
    ("train", "trainings"): (1, None),
    ("train", "epochs"): (1, None),
    ("train-posterior", "rovers"): (1000, None),
    ("train-posterior", "steps"): (50, None),
}


def regolithd(*arguments: object) -> Any:
    """Run a command and return its result: exit status, standard output and error."""
    return CliRunner().invoke(app, [str(each) for each in arguments])


@pytest.mark.parametrize("name", DEFAULTS)
def test_the_defaults_of_a_command(name: str) -> None:
    """They are those that the documents give."""
    command = typer.main.get_command(app).commands[name]
    found = {option.name: option.default for option in command.params}
    given = {key: str(value) if isinstance(value, Path) else value for key, value in DEFAULTS[name].items()}
    assert {key: str(found[key]) if isinstance(found[key], Path) else found[key] for key in given} == given


@pytest.mark.parametrize(("name", "option"), LIMITS)
def test_the_limits_of_an_option(name: str, option: str) -> None:
    """A value below the lowest or above the highest is refused by the command line."""
    (function,) = (each.callback for each in app.registered_commands if each.name == name)
    information = get_type_hints(function, include_extras=True)[option].__metadata__[0]
    assert (information.min, information.max) == LIMITS[name, option]


def test_the_version_is_printed() -> None:
    """`--version` needs no command, and without a command the help is shown."""
    assert regolithd("--version").output.startswith("regolithd")
    assert regolithd("--version").exit_code == 0
    assert "traverse" in regolithd().output


def findings(*verdicts: Any) -> list[Finding]:
    """Return a finding for each verdict."""
    return [
        Finding("broker", verdict, f"it is {verdict}", "" if verdict == "good" else "Do it.") for verdict in verdicts
    ]


@pytest.mark.parametrize(
    ("verdicts", "exit_code", "last"),
    [
        (("good", "not checked"), 0, "Nothing wrong."),
        (("good", "warning", "warning"), 0, "Nothing wrong, 2 warnings."),
        (("wrong", "warning", "wrong"), 1, "2 wrong, 1 warnings."),
    ],
)
def test_check_is_1_where_something_is_wrong(
    verdicts: tuple[Any, ...], exit_code: int, last: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each finding is a row with its mark and remedy; --json prints the same."""

    async def everything(_configuration: Configuration) -> list[Finding]:
        return findings(*verdicts)

    monkeypatch.setattr("regolithd.daemon.check.all_checks.check_everything", everything)
    rover = tmp_path / "rover.toml"
    rover.write_text("")
    done = regolithd("check", "--config", rover)
    assert done.exit_code == exit_code
    assert done.stdout.strip().splitlines()[-1] == last
    rows = [line.split()[0] for line in done.stdout.splitlines() if " broker " in line]
    assert rows == [check._MARKS[verdict] for verdict in verdicts]
    assert done.stdout.count("→ Do it.") == sum(verdict != "good" for verdict in verdicts)
    done = regolithd("check", "--config", rover, "--json")
    assert done.exit_code == exit_code
    assert [each["verdict"] for each in json.loads(done.stdout)] == list(verdicts)


def test_check_prints_every_problem_of_the_configuration(tmp_path: Path) -> None:
    """Exit status 78, nothing else is checked; a good file alone is enough with --syntax."""
    rover = tmp_path / "rover.toml"
    rover.write_text("[sync]\nrate_Hz = 0.0\n")
    done = regolithd("check", "--config", rover)
    assert done.exit_code == 78
    assert done.stderr.splitlines()[-1] == "1 problem in the configuration; nothing else was checked."
    rover.write_text("[sync]\nrate_Hz = 0.0\nrate = 3\n")
    assert "2 problems in" in regolithd("check", "--config", rover).stderr
    done = regolithd("check", "--config", rover, "--json")
    assert [each["verdict"] for each in json.loads(done.stdout)] == ["wrong", "wrong"]
    rover.write_text("")
    done = regolithd("check", "--config", rover, "--syntax")
    assert (done.exit_code, done.stdout) == (0, f"{rover}: good\n")


@pytest.mark.parametrize(
    ("name", "procedure", "function"),
    [
        ("load-cell", procedures.LOAD_CELLS, "load_cells"),
        ("wheels-up", procedures.WHEELS_UP, "wheels_up"),
        ("brake", procedures.BRAKE, "brake"),
        ("radius", procedures.RADIUS, "radius"),
    ],
)
def test_calibrate_prints_the_procedure_or_writes_the_fit(
    name: str, procedure: str, function: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a recording the procedure; with one the messages, and the new text unless it is a dry run."""
    done = regolithd("calibrate", name)
    assert (done.exit_code, done.stdout.strip()) == (0, procedure.strip())
    rover = tmp_path / "rover.toml"
    rover.write_text("old")
    asked = []

    def fit(*arguments: Any) -> SimpleNamespace:
        asked.append(arguments)
        return SimpleNamespace(messages=["a = 1", "b = 2"], text="new")

    monkeypatch.setattr(from_recording, function, fit)
    done = regolithd("calibrate", name, "recording.csv", "--config", rover, "--dry-run")
    assert (done.exit_code, rover.read_text()) == (0, "old")
    assert done.stdout == f"a = 1\nb = 2\n{rover} is unchanged.\n"
    done = regolithd("calibrate", name, "recording.csv", "--config", rover)
    assert (done.exit_code, rover.read_text()) == (0, "new")
    assert done.stdout.endswith(f"Wrote {rover}; comments and order are kept.\n")
    rest = (0.0, 0.005, None) if name == "radius" else (None,)
    assert asked == [(Path("recording.csv"), rover, *rest)] * 2

    def fails(*_arguments: Any) -> None:
        raise BenchError("no weights")

    monkeypatch.setattr(from_recording, function, fails)
    done = regolithd("calibrate", name, "recording.csv", "--config", rover)
    assert (done.exit_code, done.stderr) == (1, "no weights\n")


def test_calibrate_says_what_is_wrong_in_rover_toml(tmp_path: Path) -> None:
    """A current in mA is a line with key and range, and exit status 78; the file stays as it is."""
    rover = tmp_path / "rover.toml"
    rover.write_text("[drivetrain]\nno_load_current_A = 37\n")
    done = regolithd("calibrate", "radius", tmp_path / "drive.csv", "--distance", 5, "--config", rover)
    said = (
        f"{rover}:2: drivetrain.no_load_current_A: expected 0 to 5 A, found 37. Change it, or leave it out for 0.0.\n"
    )
    assert (done.exit_code, done.stderr) == (78, said)
    assert rover.read_text().endswith("= 37\n")


def test_mismatch_ends_with_65_where_its_files_cannot_be_used(tmp_path: Path) -> None:
    """A recording that is not there, and a simulation that is not TOML (EX_DATAERR)."""
    simulation = tmp_path / "SIM.toml"
    for text in ("= 3", '[simulation]\nmodel = "rover-wheel"\n'):
        simulation.write_text(text)
        done = regolithd("mismatch", tmp_path / "nothing.csv", "--simulation", simulation)
        assert done.exit_code == mismatch.EXIT_DATA == 65
        assert done.stderr.startswith("regolithd mismatch: ")


def test_prove_writes_figures_without_nan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A figure that is not known is null; the folder is made."""
    score = "regolithd.calibration.validation.blind_trials.score.figures_of"
    monkeypatch.setattr(score, lambda _outcomes: {"right": 0.5, "unknown": float("nan")})
    table = "regolithd.calibration.validation.blind_trials.table.score_table"
    monkeypatch.setattr(table, lambda _figures: "the score")
    console = Console(record=True, width=80)
    paths = [tmp_path / "a" / "score.json", tmp_path / "figures.json"]
    assert prove._report([], console, paths)["right"] == 0.5
    assert [json.loads(path.read_text()) for path in paths] == [{"right": 0.5, "unknown": None}] * 2
    assert console.export_text() == "the score\n"


def test_prove_hands_its_options_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A given seed is used; without one it is random; a failed batch ends with 1."""
    from regolithd.calibration.validation.blind_trials.errors import ProofError  # noqa: PLC0415  # laptop only

    batches: list[Any] = []

    def run(batch: Any, _console: Console) -> list[Any]:
        batches.append(batch)
        raise ProofError("no kernel")

    monkeypatch.setattr(prove, "_run", run)
    options = ("--recordings", 8, "--jobs", 3, "--duration", 60, "--group", "single", "--no-baselines", "--keep")
    done = regolithd("prove", "--seed", 5, "--out", tmp_path, *options)
    assert done.exit_code == 1
    assert "no kernel" in done.output
    (batch,) = batches
    assert (batch.folder, batch.seed, batch.recordings, batch.jobs, batch.duration_s) == (tmp_path, 5, 8, 3, 60.0)
    assert (batch.groups, batch.baselines, batch.keep) == (("single",), None, True)
    regolithd("prove", "--out", tmp_path)
    regolithd("prove", "--out", tmp_path)
    assert len({each.seed for each in batches}) == 3
    assert batches[1].jobs >= 1
    assert (batches[1].groups, batches[1].keep) == ((), False)
    assert batches[1].baselines


def test_schema_prints_the_document_or_writes_all(tmp_path: Path) -> None:
    """The printed document is the written one."""
    printed = regolithd("schema")
    done = regolithd("schema", "--write", tmp_path / "docs")
    written = list((tmp_path / "docs").iterdir())
    assert (tmp_path / "docs/asyncapi.json").read_text() == printed.stdout
    assert done.stdout == f"{len(written)} files written to {tmp_path / 'docs'}.\n"


def test_export_and_pictures_end_with_1_where_there_is_nothing(tmp_path: Path) -> None:
    """A recording that is none, and figures that have not been computed."""
    (tmp_path / "a.mcap").write_bytes(b"nothing")
    done = regolithd("export", tmp_path / "a.mcap", "--to", tmp_path / "a.xyz")
    assert done.exit_code == 1
    done = regolithd("pictures", "--figures", tmp_path / "none.json", "--details", tmp_path / "none.npz")
    assert done.exit_code == 1
    assert done.stderr == f"{tmp_path / 'none.json'} does not exist: run `regolithd evaluate` first\n"
    (tmp_path / "none.json").write_text("{}")
    assert regolithd("pictures", "--figures", tmp_path / "none.json", "--details", "none.npz").exit_code == 1


@pytest.mark.parametrize(("part", "estimators", "alarm"), [("all", 1, 1), ("estimators", 1, 0), ("alarm", 0, 1)])
def test_evaluate_keeps_the_figures_of_the_other_part(
    part: str, estimators: int, alarm: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the wanted part is computed, with seeds of its own; infinity is written as null."""
    from regolithd.calibration.validation.estimators import (  # noqa: PLC0415  # laptop only
        bias,
        change_detector,
        drivetrain,
        errors_and_coverage,
    )

    asked: list[Any] = []

    def note(name: str, result: Any) -> Any:
        def function(*arguments: Any) -> Any:
            asked.append((name, *(each for each in arguments if isinstance(each, int | float))))
            return result

        return function

    ratio = {"window_ratio_to_paper_cohesion_Pa": 0.25, "window_ratio_to_paper_friction_angle_deg": 0.5}
    monkeypatch.setattr(errors_and_coverage, "CASES", {"window": None})
    monkeypatch.setattr(errors_and_coverage, "estimate_all", note("all", SimpleNamespace(ranks=np.arange(3))))
    monkeypatch.setattr(errors_and_coverage, "figures", note("figures", ratio))
    monkeypatch.setattr(drivetrain, "figures", note("drivetrain", {"d": 1.0}))
    monkeypatch.setattr(bias, "figures", note("bias", {"b": 2.0}))
    delays = ({"cusum_delay_median_s": 3.5, "endless": float("inf")}, {"delays": np.ones(2)})
    monkeypatch.setattr(change_detector, "figures", note("alarm", delays))
    out, details = tmp_path / "f" / "evaluate.json", tmp_path / "evaluate.npz"
    out.parent.mkdir()
    out.write_text('{"kept": 1.0}')
    np.savez_compressed(details, old=np.zeros(1))
    options = ("--rovers", 5000, "--drives", 10, "--hours", 0.5, "--seed", 70, "--part", part)
    done = regolithd("evaluate", "--out", out, "--details", details, *options)
    assert done.exit_code == 0, done.output
    wanted = [("all", 5000, 70), ("figures",), ("drivetrain", 4000, 71), ("bias", 2000, 73)] * estimators
    assert asked == wanted + [("alarm", 10, 0.5, 72)] * alarm
    found = json.loads(out.read_text())
    assert found["kept"] == 1.0
    assert ("b" in found) == bool(estimators)
    assert found.get("rovers") == (5000 if estimators else None)
    if alarm:
        assert found["alarm_endless"] is None
        assert "alarm after 3.5 s (median)" in done.stdout
    if estimators:
        assert "window_ratio_to_paper_cohesion_Pa: 0.25" in done.stdout
    with np.load(details) as kept:
        names = {"old"} | ({"window_ranks"} if estimators else set()) | ({"alarm_delays"} if alarm else set())
        assert set(kept.files) == names


def test_a_bench_scenario_is_the_files_with_the_options_changes(tmp_path: Path) -> None:
    """Several soils are 5 m each, the last one endless; an invalid file or option exits with 78."""
    scenario = bench._scenario(None, ["lete-sand", "medium-soil", "sandy-loam"], 9, no_noise=True)
    assert [stretch.until_m for stretch in scenario.ground.stretches] == [5.0, 10.0, None]
    assert scenario.seed == 9
    assert scenario.noise == type(scenario.noise).none()
    plain = bench._scenario(None, [], None, no_noise=False)
    assert plain == type(plain)()
    path = tmp_path / "scenario.toml"
    path.write_text("seed = 4\n")
    assert bench._scenario(path, [], None, no_noise=False).seed == 4
    assert bench._scenario(path, [], 0, no_noise=False).seed == 0
    for text, soils in (("seed = 'x'\n", []), ("= 3", []), ("", ["cheese"])):
        path.write_text(text)
        with pytest.raises(typer.Exit) as ended:
            bench._scenario(path, soils, None, no_noise=False)
        assert ended.value.exit_code == 78


def test_a_brake_loads_the_wheel_that_it_is_configured_for() -> None:
    """Wheels count from 1 in `rover.toml` and from 0 in the program; gear and direction are handed on."""
    configuration = Configuration.model_validate({"brakes": {"31": {"wheel": 2, "gear_ratio": 5.0, "mirrored": True}}})
    world: Any = SimpleNamespace(truth=None)
    brakes = bench.brakes_of(configuration, configuration.described(), {11, 12, 13, 14, 15, 16}, world)
    assert brakes._descriptions == (BrakeDescription(31, wheel=1, gear_ratio=5.0, mirrored=True),)


def test_a_bench_fault_without_a_bench_is_an_error(tmp_path: Path) -> None:
    """Exit status 1, and the answer says so."""
    done = regolithd("bench-fault", "off", "3", "--control", tmp_path / "none.sock")
    assert done.exit_code == 1
    assert done.stdout.startswith("error: ")


def test_a_number_that_is_not_finite_is_refused() -> None:
    """Every option that is a number says so, with status 2: Python reads `nan` and `inf` as numbers."""
    found = 0
    group: Any = typer.main.get_command(app)
    calibrate = {("calibrate", name): each for name, each in group.commands["calibrate"].commands.items()}
    for path, command in ({(name,): each for name, each in group.commands.items()} | calibrate).items():
        for option in (each for each in command.params if each.bare_type() == "float"):
            for number in ("nan", "inf"):
                done = regolithd(*path, f"{option.opts[0]}={number}")
                assert done.exit_code == 2, (path, option.name)
                assert re.search("is not finite|be (less|greater) than", done.output)
            found += 1
    assert found >= 8


@pytest.mark.parametrize("place", ["afile", "afile/folder"])
def test_schemas_that_cannot_be_written_are_one_message(tmp_path: Path, place: str) -> None:
    """A file in the folder's place, or above it."""
    (tmp_path / "afile").touch()
    done = regolithd("schema", "--write", tmp_path / place)
    assert done.exit_code == 1
    assert done.stderr.startswith(f"{tmp_path / place}: ")
    assert done.stderr.endswith("Name a folder that can be written with --write.\n")


def test_every_command_has_a_help_text() -> None:
    """The first line of each docstring says what the command does."""
    for command in app.registered_commands:
        assert command.callback is not None
        assert (inspect.getdoc(command.callback) or "").split("\n")[0].endswith((".", ":")) or command.help
