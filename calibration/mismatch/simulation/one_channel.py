"""One channel of a simulation that predicts several: what the engine compares, one channel after the other."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.simulation.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.candidates.candidate import Candidate
    from regolithd.calibration.mismatch.contribution import Contribution
    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.simulation.known_together import Known, KnownTogether

Array = NDArray[np.float64]


class OneChannel(Simulation):
    """A view of a simulation that predicts one of its channels; all else is the simulation's own.

    `known` has the mean and the standard deviation of parameters that are known better than was stated; `together`,
    such as are known in combinations, in whose place others stand.
    """

    def __init__(
        self,
        simulation: Simulation,
        channel: str,
        known: Known | None = None,
        together: KnownTogether | None = None,
    ) -> None:
        self._whole, self._together = simulation, together
        self.channel, self.unit = channel, simulation.channels[channel]  # type: ignore[misc]
        for name in (
            "wheel_column",
            "inputs",
            "parameters",
            "own_to_each_wheel",
            "parameter_effects",
            "unlikely_effects",
            "covariate_labels",
            "unloaded_experiment",
            "one_way",
            "motor_constant_at_degC",
            "experiment_spans",
            "between_readings",
            "undefined_at_times",
            "zero_means_nothing",
            "sensors",
        ):
            setattr(self, name, getattr(simulation, name))
        for name, (value, std) in (known or {}).items():
            self.parameters = {**self.parameters, name: replace(self.parameters[name], value=value, std=std)}
        if together:
            self.parameters = together.priors(self.parameters)
        self.empirical_curves = [each for each in simulation.empirical_curves if each.channel == channel]

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return this channel of the prediction.

        Raises
        ------
        SimulationError
            When the simulation returns no such channel.
        """
        of_all = self._together.values(values) if self._together else values
        predicted: Any = self._whole.predict(inputs, of_all)
        try:
            return np.asarray(predicted[self.channel], np.float64)
        except (KeyError, TypeError, IndexError) as error:
            raise SimulationError(
                f"predict of {type(self._whole).__name__} must return a mapping with {self.channel}, as `channels` says"
            ) from error

    def prepare(self, recording: Recording) -> Recording:
        """Derive what the simulation derives."""
        return self._whole.prepare(recording)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the simulation's covariates."""
        return self._whole.covariates(inputs)

    def side(self, wheels: Sequence[int | str]) -> Array | None:
        """Return the simulation's sides."""
        return self._whole.side(wheels)

    def row(self, wheels: Sequence[int | str]) -> Array | None:
        """Return the simulation's rows."""
        return self._whole.row(wheels)

    def wheel_sets(self, wheels: Sequence[int | str]) -> Sequence[tuple[int, ...]]:
        """Return the simulation's sets."""
        return self._whole.wheel_sets(wheels)

    def contrasts(self, covariate: str, wheels: Sequence[int | str]) -> Mapping[str, Array]:
        """Return the simulation's contrasts."""
        return self._whole.contrasts(covariate, wheels)

    def variants(self) -> Mapping[str, float]:
        """Return the simulation's variants."""
        return self._whole.variants()

    def stated_effects(self) -> Sequence[Contribution]:
        """Return the simulation's stated effects."""
        return self._whole.stated_effects()

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return the simulation's candidates."""
        return self._whole.candidates(library)
