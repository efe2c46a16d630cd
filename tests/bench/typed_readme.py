"""Types the commands of a README, in their order, into a shell in a fresh clone of this project.

    python tests/bench/typed_readme.py FOLDER

FOLDER must not exist. The commands are the lines of all ```sh blocks, except those with sudo, which change the
computer. A command that prints the address of a page is ended, by Ctrl-C, once the page answers. The first command that
fails ends the run with its status.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path
from threading import Thread
from typing import IO

ROOT = Path(__file__).parents[2]
PAGE = re.compile(r"https?://[^\s/]+:\d+/")
PAGE_TIMEOUT_S = 30
STOP_TIMEOUT_S = 60


def commands(readme: str) -> list[str]:
    """Return the commands of all sh blocks; a line that ends with a backslash goes on in the next."""
    blocks = re.findall(r"^```sh\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.strip() and not line.startswith(("#", "sudo "))]


def type_command(command: str, folder: Path) -> int:
    """Run a command and return its status; 0 for a page that answers and ends by Ctrl-C, 1 for one that does not.

    A job that a shell started in the background ignores Ctrl-C, and what it starts inherits that: `env` undoes it.
    """
    home = os.environ | {"HOME": str(folder.resolve() / "build/home")}  # what the ground stores stays in the folder
    process = subprocess.Popen(
        ["env", "--default-signal=INT", "bash", "-c", command],
        cwd=folder,
        env=home,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )
    assert process.stdout is not None
    found: list[str] = []
    reading = Thread(target=_copy, args=(process.stdout, found))
    reading.start()
    while process.poll() is None and not found:
        time.sleep(0.1)
    status = _visit(process, found[0]) if found else process.returncode
    reading.join()
    return status


def _copy(output: IO[bytes], found: list[str]) -> None:
    """Copy the output to the terminal, and note the first address of a page."""
    with output:
        for line in output:
            text = line.decode(errors="replace")
            sys.stdout.write(text)
            sys.stdout.flush()
            if match := PAGE.search(text):
                found.append(match[0])


def _visit(process: subprocess.Popen[bytes], address: str) -> int:
    """Wait until the page answers, press Ctrl-C, and return 0 if both succeed."""
    answers = _answers(address)
    print(f"typed_readme: {address} {'answers' if answers else 'does not answer'}", flush=True)
    os.killpg(process.pid, signal.SIGINT)
    try:
        ended = process.wait(STOP_TIMEOUT_S) in {0, 130, -signal.SIGINT}
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        ended = False
    return 0 if answers and ended else 1


def _answers(address: str) -> bool:
    for _ in range(PAGE_TIMEOUT_S):
        try:
            with urllib.request.urlopen(address, timeout=5) as answer:
                return b"regolithd" in answer.read()
        except (urllib.error.URLError, OSError):
            time.sleep(1)
    return False


def main(folder: Path, project: Path = ROOT) -> int:
    """Clone the project, type the commands of its README, and return the first status that is not 0."""
    subprocess.run(["git", "clone", "--quiet", project, folder], check=True)
    typed = commands((folder / "README.md").read_text(encoding="utf-8"))
    for command in typed:
        begun = time.monotonic()
        print(f"\ntyped_readme: $ {command}", flush=True)
        if status := type_command(command, folder):
            print(f"typed_readme: failed with status {status}: {command}", flush=True)
            return status
        print(f"typed_readme: done in {time.monotonic() - begun:.0f} s", flush=True)
    return 0 if typed else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
