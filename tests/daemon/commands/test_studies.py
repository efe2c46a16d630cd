"""The commands that train, reproduce and draw: what they hand on and write, with the computation replaced."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from typer.testing import CliRunner

from regolithd.daemon.cli import app
from regolithd.daemon.closed_loop import run as loop_run
from regolithd.daemon.closed_loop.run import DriveLengths

if TYPE_CHECKING:
    from pathlib import Path


def regolithd(*arguments: object) -> Any:
    """Run a command and return its result: exit status, standard output and error."""
    return CliRunner().invoke(app, [str(each) for each in arguments], catch_exceptions=False)


def test_train_keeps_the_network_with_the_lowest_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each training has its own seed; drivetrain and wheel come from the file; the mean of all errors is printed."""
    from regolithd.calibration.models import digest  # noqa: PLC0415  # laptop only
    from regolithd.calibration.paper import (  # noqa: PLC0415
        backpropagation,
        onnx_export,
        training_set,
    )

    errors, asked, sets = iter([0.05, 0.02, 0.08]), [], []

    def trained(pairs: Any, neurons: int, random: np.random.Generator, epochs: int) -> Any:
        asked.append((pairs, neurons, epochs, random.random()))
        mse = next(errors)
        return SimpleNamespace(mse=mse, epochs=round(1000 * mse), perceptron=f"perceptron {mse}")

    def pairs(drivetrain: Any, wheel: Any, _random: Any) -> str:
        sets.append((drivetrain.no_load_current_A[0], wheel.radius_m))
        return "pairs"

    monkeypatch.setattr(backpropagation, "train", trained)
    monkeypatch.setattr(training_set, "training_set", pairs)
    monkeypatch.setattr(
        onnx_export, "export_onnx", lambda perceptron, _: SimpleNamespace(SerializeToString=perceptron.encode)
    )
    monkeypatch.setattr(onnx_export, "model_card", lambda *_: SimpleNamespace(version="paper-3:5:2"))
    monkeypatch.setattr(digest, "with_digest", lambda model: model + b" with its digest")
    config = tmp_path / "rover.toml"
    config.write_text("[wheel]\nradius_m = 0.08\n[drivetrain]\nno_load_current_A = 0.01\n")
    out = tmp_path / "folder" / "terrain.onnx"
    options = ("--neurons", 5, "--trainings", 3, "--epochs", 70, "--config", config, "--out", out)
    done = regolithd("train", *options)
    assert out.read_text() == "perceptron 0.02 with its digest"
    assert [each[:3] for each in asked] == [("pairs", 5, 70)] * 3
    assert len({each[3] for each in asked}) == 3
    assert sets == [(0.01, 0.08)]
    assert "paper-3:5:2: MSE 0.0200 after 20 epochs\nmean MSE of 3: 0.0500 (the paper: 0.0251)." in done.stdout


def test_train_posterior_hands_seed_and_numbers_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So many rovers are simulated, and so many steps fitted; the wheel's radius goes into the file."""
    from regolithd.calibration.models import digest  # noqa: PLC0415  # laptop only
    from regolithd.calibration.posterior import (  # noqa: PLC0415
        onnx_export,
        training,
        training_examples,
    )

    asked: list[Any] = []

    def simulate(count: int, _random: Any, tick: Any) -> str:
        asked.append(count)
        tick(count)
        return "examples"

    def fit(examples: Any, seed: int, steps: int, *, progress: Any) -> tuple[str, str]:
        asked.append((examples, seed, steps))
        progress(1.25)
        return "parameters", "standardisation"

    def export(*given: Any) -> Any:
        asked.append(given)
        return SimpleNamespace(SerializeToString="model".encode)

    monkeypatch.setattr(training_examples, "simulate_examples", simulate)
    monkeypatch.setattr(training, "fit", fit)
    monkeypatch.setattr(onnx_export, "export_onnx", export)
    monkeypatch.setattr(digest, "with_digest", lambda model: model + b" with its digest")
    out = tmp_path / "folder" / "deeper" / "posterior.onnx"
    done = regolithd("train-posterior", "--rovers", 2000, "--steps", 60, "--seed", 9, "--out", out)
    assert asked == [2000, ("examples", 9, 60), ("parameters", "standardisation", 0.075)]
    assert out.read_text() == "model with its digest"
    assert done.stdout.endswith(f"Wrote {out}.\n")


