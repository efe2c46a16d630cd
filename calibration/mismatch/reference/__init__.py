"""Reference of the mismatch tool, made from its code: the library of effects, and the keys of the answer.

python -m regolithd.calibration.mismatch.reference docs/reference

writes it into the pages `effects.md` and `answer.md` of that folder, below the line that says so; what is above that
line is kept.
"""
