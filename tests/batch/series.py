"""A real series as a manifest: photographs of one glossy ball, each under its own calibrated far light."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.realdata import folder

BALL = "sphere = {centre_px = [307.87, 263.87], radius_px = 70.75, centre_sd_px = 0.3, radius_sd_px = 0.3}"
COUNT = 48


def manifest(path: Path, count: int = COUNT) -> Path:
    """The first `count` photographs with their lights."""
    source = folder("diligent_ball")
    names = (source / "filenames.txt").read_text().split()
    directions = np.loadtxt(source / "light_directions.txt").tolist()
    strengths = np.loadtxt(source / "light_intensities.txt").tolist()
    with path.open("w") as stream:
        for name, direction, irradiance in list(zip(names, directions, strengths, strict=True))[:count]:
            stream.write(
                f'[[photograph]]\nimage = "{source / name}"\nmaterial = "glossy ball"\n[photograph.settings]\n{BALL}\n'
                'camera = {projection = "orthographic"}\n'
                f'light = [{{kind = "directional", direction = {direction}, direction_sd_deg = 1.0, '
                f"irradiance = {irradiance}}}]\n"
            )
    return path
