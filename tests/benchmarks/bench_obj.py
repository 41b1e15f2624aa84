"""Time and peak memory of reading a large OBJ, beside trimesh's: `python tests/benchmarks/bench_obj.py [vertices]`.

Each reader runs in a fresh process, in turns, several times; the best time and the least peak count. Prints a table
and, for each kind of file, our time and memory as a share of trimesh's. Exit code 1 where one is not met:
no slower than trimesh, no more than twice its memory.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

READERS = {
    "garmentc": "from garmentc.outfit.obj import read_obj as read; keywords = {}",
    "trimesh": "from trimesh import load as read; keywords = {'process': False}",
}
MEASURE = """
import resource, sys, time
{setup}
begin = time.perf_counter()
mesh = read(sys.argv[1], **keywords)
seconds = time.perf_counter() - begin
print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def write_obj(path: Path, vertices: int, corners: int) -> None:
    """A waving sheet with texture coordinates and normals, of quads or triangles."""
    side = round(vertices**0.5)
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side)))
    wave = 0.1 * np.sin(9 * u)
    normals = np.stack([-0.9 * np.cos(9 * u), 0 * u, np.ones_like(u)], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    index = np.arange(1, side * side + 1).reshape(side, side)
    faces = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    if corners == 3:
        faces = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    with path.open("w") as file:
        np.savetxt(file, np.stack([u, v, wave], axis=1), fmt="v %.6f %.6f %.6f")
        np.savetxt(file, np.stack([u, v], axis=1), fmt="vt %.6f %.6f")
        np.savetxt(file, normals, fmt="vn %.6f %.6f %.6f")
        np.savetxt(file, faces.repeat(3, axis=1), fmt="f" + " %d/%d/%d" * corners)


def measure(reader: str, path: Path) -> tuple[float, float]:
    """Seconds and peak memory (MiB) of one reading in a process of its own."""
    code = MEASURE.format(setup=READERS[reader])
    done = subprocess.run([sys.executable, "-c", code, str(path)], check=True, capture_output=True, text=True)
    seconds, peak = done.stdout.split()
    return float(seconds), float(peak)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("vertices", type=int, nargs="?", default=1_000_000)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    met = True
    with tempfile.TemporaryDirectory() as folder:
        for kind, corners in (("quads", 4), ("triangles", 3)):
            path = Path(folder) / f"{kind}.obj"
            write_obj(path, arguments.vertices, corners)
            size = path.stat().st_size / 1e6
            runs = {reader: [measure(reader, path) for _ in range(arguments.rounds)] for reader in READERS}
            best = {reader: np.min(results, axis=0) for reader, results in runs.items()}
            for reader, (seconds, peak) in best.items():
                print(f"{kind:10} {reader:9} {seconds:6.2f} s  {size / seconds:6.1f} MB/s  peak {peak:6.0f} MiB")
            time_share, memory_share = best["garmentc"] / best["trimesh"]
            print(f"{kind:10} garmentc / trimesh: time {time_share:.2f}, memory {memory_share:.2f}\n")
            met = met and time_share <= 1 and memory_share <= 2
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
