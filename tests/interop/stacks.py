"""Builds the slaves of other CANopen stacks from sources that the caller points to, and runs them as processes."""

from __future__ import annotations

import shlex
import shutil
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path

from regolithd.drivers.devices.eds import EDS_FOLDER

HERE = Path(__file__).parent
STRANGERS = HERE.parent / "bench" / "strangers.py"
IDENTITY = "o1018_1=0xFB:o1018_2=0x62100000:o1018_3=0x21100000"
SHEETS = {"motor": EDS_FOLDER / "motor.eds", "load": EDS_FOLDER / "load-cell.eds"}
LINUX_SOURCES = "git clone --recurse-submodules https://github.com/CANopenNode/CANopenLinux"
LELY_SOURCES = "git clone https://github.com/lely-industries/lely-core"
_LELY_OPTIONS = "-DLELY_NO_CXX=1 -DLELY_NO_CO_WTM=1 -DLELY_NO_CO_GW=1 -DLELY_NO_CO_GW_TXT=1 -DLELY_NO_CO_LSS=1"
_CANOPENNODE = "301/*.c 303/CO_LEDs.c 304/*.c 305/*.c 309/*.c storage/CO_storage.c extra/CO_trace.c CANopen.c"
_CANOPENLINUX = "CO_driver.c CO_error.c CO_epoll_interface.c CO_storageLinux.c CO_main_basic.c"


@dataclass
class Slave:
    """One slave process; CANopenNode's ends at an NMT reset, so that one that ends by itself is started again."""

    command: list[str]
    pipe: bool = False
    process: subprocess.Popen[str] = field(init=False)
    wanted: bool = True

    def __post_init__(self) -> None:
        """Start it."""
        self._start()
        threading.Thread(target=self._keep, daemon=True).start()

    def _start(self) -> None:
        stdin = subprocess.PIPE if self.pipe else subprocess.DEVNULL
        self.process = subprocess.Popen(
            self.command, stdin=stdin, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True
        )

    def _keep(self) -> None:
        while True:
            self.process.wait()
            if not self.wanted:
                return
            self._start()

    def fail(self) -> None:
        """Make the drive fail with overcurrent."""
        if self.pipe:
            assert self.process.stdin is not None
            node_id = self.command[-1].partition(":")[0]
            self.process.stdin.write(f"fault {node_id}\n")
            self.process.stdin.flush()
        else:
            self.process.send_signal(signal.SIGUSR1)

    def kill(self) -> None:
        """End it at once."""
        self.wanted = False
        self.process.kill()
        self.process.wait()


@dataclass(frozen=True)
class Stack:
    """A stack: its name with version, and the command of one slave."""

    name: str
    commands: dict[str, str]
    pipe: bool = False

    def start(self, channel: str, node_id: int, kind: str) -> Slave:
        """Start one slave."""
        line = self.commands[kind].format(channel=channel, node_id=node_id, eds=SHEETS[kind])
        return Slave(shlex.split(line), self.pipe)


def python_canopen() -> Stack:
    """Return python-canopen's LocalNode, from its published package."""
    import canopen  # noqa: PLC0415

    line = f"{sys.executable} {STRANGERS} socketcan {{channel}} {{node_id}}:"
    kinds = {kind: f"{line}{kind}:{{eds}}" + (f":{IDENTITY}" if kind == "motor" else "") for kind in SHEETS}
    return Stack(f"python-canopen {canopen.__version__}", kinds, pipe=True)


def canopennode(linux: Path, build: Path) -> Stack:
    """Build CANopenNode's slaves; `linux`: CANopenLinux, with CANopenNode in its folder of that name."""
    core = linux / "CANopenNode"
    need(linux / "CO_driver.c", LINUX_SOURCES)
    need(core / "CANopen.c", f"git -C {linux} submodule update --init")
    sources = [linux / name for name in _CANOPENLINUX.split()]
    sources += [path for pattern in _CANOPENNODE.split() for path in sorted(core.glob(pattern))]
    build.mkdir(parents=True, exist_ok=True)
    commands = {}
    for kind, sheet in SHEETS.items():
        own = build / kind
        run(sys.executable, HERE / "canopennode/object_dictionary.py", core / "example", sheet, own)
        program = build / f"canopennode-{kind}"
        options = ["-DCO_SINGLE_THREAD", "-DCO_USE_APPLICATION", *(["-DMOTOR"] if kind == "motor" else [])]
        options.append("-DNMT_CONTROL=(CO_NMT_ERR_ON_ERR_REG|CO_ERR_REG_COMMUNICATION)")
        folders = [f"-I{folder}" for folder in (linux, core, own)]
        files = [*sources, own / "OD.c", HERE / "canopennode/application.c"]
        run("gcc", "-O1", "-w", *options, *folders, *files, "-o", program, "-lm")
        commands[kind] = f"{program} {{channel}} -i {{node_id}} -s {own}/storage-{{node_id}}-"
    return Stack("CANopenNode", commands)


def lely(source: Path, build: Path) -> Stack:
    """Build Lely core's slave: its C sources for CAN and CANopen, without the C++ parts."""
    need(source / "include/lely/co/nmt.h", LELY_SOURCES)
    build.mkdir(parents=True, exist_ok=True)
    files = [path for part in ("util", "can", "co") for path in sorted((source / "src" / part).glob("*.c"))]
    folders = [f"-I{source / folder}" for folder in ("include", "src", "src/util", "src/can", "src/co")]
    program = build / "lely-slave"
    run(
        "gcc",
        "-O1",
        "-w",
        "-D_GNU_SOURCE",
        *_LELY_OPTIONS.split(),
        *folders,
        *files,
        HERE / "lely/slave.c",
        "-o",
        program,
        "-lm",
        "-lpthread",
    )
    return Stack("Lely core", {kind: f"{program} {{channel}} {{node_id}} {{eds}} {kind}" for kind in SHEETS})


def need(file: Path, cure: str) -> None:
    """End with one sentence where a file of the sources, or the compiler, is not there."""
    if not file.exists():
        sys.exit(f"{file}: no such file. Get the sources, and give their folder: {cure}")
    if shutil.which("gcc") is None:
        sys.exit("gcc: not found. Debian and Ubuntu: sudo apt-get install gcc libc6-dev")


def run(*command: object) -> None:
    """Run a build command; raise with its output where it fails."""
    done = subprocess.run([str(each) for each in command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{command[0]} failed:\n{done.stderr[-2000:]}")
