"""garmentc pose."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from garmentc.cli.parameters import PATH, Number
from garmentc.cli.printing import print_json
from garmentc.errors import GarmentcError

if TYPE_CHECKING:
    from garmentc.gltf.glb_asset import GlbAsset
    from garmentc.gltf.state import State


@click.command("pose")
@click.argument("glb", type=PATH, metavar="ASSET.glb")
@click.option("-o", "--output", type=PATH, metavar="OUT.obj|ply", required=True, help="File to write.")
@click.option("--frame", type=click.IntRange(min=0), metavar="N", help="Frame of the animation, from 0.")
@click.option("--time", type=Number(min=0), metavar="SECONDS", help="Time in the animation.")
@click.option("--params", type=PATH, metavar="FILE", help="Pose in a .json or .npz file.")
@click.option("--animation", metavar="NAME", help="Name or number of the animation; the first by default.")
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def command(
    glb: Path,
    output: Path,
    frame: int | None,
    time: float | None,
    params: Path | None,
    animation: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Evaluate ASSET.glb as an engine does and write the posed mesh.

    Give one of --frame, --time and --params; without any, the rest pose is written.
    """
    from garmentc.gltf.evaluate import world_mesh
    from garmentc.gltf.posing import animation_number
    from garmentc.gltf.read import read_glb
    from garmentc.mesh_file import check_mesh_suffix, write_mesh
    from garmentc.output import check_outputs

    if sum(choice is not None for choice in (frame, time, params)) > 1:
        raise GarmentcError("--frame, --time and --params are given together; choose one")
    check_mesh_suffix(output)
    check_outputs([output], inputs=[glb])
    asset = read_glb(glb)
    at_rest = animation is None and frame is None and time is None
    number = 0 if at_rest else animation_number(asset, animation or "0")
    if frame is not None:
        time = frame / asset.frame_rate(number)
    vertices, triangles = world_mesh(asset, _state(asset, time, params, number))
    write_mesh(output, vertices, triangles)
    if as_json:
        print_json({"output": str(output), "vertices": len(vertices), "triangles": len(triangles), "seconds": time})
    elif not quiet:
        click.echo(f"{output}: {len(vertices)} vertices, {len(triangles)} triangles")


def _state(asset: GlbAsset, time: float | None, params: Path | None, animation: int) -> State:
    from garmentc.gltf.posing import state_at_pose, state_at_time
    from garmentc.gltf.state import rest_state
    from garmentc.smpl.parameters import read_parameters

    if time is not None:
        state = state_at_time(asset, time, animation)
        if time > asset.animations[animation].duration + 1e-4:
            end = asset.animations[animation].duration
            raise GarmentcError(
                f"animation {animation} ends after {end:.3f} s; choose an earlier frame or time", asset.path
            )
        return state
    if params is None:
        return rest_state(asset)
    pose = read_parameters(params).pose
    if pose is None:
        raise GarmentcError("has no pose; add one of 24 rotation vectors", params)
    return state_at_pose(asset, pose)
