"""Where a photograph should be and where results should go: asked before any work."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from toolkit.errors import BadInputError, UsageError


def refuse_image(image: Path) -> None:
    """Raise BadInputError where there is no file; what is in it is the decoders' to say."""
    try:
        mode = image.stat().st_mode
    except (FileNotFoundError, ValueError) as error:  # no such file, or a name that none can have
        raise BadInputError(f"{image} {_missing(image)}; expected an image file") from error
    except OSError as error:
        raise BadInputError(f"{image} cannot be reached: {error.strerror}; expected an image file") from error
    if stat.S_ISDIR(mode):
        raise BadInputError(f"{image} is a folder; expected an image file, or for a whole folder fit-material batch")


def _missing(image: Path) -> str:
    return f"is a link to {image.readlink()}, which does not exist" if image.is_symlink() else "does not exist"


def refuse_place(out_dir: Path) -> None:
    """Raise UsageError where a folder for results cannot be made or written to."""
    there = next(place for place in (out_dir, *out_dir.parents) if os.path.exists(place))  # noqa: PTH110  # pathlib's raises on names too long
    if not there.is_dir():
        raise UsageError(f"{there} is a file; expected a folder for the results: --out DIR")
    if not os.access(there, os.W_OK | os.X_OK):
        raise UsageError(f"{there} cannot be written to; expected a folder for the results: --out DIR")
