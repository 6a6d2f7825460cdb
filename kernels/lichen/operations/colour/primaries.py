"""Primaries, white points, and the matrices that follow from them.

Theory. Primaries with chromaticities (x, y) and a white of luminance 1 fix the matrix from linear RGB to XYZ: its
columns are the primaries' XYZ, scaled so that RGB (1, 1, 1) gives white. The second row holds each primary's luminance.
No matrix is typed in but those that standards define as such (the cone responses of chromatic adaptation).

Sources: IEC 61966-2-1, ITU-R BT.709-6, ITU-R BT.2020-2, SMPTE RP 431-2 and EG 432-1, Adobe RGB (1998) 2005-05, SMPTE
ST 2065-1, AMPAS S-2014-004 (the chromaticities, as printed); CIE 15:2004 (illuminants); G. Sharma (ed.), Digital Color
Imaging Handbook, 2003 (von Kries); K. M. Lam, PhD thesis, Bradford 1985; C. Li et al., Color Research and Application
42, 2017 (CAT16).
"""

from __future__ import annotations

from enum import StrEnum
from functools import cache

import numpy as np

from lichen.memory import Array

Chromaticity = tuple[float, float]


class White(StrEnum):
    """A white point by its illuminant, for the 2 degree observer."""

    A = "a"
    C = "c"
    D50 = "d50"
    D55 = "d55"
    D65 = "d65"
    D75 = "d75"
    E = "e"
    ACES = "aces"
    DCI = "dci"

    @property
    def xy(self) -> Chromaticity:
        return WHITES[self]

    @property
    def xyz(self) -> Array:
        return xyz_of(self.xy)


WHITES: dict[White, Chromaticity] = {
    White.A: (0.44758, 0.40745),
    White.C: (0.31006, 0.31616),
    White.D50: (0.34570, 0.35850),
    White.D55: (0.33243, 0.34744),
    White.D65: (0.31270, 0.32900),
    White.D75: (0.29903, 0.31488),
    White.E: (1 / 3, 1 / 3),
    White.ACES: (0.32168, 0.33767),
    White.DCI: (0.314, 0.351),
}


class Primaries(StrEnum):
    """Chromaticities of red, green and blue, with their white."""

    BT709 = "bt709"
    BT2020 = "bt2020"
    P3_D65 = "p3_d65"
    P3_DCI = "p3_dci"
    ADOBE = "adobe"
    AP0 = "ap0"
    AP1 = "ap1"

    @property
    def white(self) -> White:
        return {Primaries.P3_DCI: White.DCI, Primaries.AP0: White.ACES, Primaries.AP1: White.ACES}.get(self, White.D65)


CHROMATICITIES: dict[Primaries, tuple[Chromaticity, Chromaticity, Chromaticity]] = {
    Primaries.BT709: ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06)),
    Primaries.BT2020: ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046)),
    Primaries.P3_D65: ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060)),
    Primaries.P3_DCI: ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060)),
    Primaries.ADOBE: ((0.64, 0.33), (0.21, 0.71), (0.15, 0.06)),
    Primaries.AP0: ((0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.0770)),
    Primaries.AP1: ((0.713, 0.293), (0.165, 0.830), (0.128, 0.044)),
}


def xyz_of(xy: Chromaticity) -> Array:
    """XYZ of luminance 1 with this chromaticity."""
    x, y = xy
    return np.array([x / y, 1.0, (1 - x - y) / y])


@cache
def to_xyz(primaries: Primaries) -> Array:
    """From linear RGB to XYZ, (3, 3)."""
    columns = np.stack([[x, y, 1 - x - y] for x, y in CHROMATICITIES[primaries]], axis=1)
    scaled: Array = columns * np.linalg.solve(columns, primaries.white.xyz)
    return scaled


def luminance(primaries: Primaries = Primaries.BT709) -> Array:
    """The share of each primary in luminance; they add up to 1."""
    shares: Array = to_xyz(primaries)[1]
    return shares


class Adaptation(StrEnum):
    """How colours seen under one white are carried to another: in which responses they are scaled."""

    BRADFORD = "bradford"
    CAT16 = "cat16"
    VON_KRIES = "von_kries"
    NONE = "none"


RESPONSES: dict[Adaptation, Array] = {
    Adaptation.BRADFORD: np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]),
    Adaptation.CAT16: np.array(
        [[0.401288, 0.650173, -0.051461], [-0.250268, 1.204414, 0.045854], [-0.002079, 0.048952, 0.953127]]
    ),
    Adaptation.VON_KRIES: np.array([[0.40024, 0.70760, -0.08081], [-0.22630, 1.16532, 0.04570], [0.0, 0.0, 0.91822]]),
}


def adapt(source: White, target: White, adaptation: Adaptation) -> Array:
    """The matrix on XYZ that turns the source's white into the target's, (3, 3)."""
    if source is target or adaptation is Adaptation.NONE:
        return np.eye(3)
    responses = RESPONSES[adaptation]
    scale = (responses @ target.xyz) / (responses @ source.xyz)
    matrix: Array = np.linalg.solve(responses, scale[:, np.newaxis] * responses)
    return matrix


@cache
def between(source: Primaries, target: Primaries) -> tuple[Array, Array]:
    """From linear RGB of the source to that of the target, white adapted by Bradford, and back: (3, 3) both."""
    across = adapt(source.white, target.white, Adaptation.BRADFORD)
    there = np.linalg.solve(to_xyz(target), across @ to_xyz(source)) if source is not target else np.eye(3)
    return there, np.linalg.inv(there)
