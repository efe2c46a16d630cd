"""Random damage to files, from a seed: to their bytes, and to the lines and cells of a text."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

CELLS = (
    "", "NaN", "inf", "-inf", "0", "-0", "-1", "1e308", "-1e308", "1e-308", "1e30", "99999999999999999999999", "1,5",
    "true", "wheel", "°C", '"', "'", "\x00", "2026-01-31T12:00:00", "[", "]", "=", "#", "{}", "nan", " ", "../..",
)  # fmt: skip
"""What a mutation writes in place of a word."""


def damaged_bytes(content: bytes, random: Random) -> bytes:
    """Return the content with one to three random changes: cut off, flipped, removed, repeated, inserted, zeroed."""
    for _ in range(random.randint(1, 3)):
        content = random.choice(_OF_BYTES)(content, random)
    return content


def damaged_text(text: str, random: Random, separator: str) -> bytes:
    """Return a text with one to three random changes to its lines, cells or bytes; some in another encoding."""
    for _ in range(random.randint(1, 3)):
        text = random.choice(_OF_TEXT)(text, random, separator)
    content = text.encode(random.choice(("utf-8",) * 8 + ("latin-1", "utf-16")), "replace")
    return damaged_bytes(content, random) if random.random() < 0.2 else content


def _span(content: bytes, random: Random, longest: int = 200) -> tuple[int, int]:
    start = random.randrange(len(content) + 1)
    return start, min(len(content), start + random.randint(0, longest))


def _cut(content: bytes, random: Random) -> bytes:
    return content[: random.randrange(len(content) + 1)]


def _flip(content: bytes, random: Random) -> bytes:
    changed = bytearray(content)
    for _ in range(random.randint(1, 8) if changed else 0):
        changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _remove(content: bytes, random: Random) -> bytes:
    start, stop = _span(content, random)
    return content[:start] + content[stop:]


def _repeat(content: bytes, random: Random) -> bytes:
    start, stop = _span(content, random)
    return content[:stop] + content[start:]


def _insert(content: bytes, random: Random) -> bytes:
    start = random.randrange(len(content) + 1)
    return content[:start] + random.randbytes(random.randint(1, 16)) + content[start:]


def _zero(content: bytes, random: Random) -> bytes:
    start, stop = _span(content, random)
    return content[:start] + bytes(stop - start) + content[stop:]


def _a_line(lines: list[str], random: Random) -> int:
    """Return the index of a line; the first, which names the columns, as often as all others."""
    return 0 if random.random() < 0.5 else random.randrange(len(lines))


def _replace_cell(text: str, random: Random, separator: str) -> str:
    lines = text.split("\n")
    at = _a_line(lines, random)
    cells = lines[at].split(separator)
    cells[random.randrange(len(cells))] = random.choice(CELLS)
    lines[at] = separator.join(cells)
    return "\n".join(lines)


def _replace_column(text: str, random: Random, separator: str) -> str:
    """Write the same in a column of many lines."""
    lines, word, share = text.split("\n"), random.choice(CELLS), random.choice((0.01, 0.3, 1.0))
    place = random.randrange(lines[0].count(separator) + 1)
    for at in range(1, len(lines)):
        cells = lines[at].split(separator)
        if place < len(cells) and random.random() < share:
            cells[place] = word
            lines[at] = separator.join(cells)
    return "\n".join(lines)


def _remove_column(text: str, random: Random, separator: str) -> str:
    place = random.randrange(text.split("\n", 1)[0].count(separator) + 1)
    rows = [line.split(separator) for line in text.split("\n")]
    return "\n".join(separator.join(row[:place] + row[place + 1 :]) for row in rows)


def _repeat_column(text: str, random: Random, separator: str) -> str:
    place = random.randrange(text.split("\n", 1)[0].count(separator) + 1)
    rows = [line.split(separator) for line in text.split("\n")]
    return "\n".join(separator.join(row[:place] + row[place : place + 1] + row[place:]) for row in rows)


def _misspell(text: str, random: Random, separator: str) -> str:
    """Change, remove or repeat one character of a cell."""
    lines = text.split("\n")
    at = _a_line(lines, random)
    line = lines[at]
    if separator and line:
        place = random.randrange(len(line))
        lines[at] = line[:place] + random.choice(("", "x", line[place] * 2, line[place].upper())) + line[place + 1 :]
    return "\n".join(lines)


def _lines(text: str, random: Random, separator: str) -> str:
    """Remove, repeat, exchange or cut off lines."""
    lines = text.split("\n")
    first, second = random.randrange(len(lines)), random.randrange(len(lines))
    match random.randrange(4):
        case 0:
            del lines[first]
        case 1:
            lines.insert(second, lines[first])
        case 2:
            lines[first], lines[second] = lines[second], lines[first]
        case _:
            lines = lines[: first + 1]
    return "\n".join(lines) if separator else text


_OF_BYTES: tuple[Callable[[bytes, Random], bytes], ...] = (_cut, _flip, _remove, _repeat, _insert, _zero)
_OF_TEXT: tuple[Callable[[str, Random, str], str], ...] = (
    _replace_cell,
    _replace_column,
    _remove_column,
    _repeat_column,
    _misspell,
    _lines,
)
