"""How sure an answer is: its alternatives, and the probability that their margins leave to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_machine import CANDIDATES, equations_of, problem_of, table

from regolithd.calibration.mismatch.inference.other_answers import probability as module
from regolithd.calibration.mismatch.inference.other_answers.alternatives import (
    Alternative,
    alternatives,
    with_other_statements,
    with_refused,
)
from regolithd.calibration.mismatch.inference.other_answers.probability import (
    decided_by_evidence,
    is_known,
    leads_of,
    other_answers,
    probability,
)
from regolithd.calibration.mismatch.regression.groups.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.selection.best_subsets import best_of_each_candidate, best_of_each_smooth_term
from regolithd.calibration.mismatch.selection.decision import Decision, Intermittent, decide
from regolithd.calibration.mismatch.selection.plausibility.released_parameters import OtherStatement
from regolithd.calibration.mismatch.thresholds import THRESHOLDS

HIGHEST, SCALE = THRESHOLDS.highest_probability, THRESHOLDS.evidence_scale


def decided(**effects: float) -> Decision:
    """Return what is decided of a recording with these effects."""
    equations = equations_of(problem_of(table(**effects)))  # type: ignore[arg-type]
    return decide(equations.over(with_smooth_terms(equations.design)), CANDIDATES)


def test_without_alternatives_only_the_unknown_may_be_wrong() -> None:
    """The highest probability, and no other answer."""
    assert probability((), THRESHOLDS) == HIGHEST
    assert other_answers((), THRESHOLDS) == ()


def test_an_equal_alternative_halves_the_probability() -> None:
    """And has the other half; one that is ahead has more."""
    assert probability([Alternative(("drag",), 0.0)], THRESHOLDS) == pytest.approx(HIGHEST / 2)
    (other,) = other_answers([Alternative(("drag", "unexplained"), 0.0)], THRESHOLDS)
    assert (other.effects, other.unexplained) == (("drag",), True)
    assert other.probability == pytest.approx(HIGHEST / 2)
    assert probability([Alternative((), -2 * SCALE)], THRESHOLDS) == pytest.approx(HIGHEST / (1 + np.e**2))


def test_probabilities_of_all_answers_add_up() -> None:
    """To what is left beside the unknown; three others are told at most."""
    margins = [Alternative((str(k),), 3.0 * k) for k in range(3)]
    told = other_answers(margins, THRESHOLDS)
    assert probability(margins, THRESHOLDS) + sum(other.probability for other in told) == pytest.approx(HIGHEST)
    assert len(other_answers([*margins, Alternative(("4",), 9.0)], THRESHOLDS)) == 3


def test_the_evidence_decides_where_every_curve_pays_for_itself() -> None:
    """Names and nothing do; a curve over time beside noise does not."""
    decision = decided(drag=0.3)
    assert decided_by_evidence(decision)
    _, curve = best_of_each_smooth_term(decision.equations, decision.named.terms)[0]
    whole = decision.equations.fit((*decision.named.terms, curve))
    assert not decided_by_evidence(replace(decision, unnamed=(curve,), whole=whole))


def test_a_strong_drag_is_surer_than_a_weak_one() -> None:
    """The margin to nothing shrinks with the effect, and with it the probability."""
    strong, weak = (decided(drag=drag) for drag in (0.3, 0.035))
    assert {term.name for term in strong.named.terms} == {"drag"}
    sure, unsure = (probability(alternatives(each), THRESHOLDS) for each in (strong, weak))
    assert sure > 0.9
    assert sure > unsure


def test_the_evidence_of_a_curve_says_nothing_of_what_comes_and_goes_where_another_answer_has_more() -> None:
    """Its two levels tell it, which no curve over time describes."""
    found = decided(drag=0.3)
    spells = Intermittent(found.whole.terms[0], 0.0, 1.0, 0.5)
    ahead, behind = Alternative(("power",), -3.0), Alternative(("power",), 3.0)
    assert is_known(found, (ahead,))
    assert is_known(replace(found, intermittent=(spells,)), (behind,))
    assert not is_known(replace(found, intermittent=(spells,)), (ahead, behind))


def test_the_alternatives_are_one_name_away() -> None:
    """Nothing, another name, or one more; never the answer itself, and the best first."""
    found = alternatives(decided(drag=0.035))
    assert () in {each.effects for each in found}
    assert () not in {each.effects for each in alternatives(decided(drag=0.9))}
    assert ("drag",) not in {each.effects for each in found}
    assert all(len(each.effects) <= 2 for each in found)
    margins = [each.margin for each in found]
    assert margins == sorted(margins)
    assert min(margins) > 0


def test_a_wrong_statement_in_the_place_of_a_name_is_another_answer() -> None:
    """It is told with the parameter, unless the name is none of the answer's any more."""
    decision = decided(drag=0.3)
    terms = decision.whole.terms
    other = OtherStatement(terms, (), ("level",), 1.0)
    same = OtherStatement(terms, terms, ("level",), 0.0)
    found = with_other_statements(replace(decision, other_statements=(other, same)), ())
    assert found == (Alternative((), 1.0, parameters=("level",)),)
    (told,) = other_answers(found, THRESHOLDS)
    assert told.parameters == ("level",)
    changed = replace(decision, other_statements=(replace(other, instead_of=()),))
    assert with_other_statements(changed, ()) == ()
    nearer = Alternative((), 0.5)
    assert with_other_statements(replace(decision, other_statements=(other,)), (nearer,)) == (nearer,)


