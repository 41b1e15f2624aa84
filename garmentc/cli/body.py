"""garmentc body."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click

from garmentc.cli.parameters import PATH, Numbers
from garmentc.cli.printing import print_json, table
from garmentc.options import Gender

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from garmentc.smpl.body import BodyModel


@click.command("body")
@click.option("--body", "model", type=PATH, metavar="FILE", help="SMPL, SMPL-H or SMPL-X model; otherwise the default.")
@click.option("--gender", type=click.Choice(get_args(Gender)[1:]), help="Which body.")
@click.option("--betas", type=Numbers(), metavar="B0,B1,...", help="Shape coefficients.")
@click.option("--params", type=PATH, metavar="FILE", help="Gender, betas and pose in a .json or .npz file.")
@click.option("-o", "--output", type=PATH, metavar="OUT.obj|ply", help="Write the body in that shape and pose.")
@click.option("--json", "as_json", is_flag=True, help="Print the facts as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def command(
    model: Path | None,
    gender: str | None,
    betas: tuple[float, ...] | None,
    params: Path | None,
    output: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Show the body model, or export it at given betas and pose."""
    import numpy as np

    from garmentc.mesh_file import check_mesh_suffix, write_mesh
    from garmentc.smpl.load import load_body
    from garmentc.smpl.parameters import Parameters, read_parameters

    if output is not None:
        check_mesh_suffix(output)
    given = Parameters() if params is None else read_parameters(params)
    body = load_body(model, gender or given.gender)
    shape = given.betas if betas is None else np.array(betas)
    rest = body.shaped(shape)
    if output is not None:
        pose = np.zeros((24, 3)) if given.pose is None else given.pose
        write_mesh(output, body.posed(pose, shape), body.faces)
    facts = _facts(body, rest)
    if as_json:
        print_json(facts)
    elif not quiet:
        click.echo(table([(name.replace("_", " "), value) for name, value in facts.items()]))


def _facts(body: BodyModel, rest: NDArray[Any]) -> dict[str, object]:
    """What there is to say about a body whose rest vertices are `rest` (V, 3)."""
    span, height, _ = rest.max(axis=0) - rest.min(axis=0)
    return {
        "name": body.name,
        "gender": body.gender,
        "vertices": len(body.v_template),
        "triangles": len(body.faces),
        "joints": len(body.J_template),
        "shape_coefficients": body.shapedirs.shape[-1],
        "height_m": round(float(height), 4),
        "arm_span_m": round(float(span), 4),
    }
