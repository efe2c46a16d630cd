"""Errors of the blind trials.

ProofError
 ├── CommitmentError    a truth does not have the digest that was committed to
 ├── OtherBatchError    the folder holds answers to another seed's recordings
 └── SolverError        the solver gave no answer
"""


class ProofError(Exception):
    """A batch of blind trials cannot continue."""


class CommitmentError(ProofError):
    """A truth does not have the digest that was committed to."""


class OtherBatchError(ProofError):
    """The folder holds the answers to another seed's recordings: use that seed, or another folder."""


class SolverError(ProofError):
    """The solver gave no answer."""
