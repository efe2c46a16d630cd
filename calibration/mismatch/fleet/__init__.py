"""Many recordings of several rovers, compared together.

each recording ─▶ found by itself ─▶ sums of products ─┐
each recording ─▶ found by itself ─▶ sums of products ─┼▶ search over rovers, wheels and dates ─▶ one answer, catalogue
…

What costs time is done recording by recording, on any number of processes or computers, and does not depend on the
others. The sums of products of the simulation's tangents and of the candidates' columns are all that the search needs:
they add up over recordings, whoever computed them, so that the answer does not depend on who did.
"""
