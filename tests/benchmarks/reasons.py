"""Why a peer is faster, for those rows of comparisons in which one was and the reason was looked for: by profiles, by
machine code, or by what the other computes; and what holds those pointwise operations up that take far longer than a
copy. Pages show a reason where it is needed only."""

from __future__ import annotations

REASONS: dict[str, str] = {
    "gaussian, sigma 1, RGBA": (
        "The peer cuts its kernel to 9 taps and errs by 16 times as much; ours takes 11, until a millionth of the "
        "weight is left."
    ),
    "box, 41 x 41, RGBA": (
        "Windows are joined from the ends and the beginnings of blocks, so that no sum drifts and no NaN outlives its "
        "window: three additions along each axis, and ends that wait in memory, where a running sum takes two."
    ),
    "convolve, 3 x 3 dense, RGBA": (
        "What lies around the kernel counts beside nine taps that take no longer than their bytes."
    ),
    "laplacian, RGB": (
        "Alone the kernel takes as long as the peer. A fifth of its work is to copy rows to where all borders look "
        "alike, which two threads do while they wait for memory; what lies around it is the rest."
    ),
    "morphology, dilation 3 x 3, RGB": (
        "Alone the kernel takes little longer than its bytes, and less than the peer; what lies around it is the rest."
    ),
    "median, 3 x 3, RGB": (
        "A third of the time the kernel waits for rows, and what lies around it counts. Two threads make up for both."
    ),
    "median, 5 x 5, RGB": (
        "Of 25 vectors that are sorted 16 registers hold too few: two fifths of the time go into storing and loading "
        "them again."
    ),
    "convert, sRGB to HSV": "On two threads the kernel takes as long as the peer; what lies around it is the rest.",
    "matrix, 3 x 3, RGB": (
        "Taking eight pixels of three channels apart and together takes eleven shuffles. On one thread they count, on "
        "two memory does."
    ),
    "mix, 1.7, RGB": "Planning, launching and waiting stand beside a kernel that takes little longer than its bytes.",
    "resize, a quarter, box, RGBA": "INTER_AREA adds whole pixels; ours weighs them, as any other factor needs.",
    "resize, a quarter, lanczos3, RGBA": (
        "The peer takes 8 x 8 samples, whatever lies between; ours weighs all of the 24 x 24 that a pixel stands for."
    ),
    "pyramid, one level, RGBA": "It waits for the rows of the source.",
    "colour_map, viridis": (
        "The place between two colours is found in pairs of floats, and every pixel gathers and blends two of its own; "
        "the peer looks up one of 256 codes of 8 bits, and writes a quarter of the bytes."
    ),
    "composite, over, RGBA": "Both read two pictures and write one at what memory gives; planning counts beside that.",
    "lic, rk4, step 1, 1024 px": (
        "The peer walks from pixel to pixel through constant directions, one look at the field for each; Runge-Kutta "
        "interpolates it four times a step."
    ),
    "lic, fastlic, distance 0.25, 1024 px": (
        "Half of the time goes into finding which lines pass nearest to a pixel and into the means around it; "
        "following lines is the rest."
    ),
    "lic, fixed, bits 12, 1024 px": (
        "A frame buffer of few bits is imitated, to show what they cost in accuracy: every sum is rounded, every step "
        "is stored twice."
    ),
}

BOUNDS: dict[str, str] = {
    "reflection": (
        "Arithmetic in doubles, so that no rounding decides which chart of the environment a direction falls in: two "
        "directions for each pixel, a square root and a division each, and two places with four texels around them."
    ),
    "lighting": (
        "Arithmetic: a pixel's normal and the ways to lamp and eye are made unit, and its highlight is that of facets: "
        "square roots and divisions."
    ),
    "compare": (
        "Figures: the same pass that writes the map sums in doubles and counts codes of 8 and 16 bits and units in the "
        "last place, which does not all hide behind memory. Before it a sample of the pixels bounds the largest "
        "thousandth, which is ranked after it."
    ),
    "gamut": (
        "Two powers for each of three channels wherever one pixel of sixteen is beyond the threshold; and the picture "
        "is read once more for the findings, which are counted in doubles."
    ),
    "ocio": "OpenColorIO's own processor on the host, without its quick mathematics, from and into copies of blocks.",
    "difference": (
        "Arithmetic in doubles, of which four go at once: six cube roots and twelve square roots for each pair of "
        "pixels, since differences of colours that are nearly alike cancel. The kernel is all of it."
    ),
    "pixel_texture": "Gathers: each pixel fetches texels from all over a texture, and blends them one pixel at a time.",
    "table3d": "Gathers: each pixel fetches four colours of the table, from places that differ for each.",
    "colour_map": (
        "Instructions: a place in a pair of floats and a gather of two colours for each pixel, and three channels of "
        "sixteen that are put together."
    ),
    "mask": "What lies around a kernel that reads all channels of a pixel and tests one: it takes as long as a copy.",
    "convert": "What lies around a kernel that reads one channel and writes three counts, and the curve of the result.",
    "quantise": (
        "Doubles, so that all ways decide alike which level is nearest: every sample is converted there and back, four "
        "at once."
    ),
    "disparity": "Doubles, of which four go at once, and a division for each pixel.",
    "deproject": "Doubles, so that points are right to the last bit: each depth and three coordinates are converted.",
}
"""By operation."""