@pytest.mark.parametrize(
    ("options", "lengths", "names"),
    [
        (("--short",), DriveLengths(400.0, 180.0, 1.1), ["coulomb", "viscous", "nothing"]),
        (("--case", "nothing", "--case", "coulomb"), DriveLengths(), ["coulomb", "nothing"]),
    ],
)
def test_loop_runs_the_wanted_cases(
    options: tuple[str, ...], lengths: DriveLengths, names: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each in its own folder; figures and picture are written for all, the picture into the folder by default."""
    from regolithd.daemon.closed_loop import picture, summary  # noqa: PLC0415  # matplotlib is of the laptop

    asked, drawn = [], []

    def run_case(case: Any, seed: int, folder: Path, _network: Any, given: DriveLengths, progress: Any) -> str:
        asked.append((case.name, seed, folder, given))
        progress("a step")
        return case.name

    monkeypatch.setattr(loop_run, "run_case", run_case)
    monkeypatch.setattr(summary, "sentence", lambda result: f"sentence of {result}")
    monkeypatch.setattr(summary, "figures_of", lambda results: {"cases": len(results)})
    monkeypatch.setattr(picture, "draw", lambda results, path: drawn.append((results, path)))
    out, figures = tmp_path / "out", tmp_path / "folder" / "deeper" / "loop.json"
    done = regolithd("loop", "--seed", 7, "--out", out, "--figures", figures, *options)
    assert asked == [(name, 7, out / name, lengths) for name in names]
    assert json.loads(figures.read_text()) == {"seed": 7, "cases": len(names)}
    assert drawn == [(names, out / "loop.svg")]
    assert done.stdout.splitlines()[: len(names)] == [f"sentence of {name}" for name in names]
    regolithd("loop", "--out", out, "--figures", figures, "--picture", tmp_path / "mine.svg", *options)
    assert drawn[1][1] == tmp_path / "mine.svg"


def test_reproduce_writes_page_pictures_and_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The best network drives the traverses; a quarter of the trainings, two at least, tries other constants."""
    from regolithd.calibration.validation.reproduction import (  # noqa: PLC0415  # laptop only
        page,
        pictures,
        published,
        recomputation,
        scalings,
    )

    asked: dict[str, Any] = {}
    done = [SimpleNamespace(mse=mse, perceptron=lambda inputs, mse=mse: (mse, inputs)) for mse in (0.3, 0.1, 0.2)]

    def trained(_drivetrain: Any, _wheel: Any, count: int, *, tick: Any) -> Any:
        asked["trainings"] = count
        tick()
        return SimpleNamespace(inputs="inputs"), done

    def unpublished(count: int, _tick: Any) -> str:
        asked["unpublished"] = count
        return "unpublished"

    def traverse(perceptron: Any, ground: str, _random: Any) -> str:
        asked.setdefault("best", perceptron(0)[0])
        return f"traverse on {ground}"

    record = SimpleNamespace(cohesion_Pa=3351.6, angle_deg=28.64)
    monkeypatch.setattr(recomputation, "trained", trained)
    monkeypatch.setattr(recomputation, "unpublished_constants", unpublished)
    monkeypatch.setattr(recomputation, "traverse", traverse)
    monkeypatch.setattr(recomputation, "record_500", lambda _done: record)
    monkeypatch.setattr(recomputation, "current_sweep", lambda _network, _current: np.array([[3300.0, 28.0]]))
    monkeypatch.setattr(recomputation, "load_ranges", lambda _pairs: "loads")
    monkeypatch.setattr(scalings, "scalings", lambda _pairs, _predicted: "scalings")
    results: list[Any] = []
    monkeypatch.setattr(page, "page", lambda found: results.append(found) or "the page")
    monkeypatch.setattr(page, "figures", lambda _found: {"figure": 1.5})
    for name in ("training_set", "traverse", "sizing"):
        monkeypatch.setattr(pictures, name, lambda _what, path, name=name: path.write_text(name))
    docs, figures, sizing = tmp_path / "docs", tmp_path / "a" / "reproduce.json", tmp_path / "sizing.json"
    options = ("--docs", docs, "--figures", figures, "--sizing", sizing)
    printed = regolithd("reproduce", "--trainings", 20, *options)
    assert asked == {"trainings": 20, "unpublished": 5, "best": 0.1}
    assert "record 500: c 3352 Pa (paper 3352), φ 28.6° (28.6)" in printed.stdout
    assert (docs / "results" / "reproduction.md").read_text() == "the page"
    assert sorted(path.name for path in (docs / "pictures").iterdir()) == ["training-set.svg", "traverse.svg"]
    assert json.loads(figures.read_text()) == {"figure": 1.5}
    (found,) = results
    assert (found.trainings, found.noise_free, found.sizing) == (20, (3300.0, 28.0), None)
    assert found.traverses == [f"traverse on {ground}" for ground in published.COHESION_PA]
    sizing.write_text('{"sizes": 3}')
    regolithd("reproduce", "--trainings", 4, *options)
    assert asked["unpublished"] == 2
    assert results[1].sizing == {"sizes": 3}
    assert (docs / "pictures" / "sizing.svg").read_text() == "sizing"


def test_pictures_draws_five(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From figures and details of `regolithd evaluate`; the alarm's delays are those whose name says so."""
    from regolithd.calibration.validation.estimators import pictures  # noqa: PLC0415  # laptop only

    drawn: dict[str, Any] = {}
    for name in ("errors", "calibration", "one_sample", "alarm", "drivetrain"):
        monkeypatch.setattr(pictures, name, lambda *given, name=name: drawn.update({name: given}))
    figures, details = tmp_path / "evaluate.json", tmp_path / "evaluate.npz"
    figures.write_text('{"x": 1}')
    np.savez_compressed(details, window_ranks=np.arange(2), alarm_cusum=np.ones(3))
    done = regolithd("pictures", "--figures", figures, "--details", details, "--docs", tmp_path)
    assert (done.exit_code, done.stdout) == (0, f"Wrote five pictures to {tmp_path}.\n")
    assert [given[-1].name for given in drawn.values()] == [
        "estimators.svg",
        "coverage.svg",
        "one-sample.png",
        "alarm.svg",
        "drivetrain.svg",
    ]
    assert drawn["errors"][0] == drawn["drivetrain"][0] == {"x": 1}
    assert list(drawn["alarm"][0]) == ["alarm_cusum"]
    assert drawn["calibration"][1].tolist() == [0, 1]


def test_sizing_continues_from_its_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Outcomes of the log are not trained again; the figures have what this run added."""
    from regolithd.calibration.paper import sizing, sizing_speed, training_set  # noqa: PLC0415  # laptop only

    asked: dict[str, Any] = {}
    old, new = SimpleNamespace(neurons=8), SimpleNamespace(neurons=16)
    best = SimpleNamespace(neurons=64, mean_mse=0.02512, standard_error=0.0003)

    def run(study: Any, pairs: Any, outcomes: Any, log: Path, _cores: int) -> Any:
        asked.update(study=(study.trainings, study.epochs), pairs=pairs, resumed=list(outcomes), log=log)
        yield from (new, new)

    def compare(pairs: Any, folder: Path, epochs: int) -> Any:
        asked["timing"] = (pairs, folder, epochs)
        return SimpleNamespace(ratio=12.4, ratio_one_core=7.6)

    monkeypatch.setattr(training_set, "training_set", lambda *_: "pairs")
    monkeypatch.setattr(sizing, "resume", lambda _log, _study: [old])
    monkeypatch.setattr(sizing, "run", run)
    monkeypatch.setattr(sizing, "best_size", lambda outcomes: best if len(outcomes) == 3 else None)
    monkeypatch.setattr(sizing_speed, "compare_speed", compare)
    monkeypatch.setattr(sizing_speed, "figures", lambda _study, outcomes, _speed: {"outcomes": len(outcomes)})
    out, log = tmp_path / "a" / "sizing.json", tmp_path / "b" / "log.jsonl"
    options = ("--out", out, "--log", log, "--trainings", 3, "--epochs", 20, "--timing-epochs", 7)
    done = regolithd("sizing", *options)
    assert asked["study"] == (3, 20)
    assert asked["resumed"] == [old]
    assert asked["timing"] == ("pairs", log.parent, 7)
    found = json.loads(out.read_text())
    assert (found["outcomes"], found["trainings_this_run"]) == (3, 2)
    assert 0.0 <= found["seconds_this_run"] < 60.0
    assert "lowest mean MSE: 0.0251 ± 0.0003 at 64 neurons" in done.stdout
    assert "scikit-learn takes 12 times as long (8 on one core)." in done.stdout

    def interrupted(*_arguments: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(sizing, "run", interrupted)
    done = regolithd("sizing", *options)
    assert (done.exit_code, "Interrupted; finished trainings are in" in done.stderr) == (130, True)

    def different(*_arguments: Any) -> Any:
        raise sizing.DifferentStudyError("another study")

    monkeypatch.setattr(sizing, "resume", different)
    assert regolithd("sizing", *options).exit_code == 1
