"""A pytest plugin for golden .glb files, for garmentc's own tests and for those of its users.

    def test_outfit(assert_glb_matches, tmp_path):
        garmentc.compile_outfit("outfit.obj", tmp_path / "outfit.glb")
        assert_glb_matches(tmp_path / "outfit.glb", "tests/golden/outfit.glb")

`pytest --update-goldens` writes the goldens instead of comparing with them.
"""

from __future__ import annotations


import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.getgroup("garmentc").addoption(
        "--update-goldens", action="store_true", help="write golden .glb files instead of comparing with them"
    )
