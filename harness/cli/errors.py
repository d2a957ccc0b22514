"""How an error reaches the user: a message and an exit code, never a traceback."""

from __future__ import annotations

import errno
import sys
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import click

EXIT_BAD_INPUT = 2
EXIT_COULD_NOT_RUN = 3
EXIT_INTERRUPTED = 130

MAKE_ROOM = (
    "What was written so far is whole: make room, or choose another place with --out, --cache or "
    "TMPDIR, and give the same command again."
)

Command = TypeVar("Command", bound=Callable[..., Any])


def reports_errors(command: Command) -> Command:
    """Turns our errors into a message and an exit code; a traceback is never a user's business."""

    @wraps(command)
    def wrapped(*args: object, **kwargs: object) -> object:
        from harness.errors import InputError, SnellcheckError

        try:
            return command(*args, **kwargs)
        except InputError as error:
            click.secho(str(error), fg="red", err=True)
            sys.exit(EXIT_BAD_INPUT)
        except SnellcheckError as error:
            click.secho(str(error), fg="red", err=True)
            sys.exit(EXIT_COULD_NOT_RUN)
        except KeyboardInterrupt:
            click.secho("interrupted", fg="red", err=True)
            sys.exit(EXIT_INTERRUPTED)
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EDQUOT):
                place = error.filename or "where it writes"
                click.secho(f"{place}: the disk is full. {MAKE_ROOM}", fg="red", err=True)
                sys.exit(EXIT_COULD_NOT_RUN)
            where = f"{error.filename}: " if error.filename else ""
            click.secho(f"{where}{error.strerror or error}", fg="red", err=True)
            sys.exit(EXIT_BAD_INPUT)

    return wrapped  # type: ignore[return-value]
