"""A candidate is added by one file: the example in the package's docstring."""

from __future__ import annotations

import json
import sys
import textwrap
import tomllib
from typing import TYPE_CHECKING

import numpy as np
import pytest
from rover_drives import TABLES, columns, simulation

from regolithd.calibration.mismatch import candidates
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.changes import corrected_problem, stated_in
from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.corrected import corrected_tables, stated_effects
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.reference.effects import effect_sections
from regolithd.calibration.mismatch.report.page import render_report
from regolithd.calibration.mismatch.report.template import Provenance
from regolithd.calibration.toml_document import to_toml

if TYPE_CHECKING:
    from collections.abc import Iterator

    from regolithd.calibration.mismatch.result import Comparison


def example() -> str:
    """Return the code in the docstring of the candidates' package."""
    text = candidates.__doc__ or ""
    code = text[text.index("    '''Aerodynamic") : text.index("\nAn effect of one machine")]
    return textwrap.dedent(code).replace("'''", '"""')


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Comparison]:
    """The comparison of a recording with such a drag, with the file in the candidates' folder."""
    folder = tmp_path_factory.mktemp("candidates")
    (folder / "aerodynamic_drag.py").write_text(example(), encoding="utf-8")
    candidates.__path__.append(str(folder))
    library.cache_clear()
    table = columns(3, length_s=250.0)
    speed = table["motor_speed_rad_s"] / 1400
    drag = 0.5 * np.mean(np.abs(table["motor_current_A"])) * speed * np.abs(speed) / np.mean(speed**2)
    table["motor_current_A"] = table["motor_current_A"] + drag
    yield compare(from_columns(table), simulation())
    candidates.__path__.remove(str(folder))
    sys.modules.pop(f"{candidates.__name__}.aerodynamic_drag")
    library.cache_clear()


def test_it_is_in_the_answer_with_its_sentence(found: Comparison) -> None:
    """Name, wheels, unit and words come from the class."""
    (effect,) = found.answer.effects
    assert effect.name == "aerodynamic-drag"
    assert effect.wheels == (1, 2, 3, 4, 5, 6)
    assert effect.statement.startswith("Drag that grows with the square of speed, on all 6 wheels: ")
    assert effect.parameters["drag_coefficient"].unit == "A s²/rad²"
    assert json.loads(json.dumps(found.answer.to_json()))["effects"][0]["equation"] == "Δy = d sign(ω) ω²"


def test_it_has_a_sensitivity_once_it_is_not_there(found: Comparison) -> None:
    """Every candidate of the library has a smallest detectable effect."""
    assert "aerodynamic-drag" in {one.name for one in found.answer.sensitivity}


def test_it_is_in_the_report(found: Comparison) -> None:
    """Label, parameter and the curve over its covariate."""
    page = render_report(found.answer, found.evidence, Provenance("drive.csv", "SIM.toml", "a", "b"))
    assert "The simulation leaves out aerodynamic drag." in page
    assert "drag coefficient" in page
    assert "Residual against wheel speed." in page


def test_the_corrected_simulation_has_it_and_adds_it_again(found: Comparison) -> None:
    """`[[effects]]` holds the term, and the columns of the class turn it into a current."""
    evidence = found.evidence
    text = to_toml(
        corrected_tables(TABLES, simulation(), evidence.values, evidence.contributions, found.answer.effects)
    )
    (term,) = stated_effects(tomllib.loads(text))
    assert term.name == "aerodynamic-drag"
    assert evidence.problem is not None
    added = corrected_problem(evidence.problem, stated_in(library(), [term], ())).added
    speed = evidence.problem.covariates["wheel_speed"]
    expected = np.where(evidence.problem.mask, term.coefficients[0] * speed * np.abs(speed), 0.0)
    np.testing.assert_allclose(added, expected)


def test_it_is_in_the_documentation(found: Comparison) -> None:
    """The page of the effects is made from the library."""
    assert found
    page = effect_sections()
    assert "## Aerodynamic drag" in page
    assert "Newton (1687)" in page
    assert page.count("\n## ") == len(library()) + 1, "and the units of a load"
