"""A mistake in a user's class is one message with method, file and line; a class without one is as it was."""

from __future__ import annotations

import inspect
import pickle
from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.candidates.candidate import Candidate
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.errors import MismatchError, MissingColumnError
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.simulation.checked import CheckedSimulation, checked
from regolithd.calibration.mismatch.simulation.checked_candidate import CheckedCandidate, checked_candidate
from regolithd.calibration.mismatch.simulation.load import load_simulation
from regolithd.calibration.mismatch.simulation.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

ROWS = 30_000
"""A result of shape (n,) must not become one of (n, n): that would be 7 GB."""
CLASS = """
import numpy as np

from regolithd.calibration.mismatch import Candidate, Coefficient, Prior, Simulation


class Bump(Candidate):
    name, covariate, equation, words = "bump", "time", "b", "a bump"
    signature, experiment, source = "a bump", "drive over it", "made up"
    coefficients = (Coefficient("height"),)

    def columns(self, problem, shape):
        return np.ones((1, *problem.mask.shape))


class Axis(Simulation):
    channel, unit = "force_N", "N"
    wheel_column = "axis"
    inputs = ("acceleration_m_s2",)
    parameters = {"mass_kg": Prior(95.0, 2.0, "kg")}

    def prepare(self, recording):
        return recording.with_channels(acceleration_m_s2=np.gradient(recording.channel("speed_m_s"), axis=0))

    def predict(self, inputs, values):
        return values["mass_kg"] * inputs["acceleration_m_s2"]

    def covariates(self, inputs):
        return {"time": inputs["t_s"], "wheel_speed": inputs["speed_m_s"]}

    def candidates(self, library):
        return (*library, Bump())
"""


def columns() -> dict[str, NDArray[np.float64]]:
    """Return a recording's columns."""
    time_s = 0.01 * np.arange(ROWS)
    return {"t_s": time_s, "speed_m_s": np.sin(time_s), "force_N": np.cos(time_s)}


def use(folder: Path, old: str, new: str, table: Mapping[str, NDArray[np.float64]]) -> None:
    """Load the class with one change, and do with it what a comparison does first."""
    assert old in CLASS
    (folder / "axis.py").write_text(CLASS.replace(old, new))
    (folder / "SIM.toml").write_text('[simulation]\nmodel = "axis:Axis"\n')
    simulation = load_simulation(folder / "SIM.toml")
    problem = build_problem(from_columns(table, unit="axis"), simulation)
    for candidate in simulation.candidates(()):
        candidate.columns(problem, candidate.shapes(problem)[0])
    simulation.absorb_effects(simulation.corrected_tables(problem.values), ())


def test_a_class_without_a_mistake_is_used(tmp_path: Path) -> None:
    """Nothing is refused, and a candidate of its own has its columns."""
    use(tmp_path, "import", "import", columns())


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("def predict(self", "def predict((self", "axis.py, line 25): SyntaxError"),
        ("import numpy", "import nunpy", "axis.py, line 2): ModuleNotFoundError: No module named 'nunpy'"),
        ("import numpy", "raise SystemExit(1)\nimport numpy", "axis.py, line 2): SystemExit"),
        ("class Axis", "class Axle", "axis has no Axis; it has Axle"),
        ("class Axis(Simulation)", "class Axis", "Axis in axis must be a subclass"),
        ('channel, unit = "force_N", "N"', 'unit = "N"', "it must state the recorded column that it predicts"),
        ('Prior(95.0, 2.0, "kg")', "95.0", 'parameters["mass_kg"] must be Prior(value, std, unit), not 95.0'),
        ('Prior(95.0, 2.0, "kg")', "Prior(95.0, -2.0)", "must have a std of 0 (exact) or more, not -2.0"),
        ('("acceleration_m_s2",)', '("acceleration_m_s2")', "inputs must be a tuple of names"),
        ("def predict", "def predit", "it needs a method predict(self, inputs, values)"),
        ("inputs, values):", "inputs):", "Axis.predict ("),
        ('values["mass_kg"] *', "1 / 0 *", "axis.py, line 26): ZeroDivisionError: division by zero"),
        ('values["mass_kg"]', 'values["mas_kg"]', "did you mean mass_kg?"),
        ('inputs["acceleration_m_s2"]', 'inputs["aceleration_m_s2"]', "did you mean acceleration_m_s2?"),
        ('inputs["acceleration_m_s2"]', 'inputs["acceleration_m_s2"][:, 0]', "Axis.predict must have shape (30000, 1)"),
        ('values["mass_kg"] *', "1j *", "Axis.predict must be real numbers of shape (30000, 1), not complex128"),
        ("return values", "values", "Axis.predict must have shape (30000, 1), not ()"),
        ('return values["mass_kg"] *', 'return "text" #', "Axis.predict must be real numbers"),
        ('inputs["speed_m_s"]}', 'inputs["speed_m_s"][0]}', "Axis.covariates: wheel_speed must have shape (30000, 1)"),
        ('inputs["speed_m_s"]}', 'inputs["speed"]}', "axis.py, line 29): it reads column speed, which the recording"),
        ("return {", "return list({", "SyntaxError"),
        ("return recording.with", "recording.with", "Axis.prepare returned a NoneType, not a Recording"),
        ('recording.channel("speed_m_s")', 'recording.channels["speed"]', "it reads column speed, which the recording"),
        ('recording.channel("speed_m_s")', 'recording.channel("spee_m_s")', "did you mean speed_m_s?"),
        (", axis=0))", ", axis=0)[1:])", "column acceleration_m_s2 must have shape (30000, 1), not (29999, 1)"),
        ("Bump())", "Bump)", "Axis.candidates must return candidates; write Bump()"),
        ('source = "a bump", "drive over it", "made up"', 'so = "a bump", "drive over it", 1', "must state source"),
        ("np.ones((1, *problem.mask.shape))", "np.ones(problem.mask.shape)", "Bump.columns, one for each of its coeff"),
        ("np.ones((1, *problem.mask.shape))", "np.ones(problem.mas.shape)", "Bump.columns ("),
    ],
)  # fmt: skip
def test_a_mistake_is_one_message_with_its_place(old: str, new: str, told: str, tmp_path: Path) -> None:
    """Whatever is wrong, one error of the tool's own says it, and names the class, method or file."""
    with pytest.raises(MismatchError) as caught:
        use(tmp_path, old, new, columns())
    assert told in str(caught.value)


