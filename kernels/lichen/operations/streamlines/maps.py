"""Named colour maps whose lightness grows evenly.

Each is the published table of 256 display colours (sRGB) taken at 33 places, linear between them: that differs from the
table by 0.007 (viridis), 0.005 (magma) and 0.022 (cividis) at most.

Sources: S. van der Walt and N. Smith, A better default colormap for Matplotlib, SciPy 2015 (viridis, magma; CC0);
J. R. Nunez, C. R. Anderton and R. S. Renslow, Optimizing colormaps with consideration for color vision deficiency,
PLOS ONE 13(7), 2018 (cividis).
"""

from __future__ import annotations

from enum import StrEnum
from functools import cache

import numpy as np

from lichen.memory import Array


class Map(StrEnum):
    """What a number between 0 and 1 looks like."""

    NONE = "none"
    """no colour"""
    VIRIDIS = "viridis"
    """from violet over green to yellow"""
    MAGMA = "magma"
    """from black over red to cream"""
    CIVIDIS = "cividis"
    """from blue to yellow, the same to most of the colour-blind"""


_TABLES = {
    Map.VIRIDIS: (
        "440154 470d60 48186a 482374 472d7b 453681 424086 3f4989 3b528b 375a8d 33638d 2f6a8e 2c728e 297a8e 26818e "
        "23898e 21908c 1f988b 1f9f88 21a685 28ae80 31b57b 3ebc74 4cc26c 5dc963 6ece58 82d34c 96d83f abdc32 c0df24 "
        "d5e21a eae51a fde725"
    ),
    Map.MAGMA: (
        "000004 030311 0a0822 130d33 1d1146 28115a 36106a 430f76 50127c 5d177f 691c81 762181 822681 8f2a81 9c2e7f "
        "a9327d b63779 c33b75 cf4170 db486a e65163 ee5c5e f5695c f9785d fb8761 fd9668 fea571 feb47b fec387 fed194 "
        "fde0a2 fceeb0 fcfdbf"
    ),
    Map.CIVIDIS: (
        "00224e 00285b 002e6a 043371 1a386f 273e6e 32436d 3b496c 434e6c 4b546c 52596d 5a5f6e 61656f 686a71 6f7073 "
        "757676 7c7b78 848179 8b8778 938d78 9b9376 a39a75 aba072 b3a670 bbad6c c3b469 ccba64 d4c15f ddc958 e6d051 "
        "efd748 f8df3c fee838"
    ),
}


@cache
def knots(name: Map) -> Array:
    """Colours at equal distances from 0 to 1, float64 (n, 3)."""
    return np.array([[int(each[i : i + 2], 16) for i in (0, 2, 4)] for each in _TABLES[name].split()]) / 255


def coloured(values: Array, name: Map) -> Array:
    """Colours (..., 3) in the precision of `values`; beyond [0, 1] those of the ends, NaN for NaN."""
    table = knots(name)
    places = np.linspace(0, 1, len(table))
    return np.stack([np.interp(values, places, column) for column in table.T], axis=-1).astype(values.dtype)
