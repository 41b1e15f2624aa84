"""A pytest plugin for golden .glb files, for garmentc's own tests and for those of its users.

    def test_outfit(assert_glb_matches, tmp_path):
        garmentc.compile_outfit("outfit.obj", tmp_path / "outfit.glb")
        assert_glb_matches(tmp_path / "outfit.glb", "tests/golden/outfit.glb")

`pytest --update-goldens` writes the goldens instead of comparing with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import pytest

UPDATE = "--update-goldens"
_SHOWN = 12


@dataclass(frozen=True)
class GlbMatcher:
    """Compares .glb files with goldens, or writes the goldens."""

    update: bool

    def __call__(self, path: str | PathLike[str], golden: str | PathLike[str], **tolerances: float) -> None:
        """Fail the test where the .glb at `path` means something else than the one at `golden`.

        tolerances  replace those of garmentc.gltf.difference.DiffTolerances, such as position=1e-4 (metres)
        """
        __tracebackhide__ = True
        if self.update:
            _copy(Path(path), Path(golden))
            return
        if not Path(golden).exists():
            pytest.fail(f"there is no golden {golden}; run pytest {UPDATE} to write it", pytrace=False)
        differences = _differences(Path(golden), Path(path), tolerances)
        if differences:
            shown = [f"  {line}" for line in differences[:_SHOWN]]
            more = [f"  and {len(differences) - _SHOWN} more"] if len(differences) > _SHOWN else []
            heading = f"{path} differs from the golden {golden}:"
            advice = f"If the change is meant, run pytest {UPDATE}, look at what changed, and commit the golden."
            pytest.fail("\n".join([heading, *shown, *more, advice]), pytrace=False)


def _differences(golden: Path, path: Path, tolerances: dict[str, float]) -> list[str]:
    from garmentc.gltf.diff import diff_glb
    from garmentc.gltf.difference import DiffTolerances
    from garmentc.gltf.read import read_glb

    return [str(entry) for entry in diff_glb(read_glb(golden), read_glb(path), DiffTolerances(**tolerances))]


def _copy(path: Path, golden: Path) -> None:
    from garmentc.output import written_whole

    golden.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(golden) as file:
        file.write(path.read_bytes())


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.getgroup("garmentc").addoption(
        UPDATE, action="store_true", help="write golden .glb files instead of comparing with them"
    )


@pytest.fixture
def assert_glb_matches(request: pytest.FixtureRequest) -> GlbMatcher:
    """Call it with a .glb file and its golden; see garmentc.testing."""
    return GlbMatcher(update=bool(request.config.getoption(UPDATE)))
