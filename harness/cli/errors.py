"""How an error reaches the user: a message and an exit code, never a traceback."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import click

EXIT_BAD_INPUT = 2
EXIT_COULD_NOT_RUN = 3

Command = TypeVar("Command", bound=Callable[..., Any])


def reports_errors(command: Command) -> Command:
    """Turns our errors into a message and an exit code; a traceback is never a user's business."""

    @wraps(command)
    def wrapped(*args: object, **kwargs: object) -> object:
        from harness.errors import InputError, RendererError

        try:
            return command(*args, **kwargs)
        except InputError as error:
            click.secho(str(error), fg="red", err=True)
            sys.exit(EXIT_BAD_INPUT)
        except RendererError as error:
            click.secho(str(error), fg="red", err=True)
            sys.exit(EXIT_COULD_NOT_RUN)
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            click.secho(f"{where}{error.strerror or error}", fg="red", err=True)
            sys.exit(EXIT_BAD_INPUT)

    return wrapped  # type: ignore[return-value]
