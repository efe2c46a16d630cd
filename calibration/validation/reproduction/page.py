"""`docs/results/reproduction.md`: each of the paper's results that can be recomputed, beside our recomputation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.paper.sizing import PAPER_MSE, PAPER_SIZE
from regolithd.calibration.validation.reproduction import published, recomputation
from regolithd.calibration.validation.reproduction.recomputation import relative_std

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.validation.reproduction.scalings import Scaling


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """Everything that the page shows.

    `unpublished` holds the estimate of record 500 for each unpublished constant and value; `noise_free` is the estimate
    [Pa, °] at the mean load and current; `sizing` holds the figures of `regolithd sizing`, if it was run.
    """

    trainings: int
    loads: Sequence[recomputation.LoadRange]
    scalings: Sequence[Scaling]
    record: recomputation.RecordEstimate
    unpublished: Mapping[tuple[str, float], recomputation.RecordEstimate]
    traverses: Sequence[recomputation.SyntheticTraverse]
    noise_free: tuple[float, float]
    sizing: Mapping[str, float] | None


def page(results: Results) -> str:
    """Return the page as Markdown."""
    return (
        "\n\n".join(
            [
                _HEAD,
                _pairs(results),
                _sizes(results),
                _mse(results),
                _record(results),
                _tables(results),
                _bias(results),
                _NOT,
            ]
        )
        + "\n"
    )


_HEAD = """\
# Reproduction of the paper

*Written by `make reproduce`; do not edit.*

"Estimating terrain parameters for a rigid wheeled rover using neural networks", Journal of Terramechanics 50 (2013)
165–174. Wheel radius and width, the gain of the drivetrain, and the scaling of the network's outputs are not in the
paper. Here r = 75 mm, w = 70 mm, the gain is 16.05 N·m/A, and cohesion is scaled to units of 10 kPa."""


def _pairs(results: Results) -> str:
    rows = [
        [
            f"{each.soil}",
            f"{each.lowest_N:.0f}",
            f"{each.median_N:.0f}",
            f"{each.highest_N:.0f}",
            f"{100 * each.possible_share:.0f} %",
        ]
        for each in results.loads
    ]
    possible = float(np.mean([each.possible_share for each in results.loads]))
    table = _table(["soil", "lowest load (N)", "median", "highest", "loads between 15 and 100 N"], rows)
    return f"""\
## The training set (Steps 1–15)

{published.PAIRS} pairs, as in the paper. Their loads, which Step 14 computes and the paper does not list:

{table}

On level ground each wheel of a 30 kg rover carries about 49 N. The grid varies sinkage independently of load: only
{100 * possible:.0f} % of the pairs have a load that a wheel of this rover can carry, most of them LETE sand and
medium soil. A smaller gain lowers the loads nearly in proportion, and brings other pairs into that range.

![Loads of the 504 pairs](../pictures/training-set.svg)"""


def _sizes(results: Results) -> str:
    if results.sizing is None:
        return "## Size of the network\nNot run yet: `make sizing`, then `make reproduce` recomputation."
    figures = results.sizing
    best, mean = int(figures["best_size"]), figures["best_mean_mse"]
    means = [value for key, value in figures.items() if key.startswith("mean_mse_")]
    error = figures[f"standard_error_{best}"]
    rows = [
        ["best size", str(PAPER_SIZE), str(best), f"{best - PAPER_SIZE:+d}"],
        ["mean MSE at it", f"{PAPER_MSE:.4f}", f"{mean:.4f}", f"{100 * (mean / PAPER_MSE - 1):+.1f} %"],
        [
            "mean MSE at 64",
            f"{PAPER_MSE:.4f}",
            f"{figures['mean_mse_64']:.4f}",
            f"{100 * (figures['mean_mse_64'] / PAPER_MSE - 1):+.1f} %",
        ],
    ]
    return f"""\
## Size of the network (59–84 neurons, {figures["trainings"] / 26:.0f} trainings each, up to 10 000 epochs)

