"""What a surface does with light. Adding a lobe: a file beside these, and its line below."""

from . import beckmann as beckmann
from . import blinn_phong as blinn_phong
from . import ggx as ggx
from . import gtr as gtr
from . import hazy_ggx as hazy_ggx
from . import interfaced_lambert as interfaced_lambert
from . import lafortune as lafortune
from . import lambert as lambert
from . import mirror as mirror
from . import oren_nayar as oren_nayar
from . import phong as phong
from . import torrance_sparrow as torrance_sparrow
from . import ward as ward
from . import wolff as wolff
from .cosines import Cosines
from .lobe import LOBES, Claim, Lobe, Parameter, register

__all__ = ["LOBES", "Claim", "Cosines", "Lobe", "Parameter", "register"]