def test_an_input_with_blanks_that_a_filter_spreads_is_named(tmp_path: Path) -> None:
    """The cause is told, not the derived channel alone."""
    table = columns()
    table["speed_m_s"][100] = np.nan
    with pytest.raises(MismatchError) as caught:
        use(tmp_path, "np.gradient(", "0 * np.sum(recording.channel('speed_m_s')) + np.gradient(", table)
    assert "column speed_m_s, which it reads, is blank in 1 of 30000 readings" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "told"),
    [("force_N", "the simulation needs column force_N"), ("speed_m_s", "it reads column speed_m_s")],
)
def test_an_absent_column_is_named(name: str, told: str, tmp_path: Path) -> None:
    """Both the predicted column and one that only `prepare` reads."""
    table = {key: values for key, values in columns().items() if key != name}
    with pytest.raises(MismatchError) as caught:
        use(tmp_path, "import", "import", table)
    assert told in str(caught.value)


def test_a_predicted_column_that_is_always_zero_is_refused(tmp_path: Path) -> None:
    """Nothing was measured."""
    with pytest.raises(MismatchError, match="is 0 wherever it was measured"):
        use(tmp_path, "import", "import", {**columns(), "force_N": np.zeros(ROWS)})


@pytest.mark.parametrize("sign", ["", "-"])
def test_an_infinite_value_is_no_measurement(sign: str, tmp_path: Path) -> None:
    """A derived channel that is 0 but for a division by zero was not measured either."""
    bad = f"force_N=np.where(np.arange({ROWS})[:, None] == 5, {sign}np.inf, 0.0), "
    with pytest.raises(MismatchError, match="is 0 wherever it was measured"):
        use(tmp_path, "with_channels(", f"with_channels({bad}", columns())


def test_a_missing_column_is_also_a_key_error() -> None:
    """A class may catch it as it would catch that of a dict, and its text has no quotes around it."""
    error = MissingColumnError("x", "there is no x")
    assert isinstance(error, KeyError)
    assert str(error) == "there is no x"


def test_two_modules_of_one_name_do_not_meet(tmp_path: Path) -> None:
    """Each SIM.toml gets the class beside it."""
    for mass in ("10.0", "20.0"):
        folder = tmp_path / mass
        folder.mkdir()
        (folder / "axis.py").write_text(CLASS.replace("95.0", mass))
        (folder / "SIM.toml").write_text('[simulation]\nmodel = "axis:Axis"\n')
        assert load_simulation(folder / "SIM.toml").parameters["mass_kg"].value == float(mass)


