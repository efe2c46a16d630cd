"""What can go wrong in a proof.

ProofError
 ├── BrokenSealError    an envelope does not hold what was committed to
 ├── OtherBatchError    the folder holds answers to another seed's recordings
 └── SolverError        the solver gave no answer
"""


class ProofError(Exception):
    """A proof cannot go on."""


class BrokenSealError(ProofError):
    """An envelope does not hold what was committed to."""


class OtherBatchError(ProofError):
    """The folder holds the answers to other recordings: take another seed's folder, or another folder."""


class SolverError(ProofError):
    """The solver gave no answer."""
