"""Accept: qualities, specificity, wildcards, nonsense."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lichen_service.negotiation import acceptable, media_type_of, parse_accept

FORMATS = {
    "png": ("image/png",),
    "jpeg": ("image/jpeg", "image/jpg"),
    "exr": ("image/x-exr", "image/exr"),
    "npy": ("application/x-npy",),
}


@pytest.mark.parametrize(
    ("accept", "best_first"),
    [
        (None, ["exr", "png", "jpeg", "npy"]),
        ("", ["exr", "png", "jpeg", "npy"]),
        ("*/*", ["exr", "png", "jpeg", "npy"]),
        ("image/*", ["exr", "png", "jpeg"]),
        ("image/png", ["png"]),
        ("IMAGE/PNG", ["png"]),
        ("image/png;q=0.1, image/jpeg;q=0.9", ["jpeg", "png"]),
        ("image/*;q=0.5, application/x-npy", ["npy", "exr", "png", "jpeg"]),
        ("image/*, image/x-exr;q=0, image/exr;q=0", ["png", "jpeg"]),
        ("*/*;q=0.1, image/jpg", ["jpeg", "exr", "png", "npy"]),
        ("*/*;q=0", []),
        ("text/html", []),
        ("text/html, image/avif, image/webp, */*;q=0.8", ["exr", "png", "jpeg", "npy"]),
        ("nonsense", ["exr", "png", "jpeg", "npy"]),
        ("nonsense, image/png", ["png"]),
        ("image/png;q=2, image/jpeg", ["jpeg"]),
        ("image/png; level=1; q=0.5", ["png"]),
        ("*/png", []),
    ],
)
def test_the_best_acceptable_format_comes_first(accept: str | None, best_first: list[str]) -> None:
    assert list(acceptable(accept, FORMATS, ["exr"])) == best_first


def test_preference_breaks_ties_only() -> None:
    assert acceptable("image/png, image/jpeg", FORMATS, ["jpeg", "unknown"]) == ("jpeg", "png")
    assert acceptable("image/png, image/jpeg;q=0.9", FORMATS, ["jpeg"]) == ("png", "jpeg")


@given(st.text(max_size=60))
def test_no_text_breaks_it(accept: str) -> None:
    assert set(acceptable(accept, FORMATS, ["png"])) <= set(FORMATS)


@given(st.permutations(["image/png;q=0.4", "image/*;q=0.2", "*/*;q=0.1"]))
def test_the_order_of_ranges_does_not_matter(elements: list[str]) -> None:
    assert acceptable(",".join(elements), FORMATS, []) == ("png", "jpeg", "exr", "npy")


def test_parts_are_read_leniently() -> None:
    assert media_type_of("Image/PNG ; charset=x") == "image/png"
    (only,) = parse_accept(" image/png ; Q=0.25 ")
    assert only.quality == 0.25