class Plain(Simulation):
    """The least that a simulation states."""

    channel = "y"

    def predict(self, inputs: Mapping[str, NDArray[np.float64]], values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return nothing but zeros."""
        return 0 * inputs["t_s"] * len(values)

    def own(self) -> str:
        """Return something that only this class has."""
        return "own"


def test_the_view_has_everything_of_the_simulation() -> None:
    """Attributes, methods of its own and its class are those of the simulation; it is wrapped once."""
    found = checked(Plain())
    assert isinstance(found, Plain)
    assert found.own() == "own"
    assert found.channel == "y"
    assert checked(found) is found
    assert type(pickle.loads(pickle.dumps(checked(load_simulation(ROVER))))) is CheckedSimulation


ROVER = {"simulation": {"model": "rover-wheel"}, "soil": {
    "cohesion_Pa": 1220.0, "friction_angle_deg": 30.3, "shear_modulus_m": 0.0116, "sinkage_exponent": 0.79,
    "k_c_kN": 102.0, "k_phi_kN": 5301.0,
}}  # fmt: skip


def test_no_method_is_left_unchecked() -> None:
    """A method that `Simulation` gains is checked too."""
    public = {name for name, value in vars(Simulation).items() if inspect.isfunction(value) and name[0] != "_"}
    assert public <= set(vars(CheckedSimulation))


def test_candidates_of_the_library_are_as_they_are() -> None:
    """Only the user's own are wrapped, and once."""
    from regolithd.calibration.mismatch.candidates.coulomb_friction import CoulombFriction  # noqa: PLC0415

    ours = CoulombFriction()
    assert checked_candidate(ours, "here") is ours
    own = type("Own", (CoulombFriction,), {"__module__": "mine"})()
    found = checked_candidate(own, "here")
    assert type(found) is CheckedCandidate
    assert isinstance(found, Candidate)
    assert checked_candidate(found, "here") is found


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ('return -problem.covariates["torque"][None]', r"Loss\.columns \(.*loss\.py, line 18\): KeyError: 'torque'"),
        ('return problem.covariates["level"]', r"Loss\.columns, .* must have shape \(1, 200, 1\), not \(200, 1\)"),
    ],
)
def test_what_a_candidate_of_the_user_s_own_raises_is_told(tmp_path: Path, body: str, told: str) -> None:
    """Through the whole comparison, in which a candidate is asked for its form for the simulation."""
    (
        tmp_path / "loss.py"
    ).write_text(f"""from regolithd.calibration.mismatch import Candidate, Coefficient, Prior, Simulation


class Loss(Candidate):
    name, covariate = "own-loss", "level"
    equation = "ΔP = -c P"
    words = "a loss"
    signature = "less"
    experiment = "run it"
    source = "test"
    requires = ("level",)
    along_motion = False
    coefficients = (Coefficient("share", "1"),)



    def columns(self, problem, shape):
        {body}


class Pump(Simulation):
    channel, unit = "power_W", "W"
    parameters = {{"gain": Prior(2.0, 0.1)}}

    def predict(self, inputs, values):
        return values["gain"] * inputs["level_m"]

    def covariates(self, inputs):
        return {{"level": inputs["level_m"]}}

    def candidates(self, library):
        return (*library, Loss())
""")
    (tmp_path / "SIM.toml").write_text('[simulation]\nmodel = "loss:Pump"\n')
    rng = np.random.default_rng(0)
    level = rng.uniform(1, 2, 200)
    columns = {"t_s": np.arange(200.0), "level_m": level, "power_W": 2 * level + rng.normal(0, 0.1, 200)}
    with pytest.raises(MismatchError, match=told):
        compare(columns, load_simulation(tmp_path / "SIM.toml"))


def test_values_at_which_a_prediction_fails_are_told(tmp_path: Path) -> None:
    """At the stated ones nothing is added: the class itself is wrong."""
    refusing = CLASS.replace(
        'return values["mass_kg"]', 'assert values["mass_kg"] != self.refused\n        return values["mass_kg"]'
    )
    (tmp_path / "axis.py").write_text(
        refusing.replace("class Axis(Simulation):", "class Axis(Simulation):\n    refused = 95.0")
    )
    (tmp_path / "SIM.toml").write_text('[simulation]\nmodel = "axis:Axis"\n')
    simulation = load_simulation(tmp_path / "SIM.toml")
    inputs = {"acceleration_m_s2": np.ones((3, 1)), "t_s": np.arange(3.0)[:, None]}
    with pytest.raises(MismatchError) as caught:
        simulation.predict(inputs, {"mass_kg": 95.0})
    assert "AssertionError" in str(caught.value)
    assert "mass_kg" not in str(caught.value)
    simulation.inner.refused = -1.5
    with pytest.raises(MismatchError, match=r"AssertionError: ; this was with mass_kg = -1\.5, where the recording"):
        simulation.predict(inputs, {"mass_kg": -1.5})
