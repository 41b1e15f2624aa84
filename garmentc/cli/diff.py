"""garmentc diff."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from garmentc.cli.exit_codes import EXIT_CLEAN, EXIT_FINDINGS
from garmentc.cli.parameters import PATH, Tolerance
from garmentc.cli.printing import print_json


@click.command("diff")
@click.argument("left", type=PATH, metavar="A.glb")
@click.argument("right", type=PATH, metavar="B.glb")
@click.option(
    "-t",
    "--tolerance",
    "tolerances",
    type=Tolerance(),
    multiple=True,
    metavar="NAME=VALUE",
    help="How much may differ, such as position=1e-4 (metres): position, normal, texcoord, color, weight, "
    "rotation (radians), key, material, time (seconds). Repeatable.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the differences as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Print differences only.")
def command(left: Path, right: Path, tolerances: tuple[tuple[str, float], ...], as_json: bool, quiet: bool) -> int:
    """Compare two .glb files by what they mean, not by how they store it.

    Exits with 1 where they differ by more than the tolerances.
    """
    from garmentc.gltf.diff import diff_glb
    from garmentc.gltf.difference import DiffTolerances
    from garmentc.gltf.read import read_glb

    try:
        allowed = DiffTolerances(**dict(tolerances))
    except TypeError:
        names = ", ".join(DiffTolerances.__dataclass_fields__)
        raise click.BadParameter(f"there is no such tolerance; choose from {names}", param_hint="--tolerance") from None
    differences = diff_glb(read_glb(left), read_glb(right), allowed)
    if as_json:
        print_json([asdict(difference) for difference in differences])
    else:
        for difference in differences:
            click.echo(difference)
        if not differences and not quiet:
            click.echo("no differences")
    return EXIT_FINDINGS if differences else EXIT_CLEAN
