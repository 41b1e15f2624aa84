"""A compile that is interrupted or killed in its last instant: the earlier output is whole."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from cli_samples import write_top


def _run(command: list[str]) -> subprocess.CompletedProcess[str]:
    """Run as from a terminal: a runner in the background may ignore Ctrl-C, and its children inherit that."""

    def listen() -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    return subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=listen)


_SIGNALLED_BEFORE_THE_FILE_IS_REPLACED = """
import os, sys
from pathlib import Path
from garmentc.cli import main

replace = Path.replace

def signalled(self, target):
    if Path(target).name == "out.glb":
        assert self.stat().st_size > 10_000, "everything is written, but not yet in its place"
        os.kill(os.getpid(), int(sys.argv[1]))
    return replace(self, target)

Path.replace = signalled
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=lambda number: number.name)
def test_an_earlier_output_stays_whole(tmp_path: Path, number: signal.Signals) -> None:
    outfit, output = write_top(tmp_path), tmp_path / "out.glb"
    output.write_bytes(b"earlier")
    script = [sys.executable, "-c", _SIGNALLED_BEFORE_THE_FILE_IS_REPLACED, str(int(number))]
    arguments = ["compile", outfit, "-o", output, "--quiet", "--gender", "female"]
    result = _run([*script, *map(str, arguments)])
    assert output.read_bytes() == b"earlier"
    if number is signal.SIGKILL:
        assert result.returncode == -signal.SIGKILL
        return
    assert result.returncode == 128 + number
    assert result.stderr == "garmentc: error: interrupted; no output file was changed\n"
    assert not list(tmp_path.glob(".*.tmp"))


def test_interrupted_at_the_start() -> None:
    script = "import os, signal, sys; from garmentc.cli import main, commands\n"
    script += "commands.main = lambda **_: os.kill(os.getpid(), signal.SIGINT)\nsys.exit(main([]))"
    result = _run([sys.executable, "-c", script])
    assert result.returncode == 130
    assert result.stderr == "garmentc: error: interrupted; no output file was changed\n"
