"""Fixtures that every test may use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of shared real data; tests that need it are skipped where it is absent."""
    default = Path(__file__).resolve().parents[2] / "shared"
    folder = Path(os.environ.get("GARMENTC_SHARED", default))
    if not (folder / "data").is_dir():
        pytest.skip("the shared data folder is absent (set GARMENTC_SHARED)")
    return folder