def test_a_curve_in_the_place_of_a_law_that_is_a_little_wrong_is_no_alternative() -> None:
    """Where the noise is small it follows what the law misses, and has more evidence for that."""
    columns = table(drag=0.5, factor=0.4, power=1.5, noise=0.02)
    missed = 0.02 * np.sin(5 * np.abs(columns["speed_rad_s"]))
    equations = equations_of(problem_of({**columns, "reading_V": columns["reading_V"] + missed}))
    decision = decide(equations.over(with_smooth_terms(equations.design)), CANDIDATES)
    assert {term.name for term in decision.whole.terms} == {"drag", "power"}
    assert alternatives(decision) == ()
    exact = replace(equations.thresholds, form_misfit=0.0)
    problem = replace(decision.equations.problem, thresholds=exact)
    strict = replace(decision, equations=decision.equations.over(replace(decision.equations.design, problem=problem)))
    (other,) = alternatives(strict)
    assert other.effects == ("drag", "unexplained")
    assert other.margin < 0


def test_what_held_out_readings_refused_is_no_alternative() -> None:
    """However much evidence it has: it could not have been the answer."""
    decision = decided(drag=0.035)
    refused = alternatives(decision)[0].effects
    left = alternatives(replace(decision, refused=frozenset({frozenset(refused)})))
    assert refused not in {each.effects for each in left}
    assert len(left) >= 1


def test_an_answer_is_no_more_probable_than_one_that_held_out_readings_refused() -> None:
    """Where it has more evidence than the answer; with less, it counts as any other does."""
    found = decided(drag=0.06)
    empty = found.equations.fit(())
    refused = frozenset(map(frozenset, ({"drag"}, {"unexplained"})))
    nothing = replace(found, named=empty, unnamed=(), whole=empty, refused=refused)
    (ahead,) = (each for each in alternatives(nothing, refused=True) if each.effects == ("drag",))
    assert ahead.margin < 0
    assert ("drag",) not in {each.effects for each in alternatives(nothing)}
    assert {each.effects: each.margin for each in with_refused(nothing)}["drag",] == 0
    assert probability(with_refused(nothing), THRESHOLDS) <= 0.5 * HIGHEST
    weaker = replace(found, refused=frozenset({frozenset(alternatives(found)[0].effects)}))
    assert with_refused(weaker)[0].margin == alternatives(found)[0].margin


def test_an_effect_that_just_misses_its_entry_is_another_answer() -> None:
    """It is behind by what it lacks, so that nothing is told with less certainty than where nothing comes near."""
    for size in (0.1, 0.09, 0.08, 0.07, 0.06):
        decision = decided(drag=size, noise=0.8)
        if not decision.whole.terms:
            break
    assert decision.whole.terms == ()
    (drag,) = (other for other in alternatives(decision) if other.effects == ("drag",))
    assert 0 < drag.margin < decision.entry_threshold
    assert probability(alternatives(decision), THRESHOLDS) < HIGHEST - 0.01


def test_one_other_name_is_an_answer_beside_two() -> None:
    """What two names imitate has a name of its own, although no name is shared."""
    right = decided(factor=0.05)
    assert [term.name for term in right.whole.terms] == ["power"]
    best = {term.name: term for _, term in best_of_each_candidate(right.equations, ())}
    two = right.equations.fit((best["offset"], best["step"]))
    others = alternatives(replace(right, named=two, whole=two))
    assert ("power",) in {other.effects for other in others}


def test_the_lead_of_a_term_is_over_the_answer_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over the best of those that have nothing else; other names, and more of them, are no answer without it."""
    decision = decided(drag=0.3)
    (name,) = (term.name for term in decision.whole.terms)
    others = (Alternative(("other",), 1.0), Alternative((name, "other"), 2.0), Alternative((), 5.0))
    monkeypatch.setattr(module, "with_refused", lambda _: others)
    assert leads_of(decision) == [5.0]
    monkeypatch.setattr(module, "with_refused", lambda _: others[:2])
    assert leads_of(decision) == [np.inf]
    monkeypatch.setattr(module, "is_known", lambda *_: False)
    monkeypatch.setattr(module, "with_refused", lambda _: others)
    assert leads_of(decision) == [np.inf]


def test_nothing_has_no_leads() -> None:
    """No answer is asked for."""
    assert leads_of(decided()) == []
