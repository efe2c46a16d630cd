"""Sealed envelopes: commit to a truth by its digest, open it later, and let anybody check that it was not changed.

The digest is SHA-256 over a random salt and the truth in canonical JSON. Without the salt nobody can try likely truths
against it; with salt and truth anybody can compute it again. The truth holds the digests of the files that the solver
was given, so it binds them too.
"""

from __future__ import annotations

import hashlib
import json
import secrets
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from regolithd.calibration.validation.blind_trials.errors import BrokenSealError

if TYPE_CHECKING:
    from pathlib import Path

Truth = dict[str, Any]
"""What an envelope holds: plain JSON, as it will be read by whoever opens it."""


def seal(salt: str, truth: Truth) -> str:
    """Return the commitment to a truth: hexadecimal SHA-256 of the salt, a line end, and the truth's canonical JSON."""
    canonical = json.dumps(truth, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(f"{salt}\n{canonical}".encode()).hexdigest()


@dataclass(frozen=True)
class Envelope:
    """A truth and its salt; only `digest` is told before the solver has answered."""

    truth: Truth = field(repr=False)
    salt: str = field(repr=False, default_factory=lambda: secrets.token_hex(16))

    @property
    def digest(self) -> str:
        """The commitment."""
        return seal(self.salt, self.truth)

    def open_into(self, path: Path, committed: str) -> None:
        """Write salt and truth where anybody can read them, after checking them against what was committed to."""
        check_seal(committed, self.salt, self.truth)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"digest": committed, "salt": self.salt, "truth": self.truth}, indent=1) + "\n")


def check_seal(committed: str, salt: str, truth: Truth) -> None:
    """Raise `BrokenSealError` unless salt and truth have the digest that was committed to."""
    if (found := seal(salt, truth)) != committed:
        raise BrokenSealError(f"the envelope holds {found[:16]}…, but {committed[:16]}… was committed to")


def read_opened(path: Path) -> Truth:
    """Return the truth of an opened envelope, its seal checked again."""
    opened = json.loads(path.read_text())
    check_seal(opened["digest"], opened["salt"], opened["truth"])
    return opened["truth"]


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file's bytes."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
