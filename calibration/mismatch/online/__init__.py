"""Sequential monitoring of a recording while it grows: drag that begins during a drive is reported before its end.

rows ─▶ minutes ─▶ residual and columns of a minute ─▶ sums of products ─▶ sequential test ─▶ report

The first minutes are kept, and show where to linearise the simulation, how strong the noise is and how long it is
correlated. After that only sums of products stay of each minute: those of the last minutes one by one, older ones
together, so that the memory does not grow with the recording. After each minute every law, on every set of wheels, with
every onset, is held against "nothing has begun": a generalised likelihood ratio test (Lorden 1971; Siegmund and
Venkatraman 1995), whose threshold is the number `OnlineThresholds.alarm`, chosen for one false report in
100 hours over all of them together.

The test is of each law in one shape. What the report cannot tell apart, the comparison of the whole recording decides.
"""
