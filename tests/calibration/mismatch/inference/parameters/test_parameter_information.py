"""What readings know of a parameter beside an effect whose law has a free exponent."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import stirrer
from stirrer import Stirrer, stirred

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.comparison import decided
from regolithd.calibration.mismatch.inference.parameters.joint_parameters import information_of, joint_posterior
from regolithd.calibration.mismatch.inference.parameters.parameter_information import drawn_for, parameter_covariance

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.answer import CalibratedParameter


def _load(seed: int) -> CalibratedParameter:
    answer = compare(stirred(seed), Stirrer()).answer
    assert [effect.name for effect in answer.effects] == ["viscous-friction"]
    return answer.parameters[0]


def test_its_interval_holds_the_truth_beside_a_law_with_a_free_exponent() -> None:
    """With the exponent held where it was fitted, two of these eight did."""
    found = [_load(seed) for seed in range(8)]
    assert sum(each.low < stirrer.LOAD < each.high for each in found) >= 7
    scatter = np.std([each.value for each in found])
    widths = np.array([each.high - each.low for each in found]) / 3.29
    assert scatter < np.median(widths) < 3 * scatter, "as wide as the values scatter, and as a law that is not exact"


def test_one_channel_by_its_information_is_as_its_fit_has_it() -> None:
    """Value and standard deviation; the prior counts once."""
    decision = decided(stirred(0), Stirrer(), effects=()).decision
    drawn = drawn_for(decision)
    posterior = joint_posterior(Stirrer.parameters, [information_of(decision, drawn)])
    place = decision.equations.nuisance.names.index("load_Nms2")
    scale = decision.equations.design.scale[decision.equations.nuisance.columns[place]]
    prior = Stirrer.parameters["load_Nms2"]
    std = np.sqrt(parameter_covariance(decision, drawn)[place, place]) / scale
    assert posterior.stds[0] * prior.std == pytest.approx(std, rel=1e-6)
    (told,) = compare(stirred(0), Stirrer()).answer.parameters
    assert posterior.values(Stirrer.parameters)["load_Nms2"] == pytest.approx(told.value, rel=1e-9)
    held = parameter_covariance(decision, None)[place, place]
    assert std > 3 * np.sqrt(held) / scale, "with the exponent held it would be much less"
