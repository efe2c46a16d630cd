"""The SHA-256 of a model file, as its last metadata entry: a damaged file is told from a whole one.

An ONNX file is a protocol-buffer message; an entry of `metadata_props` (field 14) may be appended to its bytes. So the
digest is of all bytes before the entry, and is checked without parsing the model. Files without one, as version 0.1 and
other programs write them, are accepted.
"""

from __future__ import annotations

import hashlib

_KEY = b"regolithd.sha256"
_HEX = 64  # length of the digest
_INNER = b"\x0a" + bytes([len(_KEY)]) + _KEY + b"\x12" + bytes([_HEX])  # key and value: fields 1 and 2, of bytes
_HEAD = b"\x72" + bytes([len(_INNER) + _HEX]) + _INNER  # field 14, of bytes


def with_digest(model: bytes) -> bytes:
    """Return the bytes of a model with the digest appended."""
    return model + _HEAD + hashlib.sha256(model).hexdigest().encode()


def is_damaged(data: bytes) -> bool:
    """Return whether a model file has a digest that its content does not match."""
    content, entry = data[: -len(_HEAD) - _HEX], data[-len(_HEAD) - _HEX :]
    if entry.startswith(_HEAD):
        return hashlib.sha256(content).hexdigest().encode() != entry[-_HEX:]
    return _KEY in data  # something was appended or cut off