{_table(["", "paper", "ours", "difference"], rows)}

The means of all 26 sizes lie between {min(means):.5f} and {max(means):.5f}, with standard errors of about {error:.5f}:
the differences between sizes are hardly larger than chance, and much smaller than the differences between
trainings of one size. Of {figures["trainings"]:.0f} trainings {figures["reached_goal"]:.0f} reached the goal of 0.005.

![MSE by size](../pictures/sizing.svg)"""


def _mse(results: Results) -> str:
    rows = [
        [each.name, f"{each.variance:.4g}", f"{each.mse:.4g}", f"{100 * (1 - each.mse / each.variance):.0f} %"]
        for each in results.scalings
    ]
    share = 100 * PAPER_MSE / results.scalings[0].variance
    table = _table(["scaling of the outputs", "variance of the outputs", "our MSE", "explained"], rows)
    return f"""\
## Scaling of the outputs and the MSE

The paper does not state the units of its MSE. Ours, for the same networks, in each plausible scaling:

{table}

Only in the first scaling is the MSE near 0.0251, which is {share:.0f} % of the outputs' variance: in this training
set [W, i, I] explain little of [c, tan φ] for any network, because sinkage varies independently. Such a network
returns nearly the mean of its four soils (3.7 kPa, 24.8°), with a small dependence on load and current. The paper's
estimates in the field are close to it: 3.6–3.9 kPa and 26–28° for every wheel and both grounds."""


def _record(results: Results) -> str:
    paper, ours = published.SET_500, results.record
    rows = [
        [
            "c (Pa)",
            f"{paper['cohesion_Pa']:.0f}",
            f"{ours.cohesion_Pa:.0f} ± {ours.cohesion_std_Pa:.0f}",
            f"{ours.cohesion_Pa - paper['cohesion_Pa']:+.0f}",
        ],
        [
            "φ (°)",
            f"{paper['friction_angle_deg']:.1f}",
            f"{ours.angle_deg:.1f} ± {ours.angle_std_deg:.1f}",
            f"{ours.angle_deg - paper['friction_angle_deg']:+.1f}",
        ],
    ]
    names = {"radius_m": "r = {:g} m", "width_m": "w = {:g} m", "gain_factor": "gain × {:g}"}
    moved = [
        [names[name].format(value), f"{each.cohesion_Pa:.0f}", f"{each.angle_deg:.1f}", f"{each.mse:.4f}"]
        for (name, value), each in results.unpublished.items()
    ]
    return f"""\
## Record 500, wheel 5: 80 mA, 31.6 N, slip 0.025

{_table(["", "paper", f"ours (mean ± deviation of {results.trainings} trainings)", "difference"], rows)}

Sensitivity to constants that the paper does not publish:

{_table(["", "c (Pa)", "φ (°)", "mean MSE"], moved)}

The shear modulus K of the test field is not an input of the network; the training set holds only the four values of
Table 1."""


def _tables(results: Results) -> str:
    parts = []
    for each in results.traverses:
        cohesion, angle = each.cohesion_Pa, each.angle_deg
        ground = each.ground
        rows = []
        for k in range(6):
            paper_c, paper_a = published.COHESION_PA[ground][k], published.ANGLE_DEG[ground][k]
            mean_c, mean_a = float(cohesion[:, k].mean()), float(angle[:, k].mean())
            rows.append(
                [
                    str(k + 1),
                    f"{paper_c} ({published.COHESION_RSD[ground][k]:.1f})",
                    f"{mean_c:.0f} ({relative_std(cohesion)[k]:.1f})",
                    f"{100 * (mean_c / paper_c - 1):+.0f} %",
                    f"{paper_a:.1f} ({published.ANGLE_RSD[ground][k]:.1f})",
                    f"{mean_a:.1f} ({relative_std(angle)[k]:.1f})",
                    f"{mean_a - paper_a:+.1f}",
                    f"{relative_std(each.current_A)[k]:.1f} / {relative_std(each.load_N)[k]:.1f}",
                ]
            )
        head = ["wheel", "c paper (Pa, %RSD)", "c ours", "diff.", "φ paper (°, %RSD)", "φ ours", "diff.", "I / W %RSD"]
        parts.append(f"**{ground.capitalize()} ground**\n\n{_table(head, rows)}")
    return f"""\
