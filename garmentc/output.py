"""Output files are written whole or not at all."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from garmentc.errors import GarmentcError

_REMEDIES = {
    errno.ENOENT: "its folder does not exist; create it first or choose another place",
    errno.ENOTDIR: "its folder is a file; choose another place",
    errno.EISDIR: "it is a folder; name a file in it",
    errno.EACCES: "writing there is not allowed; change the permissions or choose another place",
    errno.EPERM: "writing there is not allowed; change the permissions or choose another place",
    errno.EROFS: "that place is read-only; choose another one",
    errno.ENOSPC: "the disk is full; free some space or choose another place",
    errno.EDQUOT: "the disk quota is used up; free some space or choose another place",
    errno.EFBIG: "the file grew beyond the allowed size; raise the limit or choose another place",
}


def cannot_write(path: str | os.PathLike[str], error: OSError) -> GarmentcError:
    """What the user is told when writing `path` failed with `error`."""
    remedy = _REMEDIES.get(error.errno or 0, error.strerror or str(error))
    return GarmentcError(f"cannot be written: {remedy}", path)


def is_special(target: Path) -> bool:
    """True for a device or a pipe, which must be written in place, never replaced."""
    return target.exists() and not target.is_file() and not target.is_dir()


def _temporary(target: Path) -> Path:
    """The file beside `target` that collects its bytes."""
    return target.with_name(f".{target.name}.{os.getpid()}.tmp")


def _refuse_folder(target: Path) -> None:
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))


def check_outputs(
    outputs: Iterable[str | os.PathLike[str] | None], inputs: Iterable[str | os.PathLike[str] | None] = ()
) -> None:
    """Raise GarmentcError now where one of `outputs` could not be written later, so that no long work is done in vain.

    Nor may an output be one of `inputs`, or two outputs the same file. None stands for no file.
    """
    taken = {os.path.realpath(path): "read from" for path in inputs if path is not None}
    for path in outputs:
        if path is None:
            continue
        target = os.path.realpath(path)
        if target in taken:
            raise GarmentcError(f"is {taken[target]} and cannot be written too; name another file", path)
        _check_writable(path)
        if not is_special(Path(target)):
            taken[target] = "written already"


def _check_writable(path: str | os.PathLike[str]) -> None:
    target = Path(os.path.realpath(path))
    if is_special(target):
        return
    temporary = _temporary(target)
    try:
        _refuse_folder(target)
        temporary.open("wb").close()
        temporary.unlink()
    except OSError as error:
        raise cannot_write(path, error) from error


@contextmanager
def written_whole(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """A binary file that takes the place of `path` when the block ends without an error, and not before.

    Whatever ends the block early (an exception, Ctrl-C, a kill), a former file at `path` stays as it was.
    Raises GarmentcError with a remedy where the file cannot be written.
    """
    target = Path(os.path.realpath(path))
    temporary = _temporary(target)
    try:
        if is_special(target):
            with target.open("wb") as file:
                yield file
            return
        _refuse_folder(target)
        try:
            with temporary.open("wb") as file:
                yield file
            temporary.replace(target)
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            raise
    except OSError as error:
        if error.filename is not None and Path(error.filename) not in (target, temporary):
            raise  # the block failed to read some other file: not ours to explain
        raise cannot_write(path, error) from error
