"""The sphere's outline in a 24-megapixel photograph beside what a raw converter needs to develop the same file.

python -m tests.benchmarks.outline     prints the figures; `make bench` calls `main()`

The whole detection, from the linear planes to centre, radius and covariance, against rawpy opening and postprocessing
the file with its defaults, in turn, imports left out; wall-clock seconds, the best of each, told beside the ratio.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from tests.benchmarks.whole import seconds, shoot, theirs
from toolkit.geometry.outline import find_sphere
from toolkit.io.read import read
from toolkit.radiometry.linearise import linearise
from toolkit.records import Camera

TARGET, REPEATS = 0.5, 5
ASKED_S = 0.5  # of the outline, on an idle machine of two cores


def measure() -> tuple[float, float]:
    """Seconds of the outline, and of the raw converter."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "ball.dng"
        shoot(path)
        image, camera = linearise(read(path)), Camera()
        find_sphere(image, camera=camera), theirs(path)
        pairs = [
            (seconds(lambda: find_sphere(image, camera=camera)), seconds(lambda: theirs(path))) for _ in range(REPEATS)
        ]
    return min(mine for mine, _ in pairs), min(converter for _, converter in pairs)


def main() -> list[dict[str, Any]]:
    """Print the figures; a row of name, figure, target, met."""
    mine, converter = measure()
    ratio = mine / converter
    name = "the sphere's outline in 24 megapixels, x rawpy's opening and developing"
    sys.stdout.write(f"outline {mine:.3f} s (asked {ASKED_S} s on an idle machine), rawpy {converter:.3f} s\n")
    sys.stdout.write(f"{name:66} {ratio:10.3g}  asked {TARGET:g}  {ratio <= TARGET}\n")
    return [{"name": name, "figure": ratio, "target": TARGET, "met": ratio <= TARGET}]


if __name__ == "__main__":
    main()
