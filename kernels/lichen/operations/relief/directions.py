"""Directions as images: how components are stored, and unit vectors without epsilons."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from lichen.memory import Array


class Encoding(StrEnum):
    """How components of normals are stored."""

    SIGNED = "signed"
    """from -1 to 1"""
    UNIT = "unit"
    """from 0 to 1: (n + 1) / 2"""


class Convention(StrEnum):
    """Which way y points."""

    OPENGL = "opengl"
    """up"""
    DIRECTX = "directx"
    """down"""


def unit(vectors: Array) -> Array:
    """Of the same directions, along the last axis, in their precision; no length stays none, infinities become NaN."""
    largest = np.abs(vectors).max(axis=-1, keepdims=True)
    near = np.ldexp(vectors, -np.frexp(largest)[1])
    square = (near * near).sum(axis=-1, keepdims=True)
    length = np.sqrt(np.where(square == 0, square.dtype.type(1), square))
    return np.asarray(np.where(np.isfinite(square), near / length, square.dtype.type(np.nan)))


def encoded(normals: Array, encoding: Encoding) -> Array:
    half = normals.dtype.type(0.5)
    return normals if encoding is Encoding.SIGNED else np.asarray(normals * half + half)


def decoded(stored: Array, encoding: Encoding) -> Array:
    return stored if encoding is Encoding.SIGNED else np.asarray(stored * 2 - 1)
