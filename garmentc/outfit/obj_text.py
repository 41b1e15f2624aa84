"""The bytes of an OBJ or MTL file, made uniform without moving a single one.

Line ends become LF, other white space a blank, continued lines one line. Every replacement keeps its length, so an
offset in the uniform text is an offset in the file, and any error can name its line.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from garmentc.errors import GarmentcError

_BLANKS = bytes.maketrans(b"\t\v\f", b"   ")
_UTF8_BOM = b"\xef\xbb\xbf"
_WIDE_BOMS = (b"\xff\xfe", b"\xfe\xff", b"\x00\x00\xfe\xff")
_CONTINUED = re.compile(rb"\\ *\n")
_MAGIC = (
    (b"\x1f\x8b", "gzip file"),
    (b"PK\x03\x04", "zip file"),
    (b"glTF", "glTF file"),
    (b"Kaydara FBX", "FBX file"),
    (b"BLENDER", "Blender file"),
    (b"ply\n", "PLY file"),
    (b"ply\r", "PLY file"),
)


@dataclass(frozen=True)
class ObjText:
    """`data` is the uniform text, `physical` the same before continued lines were joined; both end with a newline."""

    path: Path
    data: bytes
    physical: bytes

    def line_of(self, offset: int) -> int:
        """The 1-based line of the file that holds byte `offset`."""
        return self.physical.count(b"\n", 0, offset) + 1

    def error(self, message: str, offset: int) -> GarmentcError:
        """The error `message`, placed at the line of `offset`."""
        return GarmentcError(message, self.path, self.line_of(offset))


def read_text(path: Path) -> ObjText:
    """Read a text file whole; raises GarmentcError where it is missing, unreadable, empty, binary or UTF-16."""
    if path.is_dir():
        raise GarmentcError("is a folder; name the file in it", path)
    if path.exists() and not path.is_file():
        raise GarmentcError("is not a regular file; copy it to one", path)
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise GarmentcError("no such file; check the path", path) from None
    except (OSError, ValueError) as error:
        raise GarmentcError(f"cannot be read: {getattr(error, 'strerror', None) or error}", path) from None
    return uniform_text(path, data)


def uniform_text(path: Path, data: bytes) -> ObjText:
    """Make the bytes of `path` uniform; raises GarmentcError where they are no text."""
    _refuse_binary(path, data)
    if data.startswith(_UTF8_BOM):
        data = b"   " + data[3:]
    if b"\r" in data:
        data = data.replace(b"\r\n", b" \n").replace(b"\r", b"\n")
    if not data.endswith(b"\n"):
        data += b"\n"
    if any(blank in data for blank in (b"\t", b"\v", b"\f")):
        data = data.translate(_BLANKS)
    return ObjText(path, _join_continued(data), data)


def decode(raw: bytes) -> str:
    """A name in UTF-8 or, failing that, Latin-1; without surrounding blanks."""
    try:
        return raw.decode("utf-8").strip()
    except UnicodeDecodeError:
        return raw.decode("latin-1").strip()


def _join_continued(data: bytes) -> bytes:
    """Turn a backslash at a line's end, and the line end, into blanks; a comment is never continued."""
    joined = bytearray()
    done = 0
    for found in _CONTINUED.finditer(data):
        line = data.rfind(b"\n", 0, found.start()) + 1
        if b"#" not in data[line : found.start()]:
            joined += data[done : found.start()] + b" " * (found.end() - found.start())
            done = found.end()
    if not done:
        return data
    joined += data[done:]
    return bytes(joined) if joined.endswith(b"\n") else bytes(joined) + b"\n"


def _refuse_binary(path: Path, data: bytes) -> None:
    if not data:
        raise GarmentcError("is empty; export it again", path)
    if data.startswith(_WIDE_BOMS):
        raise GarmentcError("is UTF-16 or UTF-32 text; save it as UTF-8", path)
    for magic, kind in _MAGIC:
        if data.startswith(magic):
            raise GarmentcError(f"looks binary (a {kind}); give a text file", path)
    if b"\0" in data:
        raise GarmentcError("looks binary; give a text file (UTF-8)", path)
