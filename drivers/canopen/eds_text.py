"""The text of an EDS or DCF file (CiA 306-1): its encoding, its sections and entries, and its numbers.

Names of sections and entries are the same in capital and small letters. Comments begin with `;`, at the begin of a line
or after a space.
"""

from __future__ import annotations

import re
import struct
from codecs import BOM_UTF16_BE, BOM_UTF16_LE

_COMMENT = re.compile(r"(^|\s);.*")
_END_OF_FILE = "\x1a"  # of MS-DOS
_INTEGER = re.compile(r"([+-]?)(0x[0-9a-f]+|\d+)(?:\.0*)?", re.IGNORECASE)


class EdsError(ValueError):
    """A text that is no EDS, or a value in it that cannot be; the message names section and entry, or the line."""


class Section(dict[str, str]):
    """One section: values by the names of their entries, in small letters. `name` is as the file has it."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name

    def bad(self, entry: str, reason: str) -> EdsError:
        """Return the error of one entry."""
        given = self.get(entry.lower())
        shown = f"{entry} = {given}" if given is not None else entry
        return EdsError(f"[{self.name}] {shown}: {reason}")

    def text(self, entry: str) -> str:
        """Return an entry's value; empty where there is none."""
        return self.get(entry.lower(), "")

    def number(self, entry: str, default: int | None = None) -> int:
        """Return an entry as a number; `default` where it is absent or empty.

        Raises
        ------
        EdsError
            It is no number; or absent, without a default.
        """
        given = self.text(entry)
        if not given:
            if default is None:
                raise self.bad(entry, "is missing")
            return default
        found = integer(given)
        if found is None:
            raise self.bad(entry, "is no number")
        return found


def decoded(data: bytes) -> str:
    """Return the text of a file: UTF-16 where it begins so, otherwise UTF-8 with what is not of it replaced."""
    utf16 = data.startswith((BOM_UTF16_LE, BOM_UTF16_BE))
    return data.decode("utf-16" if utf16 else "utf-8-sig", errors="replace")


def sections(text: str) -> dict[str, Section]:
    """Return the sections of a text, by their names in small letters.

    Raises
    ------
    EdsError
        A line is neither a section's name nor an entry, or a name comes twice.
    """
    found: dict[str, Section] = {}
    section: Section | None = None
    for number, raw in enumerate(text.splitlines(), start=1):
        line = _COMMENT.sub("", raw).strip().strip(_END_OF_FILE)
        if not line or line.startswith("#"):
            continue
        if line.startswith("[") and line.endswith("]"):
            section = Section(line[1:-1].strip())
            if section.name.lower() in found:
                raise EdsError(f"line {number}: the section [{section.name}] is there twice")
            found[section.name.lower()] = section
            continue
        entry, equals, value = line.partition("=")
        if section is None or not equals:
            where = "before the first section" if section is None else f"in [{section.name}]"
            raise EdsError(f"line {number}, {where}: neither [section] nor entry = value: {_printable(line)}")
        name = entry.strip().lower()
        if section.get(name, value.strip()) != value.strip():
            raise EdsError(f"line {number}, in [{section.name}]: {entry.strip()} is there twice, with two values")
        section[name] = value.strip()
    return found


def integer(text: str) -> int | None:
    """Return a number of CiA 306, decimal, hexadecimal (0x…) or octal (0…); None for another text.

    Decimals that are a whole number are taken: some makers write 5000.0.
    """
    match = _INTEGER.fullmatch(text.replace(" ", ""))
    if match is None or ("." in text and "x" in text.lower()):
        return None
    digits = match[2].lower()
    octal = len(digits) > 1 and digits.isdigit() and digits.startswith("0") and "." not in text
    try:
        value = int(digits, 8 if octal else 0)
    except ValueError:  # an 8 or 9 in an octal number
        return None
    return -value if match[1] == "-" else value


def expression(text: str, node_id: int) -> int | None:
    """Return a number, `$NODEID`, or a sum of the two; None for anything else."""
    parts = [part for part in text.replace(" ", "").upper().split("+") if part]
    relative = parts.count("$NODEID")
    if not relative:
        return integer(text)
    offsets = [integer(part) for part in parts if part != "$NODEID"]
    if relative > 1 or len(offsets) > 1 or None in offsets:
        return None
    return node_id + sum(offset or 0 for offset in offsets)


def fitted(value: int, bits: int, *, signed: bool) -> int | None:
    """Return a value as its type has it, in two's complement: 0xFFFF as INTEGER16 is −1. None: it has too many bits."""
    if not -(1 << bits - 1) <= value < 1 << bits:
        return None
    raw = value & (1 << bits) - 1
    return raw - (1 << bits) if signed and raw >> bits - 1 else raw


def real(text: str, bits: int) -> float | None:
    """Return a floating-point number, also of bits in hexadecimal; None for another text, or one that is too large."""
    code = {32: ("<I", "<f"), 64: ("<Q", "<d")}[bits]
    if text.lower().startswith("0x"):
        raw = integer(text)
        if raw is None or raw >> bits:
            return None
        found: float = struct.unpack(code[1], struct.pack(code[0], raw))[0]
        return found
    try:
        struct.pack(code[1], found := float(text))
    except (ValueError, OverflowError):
        return None
    return found


def _printable(line: str) -> str:
    return "".join(letter if letter.isprintable() else "?" for letter in line[:60])
