"""What the scripts that run inside of Blender share: their arguments, exit codes, and words to the user."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import NoReturn

from frametwin.errors import Cancelled, FrameTwinError, InputError
from frametwin.wording import parsed_size


def arguments() -> list[str]:
    """What follows ``--`` on Blender's command line; all of it where Blender's module runs the script."""
    return sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]


def exit_code(work: Callable[[], int]) -> int:
    """What ``work`` returns, or 2 for input that cannot be used, 1 for other failures, 130 if interrupted."""
    try:
        return work()
    except InputError as error:
        say(str(error))
        return 2
    except (Cancelled, KeyboardInterrupt):
        say("Interrupted.")
        return 130
    except FrameTwinError as error:
        say(str(error))
        return 1


def picture_size(text: str) -> tuple[int, int]:
    """(height, width) from the words of ``--size``.

    Raises
    ------
    InputError
        If they are none.
    """
    size = parsed_size(text)
    if size is None:
        raise InputError.at("settings", "--size", f"is {text!r}", "give width x height, as 1600x1200")
    return size


def say(sentence: str) -> None:
    """A line on standard error."""
    print(sentence, file=sys.stderr, flush=True)


def leave(code: int) -> NoReturn:
    """End with this exit code, which Blender passes on."""
    sys.stdout.flush()
    sys.stderr.flush()
    sys.exit(code)
