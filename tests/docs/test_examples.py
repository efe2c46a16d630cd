"""The runner of the worked examples: what is missing is said, and what is unseen is kept apart."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"


@pytest.fixture
def modules(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, Any]]:
    """The runner's modules, which lie beside each other as a user has them."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    yield {name: importlib.import_module(name) for name in ("published", "peers", "run")}
    for name in ("published", "peers", "run"):
        sys.modules.pop(name, None)


def test_recordings_that_are_not_there_are_said(
    modules: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each with the page that says where it comes from; the run ends without an error."""
    modules["run"].main(tmp_path, tmp_path / "real.json", tmp_path / "reports")
    told = capsys.readouterr().out.splitlines()
    assert len(told) == len(modules["published"].EXAMPLES)
    for line, example in zip(told, modules["published"].EXAMPLES, strict=True):
        page = EXAMPLES.parents[1] / line.split("; ")[1].split(" ")[0]
        assert example.file in line
        assert page.is_file()
    assert json.loads((tmp_path / "real.json").read_text()) == {}


@pytest.mark.parametrize("column", ["run", "t_s"])
def test_a_recording_is_cut_into_what_is_compared_and_what_is_unseen(
    modules: dict[str, Any], tmp_path: Path, column: str
) -> None:
    """By runs where there are several, else by time; no row is in both parts."""
    table = tmp_path / "all.csv"
    table.write_text(f"{column},x\n" + "".join(f"{place},{place}\n" for place in range(10)))
    parts = modules["published"].cut(table, tmp_path, 0.6)
    first, second = ([line.split(",")[0] for line in part.read_text().split()[1:]] for part in parts)
    assert (first, second) == (list("012345"), list("6789"))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("method", ["PySINDy", "FROLS", "stepwise BIC", "Gaussian process"])
def test_a_method_predicts_a_residual_that_its_library_holds(modules: dict[str, Any], method: str) -> None:
    """A parabola under noise, on rows that it has not seen."""
    rng = np.random.default_rng(1)
    features = rng.uniform(-1, 1, (240, 2))
    true = 0.3 * features[:, 0] ** 2 - 0.2 * features[:, 1]
    residual = true + rng.normal(0, 0.02, 240)
    found = modules["peers"].predicted_residual(method, (features[:160], residual[:160]), features[160:])
    if isinstance(found, str):
        pytest.skip(found)
    assert np.sqrt(np.mean((found - true[160:]) ** 2)) < 0.02
