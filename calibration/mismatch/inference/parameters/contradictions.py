"""Channels that contradict each other about the parameters that they share.

Each of two channels may be right by itself, with parameters within their stated priors, though no values are right for
both: the sensor of one reads a tenth too little, and a gain of the simulation takes that up there. Then one of them has
physics, or a sensor's error, that the simulation lacks, and the others know where the parameters are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import OtherAnswer
from regolithd.calibration.mismatch.inference.other_answers.probability import TOLD, relative
from regolithd.calibration.mismatch.inference.parameters.joint_parameters import Likelihood, joint_posterior
from regolithd.calibration.mismatch.inference.several_channels import told_names
from regolithd.calibration.mismatch.signal.chi_squared import quantile
from regolithd.calibration.mismatch.simulation.known_together import KnownTogether
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.answer import Answer
    from regolithd.calibration.mismatch.inference.parameters.joint_parameters import Information, JointPosterior
    from regolithd.calibration.mismatch.problem.prior import Prior

BY_CHANCE = 1e-4
"""Probability that channels contradict each other so much if nothing is left out in any (a choice: in 145 of 149 cases
of strangers the Δχ² was below 12, where 26 to 32 are asked; in the four others something was left out)."""
LEAST_STD = 1e-6
"""Standard deviation of each parameter beside the others, in that of its prior, at least (double precision)."""


@dataclass(frozen=True, eq=False)
class Apart:
    """One channel, taken to have parameters that need not be those of the others.

    Attributes
    ----------
    channel: its name
    gain: Δχ² over the same parameters for all channels, those of the channel with priors of their own
    evidence: of that, in Δχ², but for a constant
    others: what the other channels know of the parameters
    """

    channel: str
    gain: float
    evidence: float
    others: JointPosterior

    def told_by(self, again: Information, before: Information) -> Apart:
        """Return the same with the evidence of what the channel shows beside the others' parameters."""
        if again.quality is None or before.quality is None:
            return self
        return replace(self, evidence=self.evidence + again.quality.evidence_over(before.quality))

    def known(self, priors: Mapping[str, Prior]) -> KnownTogether:
        """Return that as priors, the best known parameter first: it is itself, and others are told beside it."""
        order = np.argsort(self.others.stds, kind="stable")
        names = tuple(self.others.names[place] for place in order)
        stds, values = np.array([priors[name].std for name in names]), self.others.values(priors)
        covariance = self.others.covariance[np.ix_(order, order)] + LEAST_STD**2 * np.eye(len(order))
        return KnownTogether.of(names, np.array([values[name] for name in names]), covariance * np.outer(stds, stds))


def contradictions(priors: Mapping[str, Prior], informations: Mapping[str, Information]) -> list[Apart]:
    """Return the channels that may be the one which contradicts the others, the most probable first.

    All channels together have the parameters where their readings and the priors have them, or where priors were stated
    wrongly. With parameters of its own, each with its priors, a channel takes at most as many χ²-distributed terms from
    that as there are parameters, if nothing is left out. A channel is not the one if the others contradict each other.

    Parameters
    ----------
    informations: of the channels that leave nothing unexplained, by their names
    """
    together, found = joint_posterior(priors, list(informations.values())), []
    needed = quantile(len(together.names), BY_CHANCE) if together.names else np.inf
    for channel, own in informations.items():
        others = joint_posterior(priors, [each for name, each in informations.items() if name != channel])
        alone = joint_posterior(priors, [own])
        gain = others.evidence + alone.evidence - together.evidence
        if gain > needed:
            free = Likelihood.of(priors, [own]).evidence_without_priors()
            found.append(Apart(channel, gain, others.evidence + free, others))
    found.sort(key=lambda each: -each.evidence)
    return [each for each in found if each.evidence > found[0].evidence - needed]


def is_told(again: Answer, before: Answer) -> bool:
    """Return whether a channel shows something that is left out, with parameters as the others have them."""
    return bool(again.unexplained) or bool(set(told_names(again)) - set(told_names(before)))


def known_apart(information: Information, together: KnownTogether) -> Information:
    """Return what a channel's readings know of the parameters in whose place others stood."""
    matrix, vector = together.information(information.names, information.matrix, information.vector)
    return replace(information, matrix=matrix, vector=vector)


def told_apart(apart: Sequence[tuple[Apart, Answer]], channels: Sequence[str]) -> Answer:
    """Return the answer of the first of these channels, as probable as it is that this one is wrong.

    Parameters
    ----------
    apart: channels of which each may be the one that contradicts the others, the most probable first, and the answers
        with parameters as the others have them
    channels: all
    """
    (first, answer), *rest = apart
    shares = relative([first.evidence - each.evidence for each, _ in apart], THRESHOLDS)
    shares /= shares.sum()
    others = tuple(
        OtherAnswer(told_names(other), bool(other.unexplained), float(share) * (other.probability or 0.0))
        for (_, other), share in zip(rest, shares[1:], strict=True)
    )
    of = ", ".join(name for name in channels if name != first.channel)
    told = (
        f"{first.channel} contradicts {of} about the parameters that they share (Δχ² {first.gain:.0f}): what is told "
        f"of {first.channel} is beside the parameters as {of} {'has' if len(channels) == 2 else 'have'} them."
    )
    known = answer.probability
    return replace(
        answer,
        probability=None if known is None else known * float(shares[0]),
        alternatives=tuple(sorted((*answer.alternatives, *others), key=lambda other: -other.probability)[:TOLD]),
        notes=(*answer.notes, told),
    )
