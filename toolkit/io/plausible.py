"""Whether decoded numbers can be a photograph: files that decode to nothing or to garbage are refused."""

from __future__ import annotations

import numpy as np

from toolkit.errors import BadInputError
from toolkit.io.decoded import Decoded


def check(decoded: Decoded, file_bytes: int) -> None:
    """Raise BadInputError where the numbers cannot be a photograph."""
    values = decoded.values
    if values.size == 0 or min(values.shape[:2]) < 8:
        raise BadInputError(f"it decodes to {values.shape[1]} x {values.shape[0]} pixels; a photograph is needed")
    if np.ptp(values) == 0:
        raise BadInputError("it decodes to nothing: every sample is the same; the file is damaged: copy it again")
