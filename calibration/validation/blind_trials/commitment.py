"""Hash commitment to a truth: publish its digest first, open it later, and verify that it was not changed.

The digest is SHA-256 over a random salt and the truth in canonical JSON. The salt prevents guessing the truth from the
digest; with salt and truth anyone can recompute it. The truth includes the digests of the solver's input files, so the
commitment binds them as well.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from regolithd.calibration.validation.blind_trials.errors import CommitmentError

if TYPE_CHECKING:
    from pathlib import Path

Truth = dict[str, Any]
"""What is committed to: plain JSON."""


def commitment_digest(salt: str, truth: Truth) -> str:
    """Return the hexadecimal SHA-256 of the salt, a line feed, and the truth as canonical JSON."""
    canonical = json.dumps(truth, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(f"{salt}\n{canonical}".encode()).hexdigest()


@dataclass(frozen=True)
class Commitment:
    """A truth and its salt; only `digest` is published before the solver has answered."""

    truth: Truth = field(repr=False)
    salt: str = field(repr=False, default_factory=lambda: secrets.token_hex(16))

    @property
    def digest(self) -> str:
        """Digest that is published."""
        return commitment_digest(self.salt, self.truth)

    def open_into(self, path: Path, committed: str) -> None:
        """Check salt and truth against the published digest, and write them to a JSON file."""
        verify(committed, self.salt, self.truth)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"digest": committed, "salt": self.salt, "truth": self.truth}, indent=1) + "\n")


def verify(committed: str, salt: str, truth: Truth) -> None:
    """Raise `CommitmentError` unless salt and truth have the digest that was committed to."""
    if (found := commitment_digest(salt, truth)) != committed:
        raise CommitmentError(f"salt and truth have the digest {found[:16]}…, but {committed[:16]}… was committed to")


def read_opened(path: Path) -> Truth:
    """Return the truth of an opened commitment after verifying its digest."""
    opened = json.loads(path.read_text())
    verify(opened["digest"], opened["salt"], opened["truth"])
    return opened["truth"]


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file's bytes."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
