"""A simulation whose every answer is checked, so that a mistake in a user's class is one message, not a traceback.

What the class raises is told with method, file and line; a column that it reads and nobody recorded with the column
that was perhaps meant; a result of the wrong shape or type with the shape that is needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.data.recording import Recording
from regolithd.calibration.mismatch.errors import RecordingError, SimulationError, did_you_mean
from regolithd.calibration.mismatch.simulation.checked_candidate import checked_candidate
from regolithd.calibration.mismatch.simulation.simulation import Array, Simulation
from regolithd.calibration.mismatch.simulation.stated_priors import GREATEST_NUMBER
from regolithd.calibration.mismatch.simulation.stated_sensors import unrecorded
from regolithd.calibration.mismatch.simulation.statement import check_statement
from regolithd.calibration.mismatch.simulation.user_code import Columns, Parameters, array_of, called

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate


class CheckedSimulation(Simulation):
    """A simulation around another: the same attributes, and methods whose errors and results are checked."""

    def __init__(self, inner: Simulation) -> None:
        check_statement(inner)
        self.inner = inner
        for name in Simulation.__annotations__:
            if hasattr(inner, name):  # no `channel` where there are `channels`
                setattr(self, name, getattr(inner, name))

    @property  # type: ignore[misc]
    def __class__(self) -> type:
        """The inner object's class, so that `isinstance` tells what this is a view of."""
        return type(self.inner)

    def __reduce__(self) -> tuple[type[CheckedSimulation], tuple[Simulation]]:
        return CheckedSimulation, (self.inner,)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  # whatever the class has of its own, for its candidates
        if name == "inner" or name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.inner, name)

    def prepare(self, recording: Recording) -> Recording:
        """Return the recording with the derived channels; tell why a needed one is missing."""
        columns = Columns(recording.channels, recording.unread)
        prepared = called(self.inner, "prepare", replace(recording, channels=columns))
        if not isinstance(prepared, Recording):
            raise SimulationError(
                f"{self._method('prepare')} returned a {type(prepared).__name__}, not a Recording, as "
                "recording.with_channels(…) is one"
            )
        if prepared.shape != recording.shape:
            raise SimulationError(
                f"{self._method('prepare')} must keep all instants and wheels {recording.shape}, not {prepared.shape}; "
                "set to NaN what is not to be compared"
            )
        channels = {
            name: array_of(values, recording.shape, f"{self._method('prepare')}: column {name}")
            for name, values in prepared.channels.items()
        }
        self._check_needed(channels, columns)
        notes = unrecorded(self.inner, type(self.inner).sensors, channels)
        return replace(prepared, channels=channels).with_notes(*notes)

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the predicted channel, shape (time, wheel)."""
        found, shape, method = self._predicted(inputs, values), inputs["t_s"].shape, self._method("predict")
        if not self.channels:
            return _where_it_converges(array_of(found, shape, method))
        table = self._table("predict", found)
        if lacking := [channel for channel in self.channels if channel not in table]:
            raise SimulationError(f"{method} must return {lacking[0]} too, as `channels` states")
        # As `channels` says, a mapping: the engine compares one channel after the other.
        return {  # type: ignore[return-value]
            name: _where_it_converges(array_of(table[name], shape, f"{method}: {name}")) for name in self.channels
        }

    def _predicted(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> object:
        try:
            return called(self.inner, "predict", Columns(inputs), Parameters(values))
        except SimulationError as error:
            priors = self.inner.parameters
            moved = [f"{name} = {at:.6g}" for name, at in values.items() if name in priors and at != priors[name].value]
            if not moved:
                raise
            raise SimulationError(
                f"{error}; this was with {', '.join(moved)}, where the recording leads: return NaN where the "
                "simulation has no value, or state a narrower prior"
            ) from error

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what a residual may be ordered by, each of shape (time, wheel)."""
        found = self._table("covariates", called(self.inner, "covariates", Columns(inputs)))
        shape, method = inputs["t_s"].shape, self._method("covariates")
        return {name: array_of(values, shape, f"{method}: {name}") for name, values in found.items()}

    def side(self, wheels: Sequence[int | str]) -> Array | None:
        """Return −1 for wheels on the left, +1 on the right."""
        return self._for_each_wheel("side", wheels)

    def row(self, wheels: Sequence[int | str]) -> Array | None:
        """Return each wheel's place along the machine, front 0."""
        return self._for_each_wheel("row", wheels)

    def wheel_sets(self, wheels: Sequence[int | str]) -> Sequence[tuple[int, ...]]:
        """Return sets of wheels, by their indices, that may share an effect."""
        found = called(self.inner, "wheel_sets", wheels)
        try:
            sets = [tuple(int(wheel) for wheel in each) for each in found]
        except (TypeError, ValueError) as error:
            raise SimulationError(f"{self._method('wheel_sets')} must return sequences of indices: {error}") from error
        if any(not 0 <= wheel < len(wheels) for each in sets for wheel in each):
            raise SimulationError(f"{self._method('wheel_sets')} must return indices below {len(wheels)}, not {sets}")
        return sets

    def contrasts(self, covariate: str, wheels: Sequence[int | str]) -> Mapping[str, Array]:
        """Return factors, shape (wheel,), by which a covariate acts oppositely on two parts of the machine."""
        found = self._table("contrasts", called(self.inner, "contrasts", covariate, wheels))
        method = self._method("contrasts")
        return {name: array_of(values, (len(wheels),), f"{method}: {name}") for name, values in found.items()}

    def variants(self) -> Mapping[str, float]:
        """Return parameters outside the priors that candidates may move, with their neutral values."""
        found = self._table("variants", called(self.inner, "variants"))
        method = self._method("variants")
        return {name: float(array_of(value, (), f"{method}: {name}")) for name, value in found.items()}

    def stated_effects(self) -> Sequence[Contribution]:
        """Return effects of the library that the prediction has already."""
        found = called(self.inner, "stated_effects")
        if not isinstance(found, list | tuple) or not all(isinstance(each, Contribution) for each in found):
            raise SimulationError(f"{self._method('stated_effects')} must return a sequence of Contribution")
        return found

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return the physics to look for; the user's own candidates are checked like the simulation."""
        found = called(self.inner, "candidates", library)
        try:
            of = tuple(checked_candidate(candidate, self._method("candidates")) for candidate in found)
        except TypeError as error:
            raise SimulationError(f"{self._method('candidates')} must return a sequence of candidates") from error
        known = sorted({each.name for each in (*library, *of)})
        for name in self.without_effects:
            if name not in known:
                told = f"without_effects: there is no effect {name}; {did_you_mean(name, known)}"
                raise SimulationError(told, ("simulation", "without_effects"))
        return tuple(each for each in of if each.name not in self.without_effects)

    def corrected_tables(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return SIM.toml's tables with the parameters at the values that the recording gave them."""
        found = called(self.inner, "corrected_tables", Parameters(values))
        return dict(self._table("corrected_tables", found))

    def absorb_effects(
        self, tables: Mapping[str, Any], effects: Sequence[Contribution]
    ) -> tuple[dict[str, Any], tuple[Contribution, ...]]:
        """Return SIM.toml's tables with the effects in them that the simulation has keys for, and the effects left."""
        found = called(self.inner, "absorb_effects", tables, effects)
        if not (isinstance(found, tuple) and len(found) == 2):
            raise SimulationError(f"{self._method('absorb_effects')} must return (tables, effects left)")
        return dict(self._table("absorb_effects", found[0])), tuple(found[1])

    def _method(self, name: str) -> str:
        return f"{type(self.inner).__name__}.{name}"

    def _table(self, method: str, found: object) -> Mapping[str, Any]:
        if not isinstance(found, Mapping) or not all(isinstance(name, str) for name in found):
            raise SimulationError(
                f"{self._method(method)} must return a dict with names as keys, not {type(found).__name__}"
            )
        return found

    def _for_each_wheel(self, method: str, wheels: Sequence[int | str]) -> Array | None:
        found = called(self.inner, method, wheels)
        return None if found is None else array_of(found, (len(wheels),), self._method(method))

    def _check_needed(self, channels: Mapping[str, Array], read: Columns) -> None:
        """Check that the predicted channel and the inputs are there, and tell the cause where one is not.

        Of several predicted channels some may hold no reading: the others are compared.
        """
        predicted = tuple(self.channels) or (self.channel,)
        read_channels = [name for name in predicted if name not in channels or np.isfinite(channels[name]).any()]
        predicted = tuple(read_channels) or predicted
        for name in (*predicted, *self.inputs):
            if name not in channels:
                raise read.missing(name, "the simulation needs")
            if np.isfinite(channels[name]).any():
                continue
            if name in read and not np.isfinite(dict.__getitem__(read, name)).any():
                raise RecordingError(f"the simulation needs column {name}, which holds no reading")
            raise RecordingError(f"{self._method('prepare')} gives no finite value of {name}{read.why_blank()}")
        for name in predicted:
            if not np.any(np.nan_to_num(channels[name], posinf=0.0, neginf=0.0)):
                raise RecordingError(
                    f"the predicted column {name} is 0 wherever it was measured: check that its sensor works and that "
                    "the column is the right one"
                )


def _where_it_converges(prediction: Array) -> Array:
    """Return a prediction with NaN where it is so large that no reading is, and its square no number."""
    return np.where(np.abs(prediction) < GREATEST_NUMBER, prediction, np.nan)


def checked(simulation: Simulation) -> Simulation:
    """Return the simulation with checks around it, once.

    Raises
    ------
    SimulationError
        When the class does not state what a simulation must.
    """
    return simulation if isinstance(simulation, CheckedSimulation) else CheckedSimulation(simulation)
