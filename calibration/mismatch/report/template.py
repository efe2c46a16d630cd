"""What all reports share: where the answer came from, the template environment, equations, and versions."""

from __future__ import annotations

import platform
import re
from dataclasses import dataclass
from importlib import metadata, resources

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup, escape

from regolithd.calibration.mismatch.report.axes import number

COMPARED = ("numpy", "scipy", "pyarrow")
"""Packages that the result is computed with; the report lists their versions."""


@dataclass(frozen=True)
class Provenance:
    """Where the answer came from: names and SHA-256 of the two files, and the command that was given."""

    recording: str
    simulation: str
    recording_sha256: str
    simulation_sha256: str
    command: str = ""


def render(template: str, **shown: object) -> str:
    """Return a template of this package, by its path, as one HTML document that opens without a network."""
    style = Markup(_resource("report/style.css"))  # noqa: S704  # our own file
    return _environment().get_template(template).render(style=style, versions=_versions(), **shown)


def _environment() -> Environment:
    made = Environment(
        loader=FunctionLoader(_resource),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.filters |= {"number": number, "equation": equation}
    return made


def _resource(path: str) -> str:
    return resources.files("regolithd.calibration.mismatch").joinpath(path).read_text("utf-8")


def equation(text: str) -> Markup:
    """Return an equation with `x_y` and `x^y` as subscript and superscript."""
    lowered = re.sub(r"_(\w+)", r"<sub>\1</sub>", str(escape(text)))
    return Markup(re.sub(r"\^(\w+)", r"<sup>\1</sup>", lowered))  # noqa: S704  # escaped above


def _versions() -> list[str]:
    """Return the versions of Python, of this project and of the packages that it computes with."""
    found = [f"Python {platform.python_version()}"]
    for package in ("regolithd", *COMPARED):
        try:
            found.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:
            found.append(f"{package} from source")
    return found
