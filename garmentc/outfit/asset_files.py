"""Finding the files that an OBJ or MTL file names, and refusing those outside the asset's folder.

Names come from untrusted text: a path that leaves the OBJ's folder (by "..", as an absolute path, drive, network share
or URL, or through a symbolic link) is an error unless the user has allowed it.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from garmentc.errors import Diagnostic, GarmentcError

_ELSEWHERE = re.compile(r"[a-zA-Z][a-zA-Z0-9+.-]*:|/|~/")
"""A drive letter, a URL scheme, an absolute path or a home folder."""


@dataclass(frozen=True)
class AssetFolder:
    """The folder of the OBJ file `obj`, beyond which nothing is read unless `allow_external`."""

    obj: Path
    allow_external: bool = False

    @property
    def root(self) -> Path:
        return self.obj.parent

    def find(self, name: str, named_in: Path, line: int) -> tuple[Path | None, tuple[Diagnostic, ...]]:
        """The file that `name`, in line `line` of `named_in`, means; None where there is none.

        Looks beside `named_in`, then beside the OBJ, and takes another letter case with a warning.
        Raises GarmentcError for a path outside the folder.
        """
        for spelling in _spellings(name):
            self._check_inside(spelling, name, named_in, line)
            for folder in dict.fromkeys((named_in.parent, self.root)):
                path = folder / spelling
                if os.path.isfile(path):  # noqa: PTH113  Path.is_file raises for names that no file can have
                    self._check_resolved(path, name, named_in, line)
                    return path, ()
        for spelling in _spellings(name):
            for folder in dict.fromkeys((named_in.parent, self.root)):
                found = _any_case(folder, spelling)
                if found is not None:
                    self._check_resolved(found, name, named_in, line)
                    message = f"'{name}' is spelt '{found.name}' on disk; rename it, as other systems tell them apart"
                    return found, (Diagnostic("asset.letter-case", message, str(named_in), line),)
        if self.allow_external:
            beside = self.root / _base_name(name)
            if os.path.isfile(beside):  # noqa: PTH113
                self._check_resolved(beside, name, named_in, line)
                message = f"'{name}' does not exist; '{beside.name}' beside the OBJ was taken"
                return beside, (Diagnostic("asset.moved", message, str(named_in), line),)
        return None, ()

    def _check_inside(self, spelling: str, name: str, named_in: Path, line: int) -> None:
        if self.allow_external:
            return
        depth = len(Path(os.path.relpath(named_in.parent, self.root)).parts)
        elsewhere = _ELSEWHERE.match(spelling) is not None
        for part in spelling.split("/"):
            depth += -1 if part == ".." else 0 if part in ("", ".") else 1
            elsewhere = elsewhere or depth < 0
        if elsewhere:
            raise self._outside(name, named_in, line)

    def _check_resolved(self, path: Path, name: str, named_in: Path, line: int) -> None:
        roots = (self.root.resolve(), self.obj.resolve().parent)
        if not self.allow_external and not any(path.resolve().is_relative_to(root) for root in roots):
            raise self._outside(name, named_in, line)

    def _outside(self, name: str, named_in: Path, line: int) -> GarmentcError:
        base = _base_name(name)
        beside = base != name and os.path.isfile(self.root / base)  # noqa: PTH113
        remedy = f"change it to '{base}', which lies there" if beside else "copy the file there and name it alone"
        return GarmentcError(
            f"'{name}' lies outside the OBJ's folder; {remedy}, or pass --allow-external-textures", named_in, line
        )


def _spellings(name: str) -> list[str]:
    """What a name may mean: as written, unquoted, without an inline comment; blanks escaped; Windows separators."""
    names = [name, name.strip('"'), name.split(" #")[0].strip()]
    names += [spelling.replace("\\ ", " ") for spelling in names]
    return list(dict.fromkeys(spelling.replace("\\", "/") for spelling in names if spelling))


def _base_name(name: str) -> str:
    return name.strip('"').replace("\\", "/").rsplit("/", 1)[-1]


def _any_case(folder: Path, name: str) -> Path | None:
    """The file whose path differs from folder/name in letter case at most."""
    path = folder
    for part in name.split("/"):
        if part in ("", ".", "..") or os.path.exists(path / part):  # noqa: PTH110
            path = path / part
            continue
        try:
            same = sorted(entry for entry in os.listdir(path) if entry.casefold() == part.casefold())  # noqa: PTH208
        except OSError:
            return None
        if not same:
            return None
        path = path / same[0]
    return path if os.path.isfile(path) else None  # noqa: PTH113
