"""What the engine needs of a simulation: its channel, priors and sensor errors, and a prediction from inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.data.recording import Recording
    from regolithd.calibration.mismatch.data.slow_channels import Between
    from regolithd.calibration.mismatch.problem.prior import Prior, SensorError

Array = NDArray[np.float64]


class Predictor(Protocol):
    """A simulation as a problem sees it; `simulation.Simulation` is the class to derive from, and documents each."""

    @property
    def channel(self) -> str:
        """The recorded column that is predicted."""

    @property
    def unit(self) -> str:
        """The predicted channel's unit."""

    @property
    def wheel_column(self) -> str:
        """The column that tells wheels (axes, sides, bodies) apart."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Columns without which nothing can be predicted."""

    @property
    def parameters(self) -> Mapping[str, Prior]:
        """Every parameter's prior, by name."""

    @property
    def own_to_each_wheel(self) -> frozenset[str]:
        """Parameters of which each wheel has a deviation of its own."""

    @property
    def parameter_effects(self) -> Mapping[str, str]:
        """Names of parameters as effects."""

    @property
    def unlikely_effects(self) -> frozenset[str]:
        """Names of candidates that this machine hardly has."""

    @property
    def motor_constant_at_degC(self) -> float | None:
        """The temperature [°C] at which the torque constant is as stated; None: not said."""

    @property
    def sensors(self) -> Mapping[str, SensorError]:
        """The errors of the recorded inputs, by column."""

    @property
    def between_readings(self) -> Mapping[str, Between]:
        """What to do between the readings of a channel that is sampled less often than the rows."""

    @property
    def zero_means_nothing(self) -> bool | None:
        """Whether nothing is in proportion to the predicted channel; None: not said."""

    @property
    def undefined_at_times(self) -> frozenset[str]:
        """Covariates whose NaN means that they do not apply, not that they were not measured."""

    @property
    def covariate_labels(self) -> Mapping[str, str]:
        """Labels of covariates with their units."""

    @property
    def unloaded_experiment(self) -> str:
        """How to run the machine without its load, as an instruction; empty where that cannot be done."""

    @property
    def one_way(self) -> bool | None:
        """Whether the machine runs one way only; None: not said."""

    @property
    def experiment_spans(self) -> Mapping[str, float]:
        """How far from its usual value, each way, an experiment can move a covariate."""

    def prepare(self, recording: Recording) -> Recording:
        """Return the recording with the channels that the prediction needs."""

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the predicted channel, shape (time, wheel)."""

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what a residual may be ordered by, each of shape (time, wheel)."""

    def side(self, wheels: Sequence[int | str]) -> Array | None:
        """Return −1 for wheels on the left, +1 on the right."""

    def row(self, wheels: Sequence[int | str]) -> Array | None:
        """Return each wheel's place along the machine, front 0."""

    def wheel_sets(self, wheels: Sequence[int | str]) -> Sequence[tuple[int, ...]]:
        """Return sets of wheels, by their indices, that may share an effect beside all and each."""

    def contrasts(self, covariate: str, wheels: Sequence[int | str]) -> Mapping[str, Array]:
        """Return factors by which a covariate acts oppositely on two parts of the machine, by name."""

    def variants(self) -> Mapping[str, float]:
        """Return parameters outside the priors that candidates may move, with their neutral values."""


def complete_inputs(recording: Recording) -> dict[str, Array]:
    """Return every channel, `t_s` and the number of the `run`, all of shape (time, wheel)."""
    time_s = np.broadcast_to(recording.time_s[:, None], recording.shape)
    run = np.broadcast_to(recording.run[:, None].astype(np.float64), recording.shape)
    return {**recording.channels, "t_s": time_s, "run": run}
