"""How soon `regolithd monitor` reports drag that begins in the middle of a drive, and how often it reports falsely.

    python -m regolithd.calibration.validation.online_study --drives 40 build/figures/online.json build/online.svg

Drives of the blind trials' rover (its parameters drawn from their priors, errors in every input, noise of 30 % of the
mean current that is correlated for 1 to 15 s) are cut into minutes as the command cuts them. Each is used with several
draws of its noise, and with drag of several sizes added on one wheel.
"""
