"""Warps: pixels that move."""
