"""Separation into body and light by colour alone; what needs the known shape lives in `toolkit.inference`."""

from .card import CARD_SD_DEG, grey_card
from .dichromatic import separate
from .illuminant import Illuminant, best_illuminant, illuminant
from .planes import common_line
from .polarised import separate_polarised
from .pooling import pool

__all__ = [
    "CARD_SD_DEG",
    "Illuminant",
    "best_illuminant",
    "common_line",
    "grey_card",
    "illuminant",
    "pool",
    "separate",
    "separate_polarised",
]
