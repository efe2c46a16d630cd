"""The proof: recordings with an effect concealed, sealed envelopes, a solver that cannot see in, and the score.

`generator` writes the recordings and shares no code with what solves them: its own wheel on soil (`ground`), its own
drives (`drive`), its own forms of every effect (`concealed`, `outside`). `envelope` commits to the truth before the
solver starts. `score` opens it afterwards; `peers` are the tools that people would otherwise reach for.
"""
