"""The `garmentc` command: argument parsing and printing, one file per subcommand, each imported when it is used."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib import import_module

import click

from garmentc import __version__
from garmentc.cli.exit_codes import EXIT_CLEAN, EXIT_FAILURE
from garmentc.cli.interruption import Interrupted, interruptible
from garmentc.cli.printing import print_error
from garmentc.errors import GarmentcError

COMMANDS = {
    "compile": "Compile an outfit OBJ and SMPL parameters to one .glb.",
    "inspect": "Show what is in a .glb: vertices, morphs, skin, animation, sizes.",
    "validate": "Check a compiled .glb for what the Khronos validator cannot see.",
    "diff": "Compare two .glb files by meaning, with a tolerance per attribute.",
    "pose": "Evaluate a .glb at a frame, a time or a pose; write OBJ or PLY.",
    "preview": "Draw a contact sheet of a .glb, or make a page with a viewer.",
    "body": "Show the body model or export it at given betas and pose.",
    "evaluate": "Measure a .glb along motions, or a model bundle against simulation.",
    "simulate": "Make a dataset of outfits in motion by simulation.",
    "dataset": "Check, draw and import datasets of outfits in motion.",
    "train": "Train networks on datasets of outfits, and export them.",
}


class Commands(click.Group):
    """Subcommand `name` is the `command` in garmentc/cli/<name>.py."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = import_module(f"garmentc.cli.{cmd_name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="garmentc", message="%(prog)s %(version)s")
def commands() -> None:
    """An asset compiler for clothing.

    In goes an outfit OBJ and SMPL parameters; out comes one skinned and morphed .glb that any engine loads.

    Exit codes: 0 clean, 1 findings (diff, validate, dataset check), 2 failure.
    """


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code. Nothing that a user can cause ends in a traceback."""
    try:
        with interruptible():
            result = commands.main(args=arguments, prog_name="garmentc", standalone_mode=False)
            sys.stdout.flush()
    except Interrupted as interruption:
        print_error(interruption.message)
        return interruption.exit_code
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        hint = f"; see '{context.command_path} --help'" if context is not None else ""
        print_error(error.format_message().rstrip(".") + hint)
    except GarmentcError as error:
        print_error(str(error))
    except MemoryError:
        print_error("out of memory; close other programs, or compile a smaller outfit")
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader left: nothing more to say
    except OSError as error:
        place = f"{error.filename}: " if error.filename is not None else ""
        print_error(f"{place}{error.strerror or error}; check the path, its permissions and the free space")
    else:
        return result if isinstance(result, int) else EXIT_CLEAN
    return EXIT_FAILURE
