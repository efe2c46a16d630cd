"""Which other effects would explain the recording as well, and what to drive to tell them apart.

A rival leaves the set only if data made *from the rival* would favour the named effect by so much less than one time
in twenty. With normal noise that needs no simulation: were the rival true, its lead would be normal about μ with
variance 4 μ, where μ is the energy of the rival's own term outside the named one's reach.
"""

from __future__ import annotations

from math import erf, sqrt
from typing import TYPE_CHECKING

import numpy as np

from calibration.mismatch.answer import Indistinguishable
from calibration.mismatch.decide import acceptable, best_per_family, polished

if TYPE_CHECKING:
    from collections.abc import Sequence

    from calibration.mismatch.search import Fit, Search, Term

ONE_IN_TWENTY = 0.05

DRIVES = {
    "direction": "drive the same stretch forwards and backwards at one speed",
    "wheel_speed": "drive a staircase of at least four constant speeds, from creeping to full speed, both ways",
    "temperature": "start cold, warm up, stop until cold again and repeat, so that temperature does not follow time",
    "torque": "repeat at one speed with and without ballast, and up and down a slope",
    "wheel_acceleration": "start, stop and reverse sharply, twenty times",
    "wheel_angle": "drive straight at three constant speeds, sampled at four times the ripple's frequency",
    "pitch": "drive one slope up and down, forwards and backwards",
    "yaw_rate": "turn on the spot and along arcs of several radii, both ways",
    "slip": "pull a sledge of several weights on level ground, so that slip changes at constant load",
    "wheel_row": "drive one virgin lane, then twice more in the same ruts",
    "time": "drive back over the same ground, and lift the wheels and spin all six at one speed",
    "none": "stand still with the motors unpowered, then drive one stretch both ways",
}
"""For each covariate, the drive that moves it and nothing else."""


def rivals(search: Search, named: Fit) -> tuple[Indistinguishable, ...]:
    """Return, for each named effect that has them, the set of effects that explain the recording as well."""
    found = []
    for index, term in enumerate(named.terms):
        others = [t for i, t in enumerate(named.terms) if i != index]
        names = [term.name]
        covariates = [_covariate(term)]
        for _, rival in best_per_family(search, others)[:8]:
            if rival.name == term.name:
                continue
            rival_terms = polished(search, (*others, rival))
            fit = search.fit(rival_terms)
            if acceptable(search, fit) and _survives(search, named, fit, others, term):
                names.append(rival.name)
                covariates.append(_covariate(rival))
        if len(names) > 1:
            found.append(Indistinguishable(tuple(names), experiment_for(covariates)))
    return tuple(found)


def experiment_for(covariates: Sequence[str]) -> str:
    """Return the drives that move each of these covariates alone, as one sentence."""
    drives = [DRIVES[c] for c in dict.fromkeys(covariates) if c in DRIVES]
    sentence = "; then ".join(drives)
    return sentence[:1].upper() + sentence[1:] + "."


def _covariate(term: Term) -> str:
    return term.group.candidate.covariate if term.group.candidate else term.name


def _survives(search: Search, named: Fit, rival: Fit, others: Sequence[Term], term: Term) -> bool:
    """Say whether the rival, were it true, would trail by this much at least one time in twenty."""
    lead = named.gain - rival.gain
    own = rival.terms[-1]
    block, reach = search.beside((*others, term), own)
    values = rival.coefficients[rival.of_term(len(rival.terms) - 1)]
    apart = float(values @ (block - reach) @ values)
    if apart <= 1e-9:
        return lead <= 1.0
    return _tail((lead + apart) / (2 * sqrt(apart))) > ONE_IN_TWENTY


def _tail(z: float) -> float:
    return 0.5 * (1 - erf(z / float(np.sqrt(2))))
