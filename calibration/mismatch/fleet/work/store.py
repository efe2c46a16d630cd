"""Results of single recordings on disk, so that an interrupted comparison, or one with more recordings, continues.

One file for each recording and step, named by a digest of all that it depends on: an `.npz` archive whose member `tree`
is JSON, with the arrays beside it. Nothing in it is executed when it is read.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from regolithd.calibration.mismatch import answer as answers
from regolithd.calibration.mismatch.candidates.responses import Responses
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm, Shapes
from regolithd.calibration.mismatch.fleet.work.sums import Sums
from regolithd.calibration.mismatch.inference.findings import Findings
from regolithd.calibration.mismatch.problem.corrections.onset_clock import FoundIn
from regolithd.calibration.mismatch.problem.corrections.size_posterior import SizePosterior
from regolithd.calibration.mismatch.problem.problem import LeftOut
from regolithd.calibration.mismatch.signal.noise_models.noise import LaggedSums

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

KINDS: Mapping[str, type] = {
    kind.__name__: kind
    for kind in (
        Found,
        FoundTerm,
        Shapes,
        Responses,
        Sums,
        LaggedSums,
        Contribution,
        FoundIn,
        LeftOut,
        Findings,
        answers.Parameter,
        answers.Effect,
        answers.Range,
        answers.Unexplained,
        answers.CalibratedParameter,
        answers.Change,
        SizePosterior,
    )
}
"""Data classes that may be in a file."""


class Store:
    """A folder of results."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def read(self, key: str) -> Any | None:  # noqa: ANN401  # what was written under this key
        """Return a result, or None where there is none, or only part of one."""
        path = self._folder / f"{key}.npz"
        try:
            with np.load(BytesIO(path.read_bytes()), allow_pickle=False) as archive:
                arrays = [archive[f"a{n}"] for n in range(len(archive.files) - 1)]
                return _decoded(json.loads(str(archive["tree"])), arrays)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, TypeError, BadZipFile):
            return None

    def write(self, key: str, value: object) -> None:
        """Store a result; a process that is killed while it writes leaves no half file under this name."""
        arrays: list[np.ndarray[Any, Any]] = []
        tree = json.dumps(_encoded(value, arrays))
        content = BytesIO()
        np.savez(content, tree=np.array(tree), **{f"a{n}": array for n, array in enumerate(arrays)})  # type: ignore[arg-type]
        part = self._folder / f"{key}.part"
        part.write_bytes(content.getvalue())
        part.replace(self._folder / f"{key}.npz")

    def keep_only(self, keys: Iterable[str]) -> None:
        """Remove results of what no longer is as it was."""
        wanted = {f"{key}.npz" for key in keys}
        for path in self._folder.glob("*.npz"):
            if path.name not in wanted:
                path.unlink()


def _encoded(value: object, arrays: list[np.ndarray[Any, Any]]) -> Any:  # noqa: ANN401  # JSON
    """Return a value as JSON; arrays are put into the list and referred to by their place."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if is_dataclass(value):
        content = {each.name: _encoded(getattr(value, each.name), arrays) for each in fields(value)}
        name = type(value).__name__
        if name not in KINDS:
            raise TypeError(f"{name} is none of the data classes that may be in a file: add it to KINDS")
        return {"class": name, "fields": content}
    if isinstance(value, tuple | list):
        return {"tuple": [_encoded(each, arrays) for each in value]}
    if isinstance(value, Mapping):
        return {"mapping": [[key, _encoded(each, arrays)] for key, each in value.items()]}
    return value.item() if isinstance(value, np.generic) else value


def _decoded(tree: Any, arrays: list[np.ndarray[Any, Any]]) -> Any:  # noqa: ANN401
    if not isinstance(tree, dict):
        return tree
    ((kind, content), *more) = tree.items()
    if kind == "array":
        return arrays[content]
    if kind == "tuple":
        return tuple(_decoded(each, arrays) for each in content)
    if kind == "mapping":
        return {key: _decoded(each, arrays) for key, each in content}
    values = {name: _decoded(each, arrays) for name, each in more[0][1].items()}
    return KINDS[content](**values)
