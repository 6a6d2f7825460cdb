"""`lichen serve`: the HTTP service in the foreground, until it is told to end."""

from __future__ import annotations

from collections.abc import Sequence


def main(arguments: Sequence[str]) -> int:
    from lichen_service import serving

    return serving.main(arguments, prog="lichen serve")
