"""No stored message is lost except by the size limit, whatever kills the process."""

import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regolithd.daemon.publish.segment_format import pack
from regolithd.daemon.publish.spool import RECENT, Spool, SpoolError, SpoolUnusableError


def payload(index: int) -> bytes:
    """Return a payload that holds its index, and whose size differs from the next."""
    return b"%d " % index + b"x" * (index % 97)


def fill(spool: Spool, count: int) -> None:
    """Store `count` messages, each with its index."""
    for _ in range(count):
        index = spool.next
        assert spool.append("snapshot", payload(index)) == index


def everything(spool: Spool) -> list[int]:
    """Return the indices of all waiting messages, in order; each must hold what was stored."""
    found: list[int] = []
    position = spool.first
    while records := spool.read(position):
        for record in records:
            assert record.payload == payload(record.index)
            found.append(record.index)
        position = found[-1] + 1
    return found


def test_what_was_stored_comes_back_in_order(tmp_path: Path) -> None:
    """They come back across several files, from memory and from disk."""
    spool = Spool(tmp_path, 1_000_000, segment_bytes=2000)
    fill(spool, RECENT + 300)
    assert everything(spool) == list(range(RECENT + 300))
    assert len(list(tmp_path.glob("*.segment"))) > 10


def test_the_next_process_finds_what_was_not_acknowledged(tmp_path: Path) -> None:
    """It finds every message that was not acknowledged, and no other."""
    spool = Spool(tmp_path, 1_000_000, segment_bytes=2000)
    fill(spool, 300)
    spool.acknowledge(120, 120)
    spool.close()
    again = Spool(tmp_path, 1_000_000)
    assert (again.first, again.next, again.queued) == (120, 300, 180)
    assert everything(again) == list(range(120, 300))
    assert all(record.stored_ns is None for record in again.read(120))


def test_indices_go_on_after_everything_was_acknowledged(tmp_path: Path) -> None:
    """An index is never used twice, or an old cursor would hide a new message."""
    spool = Spool(tmp_path, 1_000_000, segment_bytes=500)
    fill(spool, 50)
    spool.acknowledge(50, 50)
    spool.close()
    again = Spool(tmp_path, 1_000_000)
    assert (again.next, again.queued) == (50, 0)
    fill(again, 3)
    assert everything(again) == [50, 51, 52]


def test_files_go_as_soon_as_all_in_them_is_acknowledged(tmp_path: Path) -> None:
    """One file is left when everything is acknowledged."""
    spool = Spool(tmp_path, 1_000_000, segment_bytes=500)
    for index in range(200):
        fill(spool, 1)
        spool.acknowledge(index + 1, 1)
    assert len(list(tmp_path.glob("*.segment"))) == 1
    assert spool.size_bytes < 600


@pytest.mark.parametrize("cut", [1, 5, 9, 10, 11, 40])
def test_a_torn_tail_costs_its_own_record_alone(tmp_path: Path, cut: int) -> None:
    """A record that was written in part is lost, and no other."""
    spool = Spool(tmp_path, 1_000_000)
    fill(spool, 41)
    spool.close()
    (path,) = tmp_path.glob("*.segment")
    os.truncate(path, path.stat().st_size - cut)
    again = Spool(tmp_path, 1_000_000)
    assert again.counters.torn == 1
    assert everything(again) == list(range(40))
    fill(again, 2)
    assert everything(again) == list(range(42))


def test_zeros_at_the_end_are_no_records(tmp_path: Path) -> None:
    """Some file systems leave zeros after a power cut."""
    spool = Spool(tmp_path, 1_000_000)
    fill(spool, 10)
    spool.close()
    (path,) = tmp_path.glob("*.segment")
    with path.open("ab") as file:
        file.write(bytes(4096))
    assert everything(Spool(tmp_path, 1_000_000)) == list(range(10))


@pytest.mark.parametrize("which", [0, 1, -1], ids=["first", "middle", "newest"])
def test_a_corrupt_record_costs_itself_alone_and_is_counted(tmp_path: Path, which: int) -> None:
    """All other messages of the file are delivered, and the lost one is counted as damaged and as dropped."""
    spool = Spool(tmp_path, 1_000_000, segment_bytes=1000)
    fill(spool, 100)
    spool.close()
    path = sorted(tmp_path.glob("*.segment"))[which]
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    again = Spool(tmp_path, 1_000_000)
    found = everything(again)
    assert len(set(range(100)) - set(found)) == 1
    assert again.counters.damaged == 1
    again.acknowledge(100, len(found))
    assert again.counters.dropped == again.counters.damaged == 1


