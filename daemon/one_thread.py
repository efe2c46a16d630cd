"""One thread for NumPy's linear algebra: a comparison's matrices are small, and several threads wait for each other.

With two, a comparison of 54 000 rows takes as long, and a third more processor time.
"""

from __future__ import annotations

import os

THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Environment variables that NumPy's libraries read when they are loaded."""


def compute_with_one_thread() -> None:
    """Ask for one thread, unless the user has asked for another number; before NumPy is imported."""
    for name in THREADS:
        os.environ.setdefault(name, "1")
