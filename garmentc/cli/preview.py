"""garmentc preview."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click
from click.core import ParameterSource

from garmentc.cli.parameters import PATH
from garmentc.cli.printing import file_size, print_warnings, progress
from garmentc.errors import Diagnostic, GarmentcError
from garmentc.options import Gender

if TYPE_CHECKING:
    from garmentc.evaluation.posed_outfit import GlbOutfit
    from garmentc.smpl.body import BodyModel

_OF_A_SHEET = ("frames", "views", "size", "animation", "collisions")
"""Options that a page has no use for: its viewer has controls."""


@click.command("preview")
@click.argument("glb", type=PATH, metavar="ASSET.glb")
@click.option("-o", "--output", type=PATH, metavar="OUT.png|html", required=True, help="File to write.")
@click.option("--frames", type=click.IntRange(1, 64), default=4, show_default=True, help="Moments on a sheet.")
@click.option(
    "--views",
    default="front,side,back",
    show_default=True,
    metavar="NAMES",
    help="Of front, side, back, quarter, left, right; with commas between.",
)
@click.option(
    "--size", type=click.IntRange(16, 2048), default=480, show_default=True, help="Height of a picture, pixels."
)
@click.option("--animation", metavar="NAME", help="Name or number of the animation; the first by default.")
@click.option("--collisions", is_flag=True, help="Colour cloth by how deep it lies inside the body.")
@click.option("--no-body", is_flag=True, help="Show the outfit alone.")
@click.option("--body", type=PATH, metavar="FILE", help="Body model, where it is not the default one.")
@click.option("--gender", type=click.Choice(get_args(Gender)[1:]), help="Body, where the file does not say.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors and warnings only.")
def command(
    glb: Path,
    output: Path,
    frames: int,
    views: str,
    size: int,
    animation: str | None,
    collisions: bool,
    no_body: bool,
    body: Path | None,
    gender: str | None,
    quiet: bool,
) -> None:
    """Show ASSET.glb: on a contact sheet (.png), or in a viewer that is one page (.html).

    Sheets show the animation; without one, the pose-key network in a few telling poses. The page needs no network and
    no server: it opens from disk in any browser.
    """
    from garmentc.evaluation.posed_outfit import read_outfit
    from garmentc.output import check_outputs

    kind = output.suffix.lower()
    if kind not in (".png", ".html"):
        raise GarmentcError(f"ends in '{output.suffix}'; name a .png for a sheet or a .html for a page", output)
    _check_options(kind)
    check_outputs([output], inputs=[glb])
    outfit = read_outfit(glb)
    asset = outfit.asset
    wearer, betas = (None, None) if no_body else _wearer(outfit, body, gender)
    if kind == ".html":
        from garmentc.preview.page import write_page

        count = write_page(asset, wearer, betas, output)
        shown = file_size(count)
    else:
        from garmentc.passes.blas import single_threaded_blas
        from garmentc.preview.sheet import SheetOptions, write_sheet

        names = tuple(name.strip() for name in views.split(",") if name.strip())
        options = SheetOptions(frames, names, size, animation, collisions)
        # Many small products: more threads wait for one another, four times as long as the drawing takes.
        with progress(["drawing"], quiet) as show, single_threaded_blas():
            width, height = write_sheet(asset, wearer, betas, output, options, lambda done: show("drawing", done))
        shown = f"{width} x {height} pixels"
    if not quiet:
        click.echo(f"{output}: {shown}")


def _check_options(kind: str) -> None:
    """Raise UsageError for an option that the kind of output would ignore."""
    context = click.get_current_context()
    for parameter in command.params if kind == ".html" else ():
        given = context.get_parameter_source(parameter.name or "") is ParameterSource.COMMANDLINE
        if parameter.name in _OF_A_SHEET and given:
            raise click.UsageError(f"{parameter.opts[-1]} is for sheets (.png); leave it out for a page")


def _wearer(outfit: GlbOutfit, body: Path | None, gender: str | None) -> tuple[BodyModel | None, Any]:
    """Who wears the outfit, and their betas; nobody, with a warning, where the file does not say."""
    from garmentc.evaluation.benchmark import worn_by

    extras = outfit.asset.extras if isinstance(outfit.asset.extras, dict) else {}
    if not (gender or extras.get("gender")):
        message = "does not say for which body it was made, so none is drawn; give --gender"
        print_warnings([Diagnostic("no-body", message, str(outfit.asset.path))])
        return None, None
    return worn_by(outfit, outfit.asset.path, body, gender)
