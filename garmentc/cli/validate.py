"""garmentc validate."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from garmentc.cli.exit_codes import EXIT_CLEAN, EXIT_FINDINGS
from garmentc.cli.parameters import PATH
from garmentc.cli.printing import print_json


@click.command("validate")
@click.argument("glb", type=PATH, metavar="ASSET.glb")
@click.option("--strict", is_flag=True, help="Let warnings count as errors.")
@click.option("--json", "as_json", is_flag=True, help="Print the findings as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Print findings only.")
def command(glb: Path, strict: bool, as_json: bool, quiet: bool) -> int:
    """Check ASSET.glb for what the Khronos validator cannot see: skin, morphs, pose keys, animation.

    Exits with 1 where there is an error; with --strict, a warning is enough.
    """
    from garmentc.gltf.read import read_glb
    from garmentc.gltf.validate import validate_glb

    findings = validate_glb(read_glb(glb))
    if as_json:
        print_json([asdict(finding) for finding in findings])
    else:
        for finding in findings:
            click.echo(f"{glb}: {finding}")
        if not findings and not quiet:
            click.echo(f"{glb}: no findings")
    counted = [finding for finding in findings if strict or finding.severity == "error"]
    return EXIT_FINDINGS if counted else EXIT_CLEAN
