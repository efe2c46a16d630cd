"""The reproduction page shows what was computed, and the synthetic traverse has the published scatter."""

import numpy as np
import pytest

from regolithd.calibration.paper.backpropagation import Training, train
from regolithd.calibration.paper.training_set import TrainingSet, training_set
from regolithd.calibration.parameters import Drivetrain, Wheel
from regolithd.calibration.validation.reproduction import page, published, recomputation
from regolithd.calibration.validation.reproduction.scalings import scalings


@pytest.fixture(scope="module")
def trained() -> tuple[TrainingSet, list[Training]]:
    """Return the pairs and two briefly trained perceptrons."""
    pairs = training_set(Drivetrain(), Wheel())
    return pairs, [train(pairs, 64, np.random.default_rng(seed), epochs=2000) for seed in range(2)]


def test_record_500_comes_out_near_the_papers(trained: tuple[TrainingSet, list[Training]]) -> None:
    """With guessed constants, c is within a quarter of 3352 Pa and φ within 4° of 28.6°."""
    found = recomputation.record_500(trained[1])
    assert found.cohesion_Pa == pytest.approx(3352, rel=0.25)
    assert found.angle_deg == pytest.approx(28.6, abs=4)


def test_the_synthetic_traverse_scatters_as_published(trained: tuple[TrainingSet, list[Training]]) -> None:
    """Currents and loads have the relative standard deviations of Tables 4 and 6, wheel by wheel."""
    for ground in published.CURRENT_RSD:
        drive = recomputation.traverse(trained[1][0].perceptron, ground, np.random.default_rng(0))
        assert drive.load_N.shape == (909, 6)
        np.testing.assert_allclose(
            recomputation.relative_std(drive.current_A), published.CURRENT_RSD[ground], rtol=0.12
        )
        np.testing.assert_allclose(recomputation.relative_std(drive.load_N), published.LOAD_RSD[ground], rtol=0.12)


def test_drops_of_current_pull_the_friction_angle_down(trained: tuple[TrainingSet, list[Training]]) -> None:
    """At a quarter of its current, record 500 is estimated with a smaller friction angle, as the paper observed."""
    usual, dropped = recomputation.current_sweep(trained[1][0].perceptron, np.array([0.080, 0.020]))
    assert dropped[1] < usual[1] - 2


def test_most_pairs_are_beyond_the_rover(trained: tuple[TrainingSet, list[Training]]) -> None:
    """Fewer than half of the pairs have a load that a wheel of 30 kg can carry."""
    shares = [each.possible_share for each in recomputation.load_ranges(trained[0])]
    assert 0 < np.mean(shares) < 0.5


def test_the_page_shows_the_computed_values(trained: tuple[TrainingSet, list[Training]]) -> None:
    """The page holds the recomputed values beside the published ones, and the rows of each table have equal cells."""
    pairs, done = trained
    results = page.Results(
        trainings=2,
        loads=recomputation.load_ranges(pairs),
        scalings=scalings(pairs, done[0].perceptron(pairs.inputs)),
        record=recomputation.record_500(done),
        unpublished={("radius_m", 0.06): recomputation.record_500(done)},
        traverses=[recomputation.traverse(done[0].perceptron, "prepared", np.random.default_rng(0))] * 2,
        noise_free=(3000.0, 30.0),
        sizing=None,
    )
    text = page.page(results)
    assert f"| c (Pa) | 3352 | {results.record.cohesion_Pa:.0f} ± " in text
    assert "make sizing" in text
    tables = [block for block in text.split("\n\n") if block.startswith("|")]
    assert len(tables) >= 6
    for table in tables:
        assert len({line.count("|") for line in table.splitlines()}) == 1
    assert page.figures(results)["record_500_cohesion_Pa"] == results.record.cohesion_Pa