def test_a_damaged_last_record_is_not_forgotten(tmp_path: Path) -> None:
    """Its index is not used again, so that it is counted as dropped when the next message is acknowledged."""
    spool = Spool(tmp_path, 1_000_000)
    fill(spool, 10)
    spool.close()
    (path,) = tmp_path.glob("*.segment")
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    again = Spool(tmp_path, 1_000_000)
    fill(again, 1)
    assert everything(again) == [*range(9), 10]
    again.acknowledge(11, 10)
    assert (again.counters.damaged, again.counters.dropped) == (1, 1)


def test_a_newest_file_that_cannot_be_read_is_set_aside_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may belong to another user; the messages before it and those that follow are delivered."""
    spool = Spool(tmp_path, 1_000_000, segment_bytes=1000)
    fill(spool, 100)
    spool.close()
    last = max(tmp_path.glob("*.segment"))
    read_bytes = Path.read_bytes

    def refuse(path: Path) -> bytes:
        if path == last:
            raise PermissionError(13, "Permission denied")
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", refuse)
    again = Spool(tmp_path, 1_000_000)
    assert (again.counters.damaged, again.counters.dropped) == (1, 1)
    assert last.with_suffix(".segment.unreadable").exists()
    fill(again, 3)
    assert everything(again) == list(range(int(last.stem) + 3))
    assert again.counters.unstored == 0


def test_a_corrupt_cursor_counts_nothing_as_lost(tmp_path: Path) -> None:
    """Messages that were acknowledged and deleted long ago are not counted as dropped."""
    spool = Spool(tmp_path, 1_000_000, segment_bytes=500)
    fill(spool, 50)
    spool.acknowledge(40, 40)
    spool.close()
    (tmp_path / "acknowledged").write_bytes(b"rotten")
    again = Spool(tmp_path, 1_000_000)
    left = everything(again)
    assert again.queued == len(left)
    again.acknowledge(50, len(left))
    assert again.counters.dropped == 0


@pytest.mark.parametrize("rotten", [b"", b"short", bytes(12), b"\xff" * 12])
def test_a_corrupt_cursor_sends_again_rather_than_loses(tmp_path: Path, rotten: bytes) -> None:
    """With an invalid cursor every stored message is sent again."""
    spool = Spool(tmp_path, 1_000_000)
    fill(spool, 10)
    spool.acknowledge(5, 5)
    spool.close()
    (tmp_path / "acknowledged").write_bytes(rotten)
    assert everything(Spool(tmp_path, 1_000_000)) == list(range(10))


def test_full_means_that_the_oldest_go_and_are_counted(tmp_path: Path) -> None:
    """The files never exceed the limit."""
    spool = Spool(tmp_path, 20_000, segment_bytes=2000)
    for _ in range(1000):
        fill(spool, 1)
        assert sum(path.stat().st_size for path in tmp_path.glob("*.segment")) <= 20_000
    left = everything(spool)
    assert left == list(range(left[0], 1000))
    assert spool.counters.dropped == left[0]
    assert spool.queued == len(left)


def test_a_full_disk_keeps_messages_in_memory_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A message that the disk refuses is kept in memory and counted; those before and after are on disk."""
    spool = Spool(tmp_path, 1_000_000)
    fill(spool, 5)
    write = os.write
    monkeypatch.setattr(os, "write", lambda file, data: write(file, data[: len(data) // 2]))
    fill(spool, 3)
    monkeypatch.undo()
    fill(spool, 4)
    assert spool.counters.unstored == 3
    assert everything(spool) == list(range(12))
    spool.close()
    assert everything(Spool(tmp_path, 1_000_000)) == [0, 1, 2, 3, 4, 8, 9, 10, 11]


@pytest.mark.parametrize("call", ["write", "pwrite", "ftruncate", "unlink", "open"])
def test_a_failing_disk_raises_nothing_once_the_store_is_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    """Storing, reading and acknowledging raise nothing on a disk that became read-only."""
    spool = Spool(tmp_path, 20_000, segment_bytes=2000)
    fill(spool, 30)

    def fail(*_: object, **__: object) -> None:
        raise OSError(30, "Read-only file system")

    with monkeypatch.context() as patch:
        patch.setattr(os, call, fail)
        fill(spool, 100)
        spool.acknowledge(60, 60)
        fill(spool, 400)
        assert everything(spool)[-1] == 529
    spool.acknowledge(500, 440)
    fill(spool, 3)
    assert everything(spool) == list(range(500, 533))


def test_files_that_cannot_be_read_are_skipped_and_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Messages that are still in memory are read."""
    spool = Spool(tmp_path, 1_000_000, segment_bytes=2000)
    fill(spool, RECENT + 100)

    def fail(*_: object) -> bytes:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(Path, "read_bytes", fail)
    assert everything(spool) == list(range(100, RECENT + 100))
    spool.acknowledge(RECENT + 100, RECENT)
    assert spool.counters.dropped == 100


def test_a_second_process_is_refused(tmp_path: Path) -> None:
    """Two processes would acknowledge each other's messages."""
    spool = Spool(tmp_path, 1_000_000)
    with pytest.raises(SpoolError, match="another regolithd uses it"):
        Spool(tmp_path, 1_000_000)
    spool.close()
    Spool(tmp_path, 1_000_000).close()


def test_a_folder_that_cannot_be_made_is_reported_with_the_key_to_correct(tmp_path: Path) -> None:
    """The error names the key of the folder, for any user."""
    (tmp_path / "file").touch()
    with pytest.raises(SpoolError, match=r"\[mqtt\] spool_directory"):
        Spool(tmp_path / "file" / "spool", 1_000_000)


@pytest.mark.parametrize("name", ["lock", "acknowledged"])
def test_a_store_that_cannot_be_opened_says_which_file(tmp_path: Path, name: str) -> None:
    """It is no other error, and the folder is not left locked."""
    (tmp_path / name).mkdir()
    with pytest.raises(SpoolUnusableError, match=name):
        Spool(tmp_path, 1_000_000)
    (tmp_path / name).rmdir()
    Spool(tmp_path, 1_000_000).close()


def test_without_a_disk_the_newest_messages_are_kept_in_memory(tmp_path: Path) -> None:
    """They can be read, acknowledged and counted as with a disk, and nothing is written."""
    spool = Spool.memory_only(tmp_path, "no permission")
    fill(spool, RECENT + 10)
    spool.begin_sync()()
    assert everything(spool) == list(range(10, RECENT + 10))
    spool.acknowledge(RECENT + 10, RECENT)
    assert (spool.queued, spool.counters.unstored, spool.counters.dropped) == (0, RECENT + 10, 10)
    spool.close()
    assert list(tmp_path.iterdir()) == []


def test_syncing_survives_what_happens_meanwhile(tmp_path: Path) -> None:
    """Files may be acknowledged and deleted during a sync."""
    spool = Spool(tmp_path, 1_000_000, segment_bytes=500)
    fill(spool, 50)
    sync = spool.begin_sync()
    spool.acknowledge(50, 50)
    fill(spool, 20)
    sync()
    assert everything(spool) == list(range(50, 70))
    spool.begin_sync()()
    fill(spool, 20)
    assert everything(spool) == list(range(50, 90))


steps = st.lists(
    st.one_of(
        st.tuples(st.just("store"), st.integers(1, 60)),
        st.tuples(st.just("acknowledge"), st.integers(1, 60)),
        st.tuples(st.just("kill"), st.integers(0, 19)),
        st.tuples(st.just("sync"), st.just(0)),
    ),
    max_size=25,
)


@settings(max_examples=60, deadline=None)
@given(steps)
def test_any_history_of_storing_acknowledging_and_killing_loses_nothing(
    tmp_path_factory: pytest.TempPathFactory, history: list[tuple[str, int]]
) -> None:
    """A kill may leave half a record behind."""
    folder = tmp_path_factory.mktemp("spool")
    spool = Spool(folder, 10_000_000, segment_bytes=700)
    first = end = 0
    for step, number in history:
        if step == "store":
            fill(spool, number)
            end += number
        elif step == "acknowledge":
            first = min(end, first + number)
            spool.acknowledge(first, number)
        elif step == "sync":
            spool.begin_sync()()
        else:
            spool.close()
            if files := sorted(folder.glob("*.segment")):
                with files[-1].open("ab") as file:
                    file.write(pack(end, "snapshot", payload(end))[:number])
            spool = Spool(folder, 10_000_000, segment_bytes=700)
        assert (spool.first, spool.next) == (first, end)
    assert everything(spool) == list(range(first, end))
    assert spool.counters.dropped == 0
    spool.close()
