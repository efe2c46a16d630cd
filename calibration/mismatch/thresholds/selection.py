"""Which effects are named."""

from __future__ import annotations

from dataclasses import dataclass

from regolithd.calibration.mismatch.thresholds.threshold import CHOICE, TRIALS, threshold


@dataclass(frozen=True)
class SelectionThresholds:
    """Which effects are named."""

    # Free parameters
    own_share: float = threshold(
        1 / 3,
        "Standard deviation of a wheel's own deviation of a parameter, as a share of the common one's.",
        f"{TRIALS}: none lets a motor that is off pass for an efficiency; as large as the common one hides ruts of 5 % "
        "(seed 4296646855041348324)",
    )
    # Smooth terms
    curve_knots: int = threshold(8, "Knots of a smooth term over a covariate.", f"{CHOICE}: laws have one bend or two")
    time_knots: int = threshold(
        48, "Knots of a smooth term over time.", f"{CHOICE}: spells down to a fortieth of the recording have to show"
    )
    state_time_knots: int = threshold(
        16,
        "Knots over time of what acts on a state, which remembers it for some time.",
        f"{CHOICE}: a flow that comes and goes four times is followed, and noise that lasts as long hardly",
    )
    least_variance_within: float = threshold(
        0.2,
        "Share of a covariate's variance within wheels, below which no smooth term is made of it.",
        f"{TRIALS}: a curve over what only differs between wheels is a list of wheels",
    )
    fewest_periods: float = threshold(
        4.0, "Periods in the recording, below which a sine over time is a slow curve.", f"{CHOICE}: two knots a period"
    )
    shortest_period: float = threshold(
        5.0, "Shortest period of a sine over time [readings].", f"{CHOICE}: twice the Nyquist limit, and some"
    )
    # Penalties
    coefficient_penalty: float = threshold(
        2.0, "Penalty of a coefficient, in Δχ².", "standard: Akaike's information criterion"
    )
    single_wheel_penalty: float = threshold(
        6.0,
        "Penalty, in Δχ², of one wheel (or some) for an effect that all wheels may have.",
        f"{CHOICE}: prior odds of about 20 to 1 (2 ln 20) that what all wheels are built with is on all",
    )
    new_effect_penalty: float = threshold(
        9.2,
        "Penalty, in Δχ², of an effect that is new beside those which the simulation was corrected by.",
        f"{CHOICE}: odds of 100 to 1 (2 ln 100) that a known effect has changed, against one new one of many",
    )
    unlikely_penalty: float = threshold(
        9.2,
        "Penalty, in Δχ², of an effect that the simulation calls unlikely on its machine.",
        f"{CHOICE}: prior odds of one in a hundred (2 ln 100)",
    )
    own_channel_share: float = threshold(
        0.5,
        "Share of a fault's Δχ² in its own channel that is credited to it in the predicted one.",
        f"{TRIALS}: half, since the own channel's reference is only as good as pitch and roll",
    )
    largest_own_channel_credit: float = threshold(
        300.0, "Largest such credit, in Δχ².", f"{TRIALS}: a large drift must show in the predicted channel too"
    )
    own_channel_visible: float = threshold(
        25.0, "Δχ² in its own channel below which a fault is not there.", f"{CHOICE}: five standard deviations"
    )
    # Regression
    least_tolerance: float = threshold(
        1e-5,
        "Tolerance (1 / variance inflation factor) below which a column counts as a combination of the others.",
        f"{CHOICE}: rounding of the sums in single precision is a hundredth of it; whether what is left of a column "
        "explains anything is told by its Δχ²",
    )
    active_share: float = threshold(
        0.4,
        "An effect's size counts as at least this share of its root mean square while it acts.",
        f"{TRIALS}: what acts a tenth of the time is not missed for its small mean",
    )
    # Entry into the set of named effects
    false_name_rate: float = threshold(
        0.005, "Rate of names given by chance where nothing is missing.", f"{CHOICE}: half of the contract's 1 %"
    )
    sign_flip_draws: int = threshold(
        600, "Draws of the sign-flip test.", f"{CHOICE}: three draws are beyond the quantile of 0.5 %; a second of time"
    )
    sign_flip_margin: float = threshold(
        1.0, "Added to the quantile of the sign-flip test, in Δχ².", f"{CHOICE}: about its own standard error"
    )
    least_entry: float = threshold(
        5.0, "Lowest entry threshold, in Δχ² less penalty.", f"{TRIALS}: 600 draws do not know their own tail"
    )
    largest_entry: float = threshold(
        12.0, "Highest entry threshold, in Δχ² less penalty.", f"{TRIALS}: structure left in draws raises the quantile"
    )
    further_term_entry: float = threshold(
        2.0,
        "Added to the entry threshold of a further effect beside one that was chosen already.",
        f"{TRIALS}: the further one is chosen beside a choice",
    )
    further_share: float = threshold(
        0.01,
        "Share of the others' Δχ² that a further effect must gain: no law is exact to the last percent.",
        f"{TRIALS}: laws of the generator differ from the candidates' by percents",
    )
    remaining_share: float = threshold(
        0.1, "Or the share of what the others leave that it must take.", f"{TRIALS}: for a small effect beside a large"
    )
    beside_smooth_share: float = threshold(
        0.1,
        "Share of a smooth term's Δχ² that an effect beside it must gain: less may have leaked from it.",
        f"{TRIALS}: what has no law leaks into every law",
    )
    smallest_effect: float = threshold(
        0.02,
        "Smallest active root mean square of a named effect, as a share of the channel's mean magnitude.",
        f"{CHOICE}: less is no finding; effects in trials start at 5 %",
    )
    smallest_delay_effect: float = threshold(
        0.005,
        "The same of a delay, of which the time is told: how much it changes depends on how quickly the column does.",
        f"{CHOICE}: a filter of 8 s on a slow machine changed 1.4 to 1.9 % of the mean reading, and gained 46 to 83",
    )
    own_channel_ratio_low: float = threshold(
        0.4, "Least ratio of a fault's size in the predicted channel to that in its own.", f"{TRIALS}: drift of cells"
    )
    own_channel_ratio_high: float = threshold(
        2.5, "Largest such ratio.", "the reciprocal of the least, so that neither channel is preferred"
    )
    # Breadth of the search
    polished_singles: int = threshold(5, "Single effects whose shape is optimised.", f"{CHOICE}: computing time")
    pair_breadth: int = threshold(4, "Second effects tried beside each first.", f"{CHOICE}: computing time")
    polished_pairs: int = threshold(4, "Pairs whose shapes are optimised.", f"{CHOICE}: computing time")
    most_polished_pairs: int = threshold(
        10, "The same of pairs that are behind by no more than a law's misfit, `further_share`.", f"{CHOICE}: time"
    )
    triple_breadth: int = threshold(
        2, "Pairs to which a third effect is added, and third effects for each.", f"{CHOICE}: computing time"
    )
    # Shape optimisation
    onset_reach: float = threshold(
        0.05, "Half width of the search for an onset, as a share of the recording.", "the grid's spacing of 4 %"
    )
    shape_reach: float = threshold(
        0.35, "Half width of the search for a shape parameter, relative to its value.", "the grids' ratios of 1.5 to 2"
    )
    shape_reach_floor: float = threshold(
        0.2, "Share of its range that counts as a shape parameter's least value there.", f"{CHOICE}: values near 0"
    )
    self_consistency_steps: int = threshold(
        4, "Most steps towards a shape that agrees with its coefficients.", f"{CHOICE}: two are usual"
    )
    # Cross-validation
    transferred_share: float = threshold(
        0.5,
        "Least share of an effect's Δχ² that must be gained on folds that did not fit it.",
        f"{CHOICE}: of a stationary effect all but the coefficients' cost comes back, of an occasion nothing",
    )
    coefficient_cost: float = threshold(
        2.0, "Expected loss of a fitted coefficient on new data, in Δχ².", "standard: the optimism of least squares"
    )
    # Smooth terms against names
    smooth_term_entry: float = threshold(
        20.0,
        "Score above which a smooth term is significant, in Δχ² less penalty.",
        f"{TRIALS}: by chance at most 6.8 in 47 sound recordings and once 17.1 beside a named effect; the weakest "
        "concealed one of 25 scored 31 (seeds 98309134, 127741224)",
    )
    slow_noise_entry: float = threshold(
        8.0,
        "Score above which a smooth term is told, where the noise may have any spectrum, in Δχ² less penalty.",
        "standard: by chance one of eight smooth terms, with a line's two coefficients and a likeliest smoothness "
        "each, scores as much in one recording of 50 (χ²); most are told from noise by its weights, too",
    )
    smooth_term_power: float = threshold(
        0.01, "Share of the residual's power on its wheels below which a smooth term is ignored.", f"{CHOICE}"
    )
    form_misfit: float = threshold(
        0.12,
        "Share of Δχ² that a smooth term may add to an effect's law, which is then still taken as the right law.",
        f"{TRIALS}: laws of the generator differ from the candidates'",
    )
    single_test_level: float = threshold(
        1e-3,
        "Level of a test that is not one of many: that a change comes and goes, by a curve over time beside it; that a "
        "law of which each wheel has its own coefficients acts on more than one wheel; that there is friction which "
        "may reverse gradually.",
        f"{CHOICE}: one test for each effect that is named",
    )