## The traverse (Tables 3–6, Figs 6–9)

909 records over 454.54 s at 2 Hz, as in the paper, whose measurements were not published. This traverse is synthetic:
each wheel has the mean load and current of record 500 with the relative standard deviations of the paper's Tables 4 and
6 for that wheel, and one record in twenty has a momentary drop of current. It therefore reproduces how the scatter of
current and load propagates to c and φ, and not the differences between the means of the wheels.

{parts[0]}

{parts[1]}

![The traverse](../pictures/traverse.svg)"""


def _bias(results: Results) -> str:
    cohesion, angle = results.noise_free
    both = np.mean([each.angle_deg.mean() for each in results.traverses])
    lowest = min(float(np.quantile(each.angle_deg, 0.01)) for each in results.traverses)
    return f"""\
## Momentary drops and the friction angle

At the mean load and current the network estimates φ = {angle:.1f}° (c = {cohesion:.0f} Pa).
Averaged over the noisy records φ is {both:.1f}°, and in one record of a hundred it is below {lowest:.0f}°.
φ is a concave function of current: a drop of current lowers it more than an equal rise increases it. The paper's
observation is reproduced. The bias that remains with the posterior is in
`build/figures/evaluate.json` (`make evaluate`)."""


_NOT = """\
## What does not reproduce, and why

- **The best size.** The differences between sizes are within chance (above).
- **MSE of 0.0251.** It is nearly reached in the only scaling in which it is possible; the difference may come from the
  unpublished constants, or from the toolbox's stopping and scaling rules.
- **Means of Tables 3 and 5.** The recorded currents and loads were not published, so they cannot be recomputed.
- **Differences between wheels.** They follow from the loads and currents of each wheel, which were not published.
- **Interpretation of the estimates.** Eq. 11 attributes a motor's no-load current (about 37 mA of the 50–100 mA
  recorded) to the soil. With our constants, the wheel–soil model needs 9 to 27 mA at 49 N and a slip of 0.025 on the
  four soils of Table 1: most of the recorded current is probably drivetrain friction.
- **Slip of 0.025 on level ground.** With the stresses of Eqs 4 and 5 a smooth wheel at that slip pulls less than its
  own resistance on each of the four soils and could not have driven. Grousers, which the equations do not model, are a
  likely reason."""


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def figures(results: Results) -> dict[str, float]:
    """Return the page's numbers as one flat object."""
    found = {
        "record_500_cohesion_Pa": results.record.cohesion_Pa,
        "record_500_cohesion_paper_Pa": published.SET_500["cohesion_Pa"],
        "record_500_friction_angle_deg": results.record.angle_deg,
        "record_500_friction_angle_paper_deg": published.SET_500["friction_angle_deg"],
        "mean_mse_64": results.record.mse,
        "mean_mse_paper": PAPER_MSE,
        "possible_share_of_pairs": float(np.mean([each.possible_share for each in results.loads])),
        "noise_free_friction_angle_deg": results.noise_free[1],
    }
    for each in results.loads:
        found[f"highest_load_{each.soil}_N"] = each.highest_N
    for drive in results.traverses:
        for k in range(6):
            name = f"{drive.ground}_wheel_{k + 1}"
            found[f"{name}_cohesion_Pa"] = float(drive.cohesion_Pa[:, k].mean())
            found[f"{name}_cohesion_rsd"] = float(relative_std(drive.cohesion_Pa)[k])
            found[f"{name}_friction_angle_deg"] = float(drive.angle_deg[:, k].mean())
            found[f"{name}_friction_angle_rsd"] = float(relative_std(drive.angle_deg)[k])
    return found
