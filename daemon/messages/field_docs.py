"""Adds to a JSON Schema the description of each field: the string literal below it in the model's source.

pydantic can do the same (`use_attribute_docstrings`), but reads every source file for it when the daemon is imported.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

if TYPE_CHECKING:
    from collections.abc import Iterator


def describe_fields(schema: dict[str, Any]) -> None:
    """Add the descriptions to a schema and to all its definitions; they are found by the models' names."""
    models = {model.__name__: model for model in _subclasses(BaseModel)}
    parts = [(schema.get("title", ""), schema), *schema.get("$defs", {}).items()]
    for name, part in parts:
        if name in models:
            for field, text in _descriptions(models[name]).items():
                if "description" not in (known := part.get("properties", {}).get(field, {"description": ""})):
                    part["properties"][field] = {"description": text, **known}


def _subclasses(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    for each in model.__subclasses__():
        yield each
        yield from _subclasses(each)


def _descriptions(model: type[BaseModel]) -> dict[str, str]:
    """Return the description of each field, of a base class's as well."""
    found: dict[str, str] = {}
    for base in reversed(model.__mro__):
        if issubclass(base, BaseModel) and base is not BaseModel:
            found |= _literals_below_fields(base)
    return found


def _literals_below_fields(model: type[BaseModel]) -> dict[str, str]:
    try:
        source = textwrap.dedent(inspect.getsource(model))
    except OSError:  # made by `create_model`
        return {}
    (definition,) = ast.parse(source).body
    assert isinstance(definition, ast.ClassDef)  # noqa: S101  # the source of a class
    return {
        field.target.id: inspect.cleandoc(below.value.value)
        for field, below in pairwise(definition.body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(below, ast.Expr)
        and isinstance(below.value, ast.Constant)
        and isinstance(below.value.value, str)
    }
