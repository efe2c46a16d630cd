"""What a comparison returns: the answer, the arrays behind it, and what it can write and show."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from regolithd.calibration.mismatch.corrected import write_corrected

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.calibration.mismatch.answer import Answer, Evidence
    from regolithd.calibration.mismatch.inference.parameters.joint_parameters import Information
    from regolithd.calibration.mismatch.simulation.simulation import Simulation


@dataclass(frozen=True)
class Comparison:
    """The answer, the arrays behind it, and the simulation; a notebook shows it as the report.

    `information` is what the readings of the one channel know of the parameters; None: of several channels.
    """

    answer: Answer
    evidence: Evidence
    simulation: Simulation
    information: Information | None = field(default=None, repr=False)

    def to_json(self) -> dict[str, Any]:
        """Return what `regolithd mismatch --json` writes."""
        return self.answer.to_json()

    def write_corrected(self, path: Path, *, empirical: bool = False) -> None:
        """Write the corrected SIM.toml, as `regolithd mismatch --corrected` does.

        With `empirical` it has curves of what stays unexplained too, as with `--empirical`.

        Raises
        ------
        SimulationError
            When the simulation does not come from a SIM.toml, or a curve cannot be carried to another recording.
        """
        write_corrected(path, self.answer, self.evidence, self.simulation, empirical=empirical)

    def _repr_html_(self) -> str:
        # A notebook alone shows the report; the command line starts sooner without it.
        from regolithd.calibration.mismatch.report.notebook import notebook_html  # noqa: PLC0415

        return notebook_html(self.answer, self.evidence)
