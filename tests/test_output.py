"""Output files are whole or untouched, whatever happens while they are written."""

from __future__ import annotations

import resource
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from garmentc.errors import GarmentcError
from garmentc.output import check_outputs, written_whole


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_replaces_the_file_at_the_end_of_the_block(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with written_whole(path) as file:
        file.write(b"new")
        file.flush()
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"
    assert names(tmp_path) == ["a.bin"]


def test_permissions_are_those_of_an_ordinary_new_file(tmp_path: Path) -> None:
    (tmp_path / "ordinary").touch()
    with written_whole(tmp_path / "a.bin"):
        pass
    assert stat.S_IMODE((tmp_path / "a.bin").stat().st_mode) == stat.S_IMODE((tmp_path / "ordinary").stat().st_mode)


def test_follows_a_symbolic_link(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("real")
    with written_whole(tmp_path / "link") as file:
        file.write(b"new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"new"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, MemoryError])
def test_an_error_in_the_block_leaves_the_former_file(tmp_path: Path, error: type[BaseException]) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with pytest.raises(error), written_whole(path) as file:
        file.write(b"half")
        raise error
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["a.bin"]


def test_a_full_disk_leaves_the_former_file(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with largest_file(1000), pytest.raises(GarmentcError, match=r"a\.bin: cannot be written: .*allowed size"):
        with written_whole(path) as file:
            file.write(bytes(100_000))
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["a.bin"]


def test_a_device_is_written_in_place() -> None:
    with pytest.raises(GarmentcError, match="disk is full"), written_whole("/dev/full") as file:
        file.write(bytes(100_000))
    with written_whole("/dev/null") as file:
        file.write(b"gone")
    assert Path("/dev/null").is_char_device()


def test_killed_while_writing_leaves_the_former_file(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    script = f"""
import os, signal
from garmentc.output import written_whole
with written_whole({str(path)!r}) as file:
    file.write(bytes(100_000))
    file.flush()
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == -signal.SIGKILL
    assert path.read_bytes() == b"old"


@pytest.mark.parametrize(
    ("name", "remedy"),
    [("missing/a.bin", "does not exist"), ("file/a.bin", "its folder is a file"), ("folder", "it is a folder")],
)
def test_a_place_that_cannot_be_written_is_refused_with_a_remedy(tmp_path: Path, name: str, remedy: str) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(GarmentcError, match=remedy):
        check_outputs([tmp_path / name])
    with pytest.raises(GarmentcError, match=remedy), written_whole(tmp_path / name):
        pass


def test_a_file_that_the_block_could_not_read_is_not_blamed_on_the_output(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), written_whole(tmp_path / "a.bin"):
        (tmp_path / "elsewhere" / "input").open()
    with pytest.raises(FileNotFoundError), written_whole(tmp_path / "a.bin"):
        (tmp_path / "input").open()


def test_checking_leaves_nothing_behind(tmp_path: Path) -> None:
    check_outputs([tmp_path / "a.bin", None])
    assert names(tmp_path) == []


def test_an_output_is_no_input_and_no_other_output(tmp_path: Path) -> None:
    (tmp_path / "input").touch()
    (tmp_path / "link").symlink_to("input")
    check_outputs(["/dev/null", tmp_path / "a", tmp_path / "b", "/dev/null"], inputs=[tmp_path / "input", None])
    for outputs in ([tmp_path / "link"], [tmp_path / "." / "input"]):
        with pytest.raises(GarmentcError, match="is read from and cannot be written too"):
            check_outputs(outputs, inputs=[tmp_path / "input"])
    with pytest.raises(GarmentcError, match="is written already"):
        check_outputs([tmp_path / "a", tmp_path / "a"])
