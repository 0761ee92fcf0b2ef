"""The page, the pictures and the object of an examination: in place whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.report.folder import whole as whole_folder
from pipelines.report.result import result_text
from pipelines.report.text import stem

from .picture import close_picture, frame_picture, png_bytes
from .records import Examination
from .result import as_object

if TYPE_CHECKING:
    from pipelines.settings import Settings

SUFFIXES = (".doctor.html", ".doctor.png", ".doctor.json")


def names_of(image_name: str) -> list[str]:
    """What is written for an image of this name."""
    return [stem(image_name) + suffix for suffix in SUFFIXES]


def write_examination(found: Examination, out_dir: Path, settings: Settings) -> Path:
    """Write page, picture and object into `out_dir`, made where it does not exist; the page's path.

    Files of the same names are replaced; whether that is wanted is the caller's to ask.
    """
    from .page import page_text

    page, png, last = names_of(found.frame.name)
    pictures = _pictures(found, settings)
    with whole_folder(out_dir, last=last) as draft:
        (draft / page).write_text(page_text(found, pictures), encoding="utf-8", newline="\n")
        if pictures:
            (draft / png).write_bytes(pictures[-1])
        (draft / last).write_text(result_text(as_object(found)), encoding="utf-8", newline="\n")
    if not pictures:
        (out_dir / png).unlink(missing_ok=True)
    return out_dir / page


def _pictures(found: Examination, settings: Settings) -> list[bytes]:
    """The frame and, where there is one, the ball close; as PNG."""
    if found.image is None:
        return []
    from toolkit.geometry.glare import without_glare
    from toolkit.radiometry.linearise import linearise
    from toolkit.radiometry.quads import quads

    whole = linearise(found.frame, transfer=settings.image.transfer, noise=found.image.noise)
    picture = quads(whole if found.scene is None else without_glare(whole, found.scene))
    drawn = [frame_picture(found, picture), close_picture(found, picture)]
    return [png_bytes(one) for one in drawn if one is not None]
