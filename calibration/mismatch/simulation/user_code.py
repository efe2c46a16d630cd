"""Calls of a user's code: absent columns are named, errors are told with file and line, results are checked arrays."""

from __future__ import annotations

import inspect
import sysconfig
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.errors import MismatchError, MissingColumnError, SimulationError, did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

Array = NDArray[np.float64]

OWN_PACKAGE, OWN_FOLDER = __name__.rsplit(".", 2)[0], str(Path(__file__).parents[1])
"""The mismatch tool itself."""
NOT_THE_USERS = tuple(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib"))
"""Folders whose code is a library's: an error in it is told at the user's line that called it."""


class Columns(dict[str, Array]):
    """Recorded columns by name; one that is not there is an error that names it, and what was read is remembered."""

    def __init__(self, columns: Mapping[str, Array], unread: Iterable[str] = ()) -> None:
        super().__init__(columns)
        self.unread = tuple(unread)
        self.read: list[str] = []

    def __getitem__(self, name: str) -> Array:
        """Return a column."""
        self.read.append(name)
        return super().__getitem__(name)

    def __missing__(self, name: str) -> Array:
        raise self.missing(name, "it reads")

    def get(self, name: str, default: Any = None) -> Any:  # noqa: ANN401  # as dict's
        """Return a column, or the default where it is not there."""
        self.read.append(name)
        return super().get(name, default)

    def missing(self, name: str, needed: str) -> MissingColumnError:
        """Return the error that tells about an absent column; `needed` begins the sentence."""
        held = next((f"; {told}" for told in self.unread if told.startswith(f"column {name} ")), "")
        absent = f" as numbers{held}" if held else f"; {did_you_mean(name, self)}"
        return MissingColumnError(name, f"{needed} column {name}, which the recording does not have{absent}")

    def why_blank(self) -> str:
        """Return what is wrong with the columns that were read: one is not there, or blank in places."""
        for name in dict.fromkeys(self.read):
            if name not in self:
                return f": {self.missing(name, 'it reads')}"
        for name in dict.fromkeys(self.read):
            blank = ~np.isfinite(dict.__getitem__(self, name))
            if blank.any():
                return (
                    f": column {name}, which it reads, is blank in {int(blank.sum())} of {blank.size} readings. A "
                    "filter or a sum carries one blank on to all others: interpolate before it, or compute each part "
                    "between blanks by itself"
                )
        return ""


class Parameters(dict[str, float]):
    """Parameters' values by name; one that the class does not state is an error that names it."""

    def __missing__(self, name: str) -> float:
        raise SimulationError(
            f"it reads parameter {name}, which `parameters` does not state; {did_you_mean(name, self)}"
        )


def called(owner: object, method: str, *arguments: object) -> Any:  # noqa: ANN401  # what the user's method returns
    """Call a method of the user's object.

    Raises
    ------
    MismatchError
        Whatever the method raises, with class, method, file and line.
    """
    try:
        # The result is checked for being finite; how it came about is the user's.
        with np.errstate(all="ignore"):
            return getattr(owner, method)(*arguments)
    except MissingColumnError as error:
        raise MissingColumnError(error.name, f"{_place(owner, method, error)}{error}") from error
    except MismatchError as error:
        raise type(error)(f"{_place(owner, method, error)}{error}") from error
    except Exception as error:  # a user's method may raise anything
        raise SimulationError(f"{_place(owner, method, error)}{type(error).__name__}: {error}") from error


def _place(owner: object, method: str, error: Exception) -> str:
    """Return "Tank.predict (tank.py, line 7): "; nothing for this package's own simulations."""
    if type(owner).__module__.startswith(f"{OWN_PACKAGE}."):
        return ""
    return f"{type(owner).__name__}.{method}{user_line(error) or defined_at(getattr(type(owner), method))}: "


def defined_at(code: Any) -> str:  # noqa: ANN401  # a class or function
    """Return " (file, line 7)" where a class or function begins; nothing where it was typed into an interpreter."""
    try:
        return f" ({inspect.getsourcefile(code)}, line {inspect.getsourcelines(code)[1]})"
    except (OSError, TypeError):
        return ""


def user_line(error: BaseException) -> str:
    """Return " (file, line 7)", the innermost line of the user's own code; nothing where the error is not in it."""
    if isinstance(error, SyntaxError) and error.filename:
        return f" ({error.filename}, line {error.lineno})"
    frames = traceback.extract_tb(error.__traceback__)
    users = [f for f in frames if not f.filename.startswith((OWN_FOLDER, "<frozen", *NOT_THE_USERS))]
    return f" ({users[-1].filename}, line {users[-1].lineno})" if users else ""


def array_of(found: object, shape: tuple[int, ...], what: str) -> Array:
    """Return a result as numbers of the shape that is needed.

    Raises
    ------
    SimulationError
        When it has another shape, or holds no real numbers.
    """
    try:
        values = np.asarray(found)
        if values.dtype.kind not in "fiub":
            values = np.asarray(values.tolist(), np.float64)  # objects that are numbers
    except (TypeError, ValueError) as error:
        kind = getattr(found, "dtype", type(found).__name__)
        raise SimulationError(f"{what} must be real numbers of shape {shape}, not {kind}") from error
    if values.shape != shape:
        hint = ""
        if len(shape) == 2 and values.shape == shape[:1]:
            hint = "; compute with the columns as they are, (time, wheel), or return result[:, None]"
        raise SimulationError(f"{what} must have shape {shape}, not {values.shape}{hint}")
    return values.astype(np.float64, copy=False)
