"""Which decoder a file asks for: by its first bytes, and by its suffix only where those leave a choice."""

from __future__ import annotations

import os
import struct

from toolkit.errors import BadInputError

RAW_SUFFIXES = frozenset(
    f".{name}"
    for name in (
        *(
            "3fr",
            "arw",
            "bay",
            "cap",
            "cr2",
            "cr3",
            "crw",
            "dcr",
            "dcs",
            "dng",
            "drf",
            "eip",
            "erf",
            "fff",
            "iiq",
            "k25",
        ),
        *(
            "kdc",
            "mdc",
            "mef",
            "mos",
            "mrw",
            "nef",
            "nrw",
            "orf",
            "pef",
            "ptx",
            "pxn",
            "r3d",
            "raf",
            "raw",
            "rw2",
            "rwl",
        ),
        *("rwz", "sr2", "srf", "srw", "x3f"),
    )
)
_RAW_MAGIC = (b"FUJIFILMCCD-RAW", b"\0MRM", b"FOVb", b"IIU\0", b"IIRO", b"IIRS", b"MMOR", b"II\x1a\0\0\0HEAPCCDR")
_OTHER_MAGIC = (b"\xff\xd8\xff", b"BM", b"P6", b"P5", b"RIFF")
_DNG_VERSION, _CFA_PATTERN = 50706, 33421


def kind_of(path: str) -> str:
    """Name the decoder: "raw", "exr", "png", "tiff", "hdr" or "image".

    Raises BadInputError for what is missing, no regular file, empty, text or of no known kind.
    """
    head = _head(path)
    suffix = os.path.splitext(path)[1].lower()  # noqa: PTH122  # pathlib would be this module's only use of it
    for magic, kind in ((b"\x76\x2f\x31\x01", "exr"), (b"\x89PNG", "png"), (b"#?", "hdr")):
        if head.startswith(magic):
            return kind
    if head.startswith(_RAW_MAGIC) or head[4:11] == b"ftypcrx":
        return "raw"
    if head[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return "raw" if suffix in RAW_SUFFIXES or _has_raw_tags(head) else "tiff"
    if head.startswith(_OTHER_MAGIC) or suffix == ".tga":
        return "image"
    if suffix in RAW_SUFFIXES and not _is_text(head):
        return "raw"
    raise BadInputError(_unknown(head, suffix))


def _head(path: str) -> bytes:
    if "\0" in path:
        raise BadInputError("no such file; check the path")
    if os.path.isdir(path):  # noqa: PTH112  # as above
        raise BadInputError("a folder, not a photograph; name the files, or use the batch command for a folder")
    if not os.path.exists(path):  # noqa: PTH110  # as above
        raise BadInputError("no such file; check the path")
    if not os.path.isfile(path):  # noqa: PTH113  # as above
        raise BadInputError("a device or pipe, not a regular file; copy the photograph to a file first")
    try:
        with open(path, "rb") as file:  # noqa: PTH123  # as above
            head = file.read(65_536)
    except OSError as error:
        raise BadInputError(f"cannot be read ({error.strerror}); check its permissions") from error
    if not head:
        raise BadInputError("an empty file; copy it from the camera again")
    return head


def _has_raw_tags(head: bytes) -> bool:
    """Whether the first directory of a TIFF carries tags that only raws have; False where it lies further on."""
    order = "<" if head[:2] == b"II" else ">"
    if len(head) < 8 or head[2:4] not in (b"*\0", b"\0*"):
        return False
    (at,) = struct.unpack_from(order + "I", head, 4)
    if at + 2 > len(head):
        return False
    (count,) = struct.unpack_from(order + "H", head, at)
    tags = (head[at + 2 + 12 * i : at + 4 + 12 * i] for i in range(count))
    return any(struct.unpack(order + "H", tag)[0] in (_DNG_VERSION, _CFA_PATTERN) for tag in tags if len(tag) == 2)


def _is_text(head: bytes) -> bool:
    printable = sum(32 <= byte < 127 or byte in (9, 10, 13) for byte in head[:512])
    return printable > 0.95 * len(head[:512])


def _unknown(head: bytes, suffix: str) -> str:
    found = "a text file" if _is_text(head) else "a file of no known kind"
    named = f" named {suffix}" if suffix else ""
    return f"{found}{named}; expected a camera raw, OpenEXR, 16-bit PNG or TIFF, or Radiance .hdr"
