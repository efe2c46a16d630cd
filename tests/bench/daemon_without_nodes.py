"""A daemon on an in-process bus without any node, as a process that tests can kill.

    python daemon_without_nodes.py CONFIG

Every SYNC gives a snapshot in which nothing was measured.
"""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

from can_pair import run_daemon

asyncio.run(run_daemon(Path(sys.argv[1])))
