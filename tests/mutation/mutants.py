"""Mutations of the three rooms' code: Cosmic Ray's operators at every place, and a random sample of the places.

Left out are places that no test can judge: annotations and `if TYPE_CHECKING`, which do not run, and the values of
constants, fields and parameters named `timeout_s` or `…_timeout_s`, because no requirement fixes a time limit to a
second.
"""

from __future__ import annotations

import ast
import difflib
import hashlib
import random
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

ROOMS = {"drivers": "tests/drivers", "daemon": "tests/daemon", "calibration/mismatch": "tests/calibration/mismatch"}
"""Folders that are mutated, and their own tests."""
TIME_LIMIT = re.compile(r"(\w*_)?timeout_s", flags=re.IGNORECASE)
EQUAL = ("_Is_Eq", "_IsNot_NotEq")
"""Left out: `is` compares enumeration members and None here, for which `==` gives the same."""


@dataclass(frozen=True)
class Mutation:
    """One mutation: Cosmic Ray's operator, which occurrence of it in the file, and where that is."""

    file: str
    line: int
    column: int
    operator: str
    occurrence: int

    def applied(self, source: str) -> str:
        """Return the file's text with the mutation."""
        return str(mutate_code(source, get_operator(self.operator)(), self.occurrence))


def difference(original: str, mutated: str) -> str:
    """Return the changed lines."""
    lines = difflib.unified_diff(original.splitlines(), mutated.splitlines(), lineterm="", n=0)
    return "\n".join(line for line in lines if line[:3] not in {"---", "+++"} and line[:2] != "@@")


def room_of(file: str) -> str:
    """Return the room that a file belongs to."""
    return next(room for room in ROOMS if file.startswith(room + "/"))


def _parts_left_out(node: ast.AST) -> list[ast.AST | None]:
    """Return the parts of a node that no test can judge."""
    match node:
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return [node.test, *node.body]
        case ast.AnnAssign(target=ast.Name(id=name)) if TIME_LIMIT.fullmatch(name):
            return [node]
        case ast.arg() | ast.AnnAssign() if node.annotation:
            return [node.annotation]
        case ast.FunctionDef() | ast.AsyncFunctionDef():
            return [node.returns, *_default_time_limits(node.args)]
        case ast.Assign(targets=[ast.Name(id=name)]) if TIME_LIMIT.fullmatch(name):
            return [node.value]
    return []


def _default_time_limits(given: ast.arguments) -> Iterator[ast.expr | None]:
    """Yield the default values of parameters that are time limits."""
    positional = [*given.posonlyargs, *given.args]
    defaults = zip(positional[len(positional) - len(given.defaults) :], given.defaults, strict=True)
    for parameter, default in (*defaults, *zip(given.kwonlyargs, given.kw_defaults, strict=True)):
        if TIME_LIMIT.fullmatch(parameter.arg):
            yield default


def left_out(tree: ast.Module) -> set[tuple[int, int]]:
    """Return (line, column) of every place that is not mutated."""
    parts = [part for node in ast.walk(tree) for part in _parts_left_out(node)]
    return {
        (line, column)
        for part in parts
        if isinstance(part, ast.expr | ast.stmt)
        for line in range(part.lineno, (part.end_lineno or part.lineno) + 1)
        for column in range(
            part.col_offset if line == part.lineno else 0,
            (part.end_col_offset or 0) if line == part.end_lineno else 400,
        )
    }


def no_operators(tree: Any) -> set[tuple[int, int]]:
    """Return (line, column) of each `*`, `/` and `**` of parameters, arguments and displays in parso's tree.

    Cosmic Ray takes them for operators; changed, they are no program, or the same one.
    """
    return {
        leaf.start_pos
        for leaf in ast_nodes(tree)
        if leaf.type == "operator" and leaf.value in {"*", "/", "**"} and leaf.parent.type not in {"term", "power"}
    }


def mutations(root: Path, file: str) -> Iterator[Mutation]:
    """Yield every mutation of a file of a checkout."""
    source = (root / file).read_text()
    tree = get_ast(source)
    without = left_out(ast.parse(source)) | no_operators(tree)
    for name in operator_names():
        kind = get_operator(name)
        if kind.arguments() or name.endswith(("NoOp", *EQUAL)):
            continue
        operator = kind()
        places = [start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)]
        for occurrence, (line, column) in enumerate(places):
            if (line, column) not in without:
                yield Mutation(file, line, column, name, occurrence)


def sample(root: Path, count: int, seed: int, only: str) -> list[Mutation]:
    """Draw places evenly over all of them, and one mutation of each; a larger sample begins with the smaller one."""
    files = sorted(str(path.relative_to(root)) for room in ROOMS for path in (root / room).rglob("*.py"))
    places: dict[tuple[str, int, int], list[Mutation]] = {}
    for file in files:
        for mutation in mutations(root, file) if file.startswith(only) else ():
            places.setdefault((mutation.file, mutation.line, mutation.column), []).append(mutation)
    order = sorted(places, key=lambda place: hashlib.sha256(f"{seed} {place}".encode()).digest())
    drawn: list[Mutation] = []
    for place in order:
        if len(drawn) == count:
            break
        here = places[place]
        random.Random(f"{seed} {place}").shuffle(here)
        found = next((each for each in here if is_program(each, root)), None)
        drawn += [] if found is None else [found]
    return drawn


def is_program(mutation: Mutation, root: Path) -> bool:
    """Return whether a mutation can be made, and Python accepts the result."""
    try:
        compile(mutation.applied((root / mutation.file).read_text()), mutation.file, "exec", dont_inherit=True)
    except (SyntaxError, AttributeError):  # the latter from Cosmic Ray, for a dotted exception
        return False
    return True
