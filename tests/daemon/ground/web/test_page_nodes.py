"""The page's table of nodes, computed by the page's own code in Node.js."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

import regolithd.daemon.ground

PAGE = Path(regolithd.daemon.ground.__path__[0]) / "page"


@pytest.mark.skipif(shutil.which("node") is None, reason="Node.js is not installed: apt-get install nodejs")
def test_a_node_of_an_earlier_session_is_not_in_the_table(tmp_path: Path) -> None:
    """The broker retains the message of a node that was taken out of the configuration."""
    for name in ("lists.js", "dom.js", "format.js"):
        shutil.copy(PAGE / name, tmp_path)
    (tmp_path / "package.json").write_text('{"type": "module"}')
    old, new = "20261129T143931Z-4b1c", "20261129T150000Z-07aa"
    latest = {
        "state": {"session": new},
        "node/21": {"node_id": 21, "session": old},
        "node/11": {"node_id": 11, "session": new},
        "node/2": {"node_id": 2, "session": new},
        "snapshot": {"session": new},
    }
    script = (
        'import { nodesOf } from "./lists.js";'
        f"const latest = {json.dumps(latest)};"
        "const ids = (of) => nodesOf(of).map((node) => node.node_id);"
        "console.log(JSON.stringify([ids(latest), ids({ ...latest, state: undefined })]));"
    )
    command = ["node", "--input-type=module", "--eval", script]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert json.loads(done.stdout) == [[2, 11], [2, 11, 21]]
