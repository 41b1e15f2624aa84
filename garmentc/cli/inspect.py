"""garmentc inspect."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from garmentc.cli.parameters import PATH
from garmentc.cli.printing import file_size, print_json, table

if TYPE_CHECKING:
    from garmentc.gltf.inspect import GlbSummary


@click.command("inspect")
@click.argument("glb", type=PATH, metavar="ASSET.glb")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
def command(glb: Path, as_json: bool) -> None:
    """Show what is in ASSET.glb and what engines will make of it."""
    from garmentc.gltf.inspect import inspect_glb
    from garmentc.gltf.read import read_glb

    summary = inspect_glb(read_glb(glb))
    if as_json:
        print_json(asdict(summary))
    else:
        click.echo("\n\n".join(part for part in _parts(summary) if part))


def _parts(summary: GlbSummary) -> Iterator[str]:
    yield table(
        [
            ("file", summary.file),
            ("size", file_size(summary.bytes)),
            ("generator", summary.generator),
            ("extensions", ", ".join(summary.extensions) or "none"),
            ("joints", str(summary.joints)),
        ]
    )
    yield table(
        [(kind, file_size(size), f"{100 * size / summary.bytes:.1f} %") for kind, size in _largest_first(summary)],
        header=("bytes of", "size", "share"),
    )
    yield table(
        [(p.mesh, p.material, p.vertices, p.triangles, p.influences) for p in summary.primitives],
        header=("mesh", "material", "vertices", "triangles", "influences"),
    )
    yield table(
        [(m.mesh, m.name, m.vertices, f"{m.largest_mm:.1f} mm", file_size(m.bytes)) for m in summary.morphs],
        header=("mesh", "morph target", "vertices", "largest", "size"),
    )
    yield table(
        [(n.mesh, n.encoding, "-".join(map(str, n.layers)), n.parameters) for n in summary.pose_keys],
        header=("pose keys", "encoding", "layers", "parameters"),
    )
    yield table(
        [(a.name, f"{a.seconds:.2f} s", a.channels, a.keyframes) for a in summary.animations],
        header=("animation", "length", "channels", "keyframes"),
    )
    yield table(
        [(i.name, i.mime_type, f"{i.width} x {i.height}", file_size(i.bytes)) for i in summary.images],
        header=("image", "type", "pixels", "size"),
    )
    yield "\n".join(map(str, summary.findings))


def _largest_first(summary: GlbSummary) -> list[tuple[str, int]]:
    return sorted(summary.bytes_by_kind.items(), key=lambda entry: -entry[1])
