"""The command line: the group of commands, each in a file of its own in `harness/cli/commands/`.

Exit codes, everywhere the same: 0 all passed, 1 a check failed, 2 bad usage or bad input,
3 something asked for could not run.
"""

from __future__ import annotations

import importlib
import io
import pkgutil
import sys
from pathlib import Path

import click

from harness import __version__

COMMANDS = Path(__file__).parent / "commands"


class CommandFolder(click.Group):
    """A group whose commands are the files of a folder, imported when they are asked for.

    Adding a command is adding a file; nothing is listed twice, and a command's imports cost only
    those who use it.
    """

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """The commands by name, in alphabetical order."""
        files = pkgutil.iter_modules([str(COMMANDS)])
        return sorted(file.name.replace("_", "-") for file in files)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of that name, None where there is none."""
        if cmd_name not in self.list_commands(ctx):
            return None
        file = importlib.import_module(f"harness.cli.commands.{cmd_name.replace('-', '_')}")
        command: click.Command = file.command
        return command


@click.group(
    cls=CommandFolder,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 all passed, 1 a check failed, 2 bad usage or input, "
    "3 something asked for could not run.",
)
@click.version_option(__version__, prog_name="snellcheck")
def main() -> None:
    """Does a renderer refract light correctly, by how much is it off, and why?"""
    for stream in (sys.stdout, sys.stderr):  # an ASCII terminal has no check marks
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
