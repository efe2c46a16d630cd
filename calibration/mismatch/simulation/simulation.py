"""The interface of a simulation: what it predicts, how well its parameters are known, and its covariates.

A simulation predicts one channel from others. Everything else is optional. The shortest one:

    class ServoAxis(Simulation):
        channel, unit = "force_N", "N"
        parameters = {"mass_kg": Prior(95.0, 5.0, "kg")}

        def predict(self, inputs, values):
            return values["mass_kg"] * inputs["acceleration_m_s2"]

        def covariates(self, inputs):
            return {"wheel_speed": inputs["speed_m_s"], "time": inputs["t_s"]}

`python -c`-importable as `package.module`, it is named in SIM.toml as `model = "package.module:ServoAxis"`. The other
tables of SIM.toml arrive in `from_tables`, whose default lets `[parameters]` replace priors.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.simulation.stated_priors import stated_priors
from regolithd.calibration.mismatch.simulation.stated_sensors import stated_sensors

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.contribution import Contribution
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.data.slow_channels import Between
    from regolithd.calibration.mismatch.problem.corrections.empirical_curve import StatedCurve
    from regolithd.calibration.mismatch.problem.prior import Prior, SensorError

Array = NDArray[np.float64]


class Simulation:
    """A simulation: derive from it, and define `channel`, `parameters` and `predict`."""

    channel: ClassVar[str]
    """The recorded column that is predicted."""
    unit: ClassVar[str] = "1"
    channels: ClassVar[Mapping[str, str]] = {}
    """Several predicted columns with their units: {"thrust_N": "N", "torque_Nm": "N·m"}. Then `predict` returns a
    mapping of arrays by these names, and `channel` and `unit` are not needed."""
    wheel_column: ClassVar[str] = "wheel"
    """The column that tells wheels (axes, sides, bodies) apart. A recording without it has one."""
    inputs: ClassVar[tuple[str, ...]] = ()
    """Columns without which nothing can be predicted."""
    parameters: Mapping[str, Prior] = {}
    """Every parameter's prior, by name."""
    own_to_each_wheel: ClassVar[frozenset[str]] = frozenset()
    """Parameters of which each wheel has a deviation of its own (`Thresholds.own_share`) beside the common one."""
    parameter_effects: ClassVar[Mapping[str, str]] = {}
    """For sets of effects that cannot be told apart: by parameter, the name of the effect that it is like, of the
    library or a word of your own: {"friction_Nm": "coulomb-friction", "gain": "drive-gain"}."""
    unlikely_effects: ClassVar[frozenset[str]] = frozenset()
    """Names of candidates that this machine hardly has: each must gain `Thresholds.unlikely_penalty` more than others.
    Physics that it cannot have at all is named in `without_effects`."""
    without_effects: Sequence[str] = ()
    """Names of candidates that are not looked for, as the machine cannot have them; SIM.toml's `[simulation]
    without_effects` adds to them."""
    covariate_labels: ClassVar[Mapping[str, str]] = {}
    """Axis labels with units for the report, by covariate: {"wheel_speed": "carriage speed (m/s)"}."""
    unloaded_experiment: ClassVar[str] = ""
    """How to run the machine without its load, as an instruction: what free parameters of the load hide shows there."""
    one_way: bool | None = None
    """Whether the machine runs one way only (a pump, a fan): then no experiment asks for a reversal. None: not said."""
    motor_constant_at_degC: float | None = None
    """The temperature at which the torque constant is what the simulation states; None: as data sheets have it.
    SIM.toml's `[simulation] motor_constant_at_degC` replaces it."""
    experiment_spans: ClassVar[Mapping[str, float]] = {}
    """How far from its usual value, each way, an experiment can move a covariate: {"temperature": 15.0, "pitch": 0.1}.
    Where nothing is said, a speed, load, torque or slip is varied from half to one and a half times the usual one, and
    everything else over what the recording has of it."""
    between_readings: ClassVar[Mapping[str, Between]] = {}
    """What to do between the readings of a column that is sampled less often than the rows: `linear` (the default),
    `hold` or `blank`."""
    zero_means_nothing: ClassVar[bool | None] = None
    """Whether the zero of the predicted channel is arbitrary, so that effects are measured against how far it moves.
    None: of a temperature, and of a voltage, pressure or length that is far from zero (`problem/readings/zero.py`)."""
    undefined_at_times: ClassVar[frozenset[str]] = frozenset()
    """Covariates whose NaN means that they do not apply (the slip of a wheel that stands), not that they are blank."""
    own_tables: ClassVar[tuple[str, ...]] = ()
    """Tables of SIM.toml that the simulation reads itself, from `self.stated`."""
    stated: Mapping[str, Any] = {}
    """SIM.toml's tables, as read."""
    corrected_effects: Sequence[Contribution] = ()
    """The effects that SIM.toml's `[[effects]]` add to the prediction, as `--corrected` wrote them."""
    empirical_curves: Sequence[StatedCurve] = ()
    """The curves that SIM.toml's `[[empirical_curves]]` add to it, as `--corrected --empirical` wrote them."""
    source: Path | None = None
    """The SIM.toml that the simulation was loaded from."""
    sensors: Mapping[str, SensorError] = {}
    """The errors of the recorded inputs, by column; SIM.toml's `[sensors]` replaces them."""

    @classmethod
    def from_tables(cls, tables: Mapping[str, Any]) -> Self:
        """Build from SIM.toml's tables.

        `[parameters.NAME] value, std` replaces a prior. So does a key of any other table that has a parameter's name:
        `area_m2 = 0.5`, with `area_m2_std` or `area_m2_relative_std` beside it. `[sensors]` has errors of inputs.

        Raises
        ------
        SimulationError
            For a table or key that is no parameter of this class, or a value that is no number.
        """
        made = cls()
        made.stated = tables
        made.parameters = stated_priors(tables, made.parameters, made.own_tables)
        made.sensors = stated_sensors(tables, made)
        return made

    def prepare(self, recording: Recording) -> Recording:
        """Derive the channels that the prediction needs (an acceleration from a position, say)."""
        return recording

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the channel, shape (time, wheel); NaN where the simulation says nothing.

        `inputs` holds every recorded channel, and `t_s` of the same shape.
        """
        raise NotImplementedError

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what a residual may be ordered by, by the contract's names (`wheel_speed`, `temperature`, …)."""
        return {"time": inputs["t_s"]}

    def side(self, wheels: Sequence[int | str]) -> Array | None:  # noqa: ARG002  # subclasses look
        """Return −1 for wheels on the left, +1 on the right; None where the machine has no sides."""
        return None

    def row(self, wheels: Sequence[int | str]) -> Array | None:  # noqa: ARG002
        """Return each wheel's place along the machine, front 0; None where it has no rows."""
        return None

    def wheel_sets(self, wheels: Sequence[int | str]) -> Sequence[tuple[int, ...]]:
        """Return sets of wheels, by their indices, that may share an effect; by default each side and each row."""
        places = [place for place in (self.side(wheels), self.row(wheels)) if place is not None]
        return [tuple(int(w) for w in np.flatnonzero(place == value)) for place in places for value in np.unique(place)]

    def contrasts(self, covariate: str, wheels: Sequence[int | str]) -> Mapping[str, Array]:  # noqa: ARG002
        """Return factors, shape (wheel,), by which a covariate acts oppositely on two parts of the machine.

        Such as {"opposite sides": −1 on the left, +1 on the right} for a roll angle; by default none.
        """
        return {}

    def variants(self) -> Mapping[str, float]:
        """Return parameters outside the priors that candidates may move, with their neutral values."""
        return {}

    def stated_effects(self) -> Sequence[Contribution]:
        """Return effects of the library that `predict` has already, so that a change of them is called by its name."""
        return ()

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return the physics to look for: by default the whole library, of which what fits the covariates is used.

        Add your own with `(*library, MyCandidate())`; leave out what the machine cannot have.
        """
        return library

    def corrected_tables(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return SIM.toml's tables with the parameters at the values that the recording gave them."""
        return {
            "parameters": {
                name: {"value": float(values[name]), "std": prior.std} for name, prior in self.parameters.items()
            }
        }

    def absorb_effects(
        self, tables: Mapping[str, Any], effects: Sequence[Contribution]
    ) -> tuple[dict[str, Any], tuple[Contribution, ...]]:
        """Return SIM.toml's tables with those effects in them that this simulation has keys for, and the effects left.

        By default it has none: all are left, and are written to `[[effects]]`.
        """
        return dict(tables), tuple(effects)
