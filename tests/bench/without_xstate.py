"""`without_xstate.py COMMAND…`: run a command that cannot read or set the extended registers of a traced process.

User Mode Linux 6.1 has no room for those that a processor with AMX has, and the host's kernel refuses to set less than
all: the guest ends before its first process. Where they cannot be read at all, it uses x87 and SSE alone; what runs in
the guest must then not use AVX.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys

LOAD, EQUAL, RETURN = 0x20, 0x15, 0x06
"""Instructions of a classic Berkeley packet filter: load a word, jump if equal, return."""
X86_64, PTRACE = 0xC000003E, 101
GET_REGISTERS, SET_REGISTERS, EXTENDED_STATE = 0x4204, 0x4205, 0x202
ALLOW, INPUT_OUTPUT_ERROR = 0x7FFF0000, 0x00050005
NO_NEW_PRIVILEGES, SET_SECCOMP, BY_FILTER = 38, 22, 2
# Offsets in `struct seccomp_data`: number of the call, architecture, then arguments of 8 bytes.
PROGRAM = (
    (LOAD, 0, 0, 4),
    (EQUAL, 0, 7, X86_64),
    (LOAD, 0, 0, 0),
    (EQUAL, 0, 5, PTRACE),
    (LOAD, 0, 0, 16),
    (EQUAL, 1, 0, GET_REGISTERS),
    (EQUAL, 0, 2, SET_REGISTERS),
    (LOAD, 0, 0, 32),
    (EQUAL, 1, 0, EXTENDED_STATE),
    (RETURN, 0, 0, ALLOW),
    (RETURN, 0, 0, INPUT_OUTPUT_ERROR),
)


class Filter(ctypes.Structure):
    """`struct sock_fprog`."""

    _fields_ = (("length", ctypes.c_ushort), ("program", ctypes.c_void_p))


def main(command: list[str]) -> None:
    """Install the filter, which children inherit, and become the command."""
    program = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *each) for each in PROGRAM))
    installed = Filter(len(PROGRAM), ctypes.addressof(program))
    library = ctypes.CDLL(None, use_errno=True)
    for arguments in ((NO_NEW_PRIVILEGES, 1, 0, 0, 0), (SET_SECCOMP, BY_FILTER, ctypes.byref(installed), 0, 0)):
        if library.prctl(*arguments):
            raise OSError(ctypes.get_errno(), "the filter of system calls could not be installed")
    os.execvp(command[0], command)


if __name__ == "__main__":
    main(sys.argv[1:])
