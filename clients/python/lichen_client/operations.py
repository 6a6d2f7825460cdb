"""Every operation as a method. Made by clients/python/make.py from the catalogue; not to be edited."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeAlias, TypedDict, TypeVar, Unpack

if TYPE_CHECKING:
    import numpy.typing as npt

    from lichen_client.calls import ImageLike

    Numbers: TypeAlias = npt.ArrayLike | Sequence[Any]

R = TypeVar("R", covariant=True)

FIRST_INPUTS: Mapping[str, str] = {
    "accumulate": "image_1",
    "affine": "image",
    "ambient_occlusion": "height",
    "arrange": "image",
    "background": "image",
    "box": "image",
    "bump": "normal",
    "chromatic_aberration": "image",
    "colour_map": "image",
    "compare": "image",
    "composite": "image",
    "convert": "image",
    "convolve": "image",
    "critical_points": "field",
    "curve": "image",
    "deproject": "depth",
    "depth_of_field": "image",
    "derivative": "image",
    "difference": "image",
    "disparity": "depth",
    "displace": "image",
    "dissolve": "image",
    "emboss": "image",
    "equalise": "image",
    "expression": "a",
    "fog": "image",
    "frame_blur": "image",
    "gamma": "image",
    "gamut": "image",
    "gaussian": "image",
    "homography": "image",
    "horizon_map": "height",
    "hue_rotate": "image",
    "laplacian": "image",
    "lens_distort": "image",
    "levels": "image",
    "lic": "field",
    "lighting": "normal",
    "mask": "image",
    "matrix": "image",
    "median": "image",
    "mesh": "image",
    "mix": "image",
    "morphology": "image",
    "motion_blur": "image",
    "normal_map": "height",
    "normals": "image",
    "ocio": "image",
    "outline": "image",
    "panorama": "image",
    "parallax": "image",
    "pixel_texture": "image",
    "planar_shadow": "matte",
    "polar": "image",
    "prefilter": "image",
    "premultiply": "image",
    "pyramid": "image",
    "quantise": "image",
    "reduced_lighting": "normal",
    "reflection": "normal",
    "remap": "image",
    "resize": "image",
    "rotate": "image",
    "saturation": "image",
    "shadow": "map",
    "sharpen": "image",
    "spherical_harmonics": "image",
    "statistics": "image",
    "stereo_view": "image",
    "streamlines": "field",
    "table3d": "image",
    "thin_plate": "image",
    "tiles": "position",
    "tone_map": "image",
    "transfer": "image",
    "vector": "image",
    "vignette": "image",
    "z_composite": "image",
}
"""What the first input of each operation is called."""


class Options(TypedDict, total=False):
    """What may be asked of every operation beside its own parameters."""

    format: str | None
    """the format to get the encoded image in; without it the result is an array"""
    max_error: float | None
    """largest absolute error the result may have, in output units"""
    max_ms: float | None
    """milliseconds the computation may take by prediction; the most accurate method within them runs"""
    method: str | None
    """the method by name, instead of a choice by error or time"""
    precision: Literal["fixed8", "fixed12", "fixed16", "float16", "float32", "float64"] | None
    """what inputs and results of every step are kept in; float64 evaluates definitions instead of methods, slowly"""
    device: Literal["opencl", "numpy"] | None
    """where to compute; left out: OpenCL if it works here, else NumPy"""
    verify: bool | None
    """compare the result with truth, whole or on tiles, which is slow; `Accept: multipart/mixed` gets a map, too"""
    prune: bool | None
    """leave out work that cannot change the result by more than the asked error"""
    nonfinite: Literal["propagate", "reject", "repair"] | None
    """what to do with NaN and infinity in the inputs"""
    select: str | None
    """of inputs that are files of data: components and places to read, as in u=u10,v=v10,time=3,level=@850; a part
    may begin with the name of an input, later.time=4, and is for that one alone
    """
    storage: Literal["uint8", "uint16", "float16", "float32", "float64"] | None
    """how the samples of the result are stored"""
    space: Literal["srgb", "linear", "data"] | None
    """what the numbers of the result mean; left out: what is natural to its format"""
    alpha: Literal["none", "straight", "associated"] | None
    """what the last channel of the result is, where the input has coverage; left out: what its format holds"""


class Operations(Generic[R]):
    """The operations of the catalogue this client was made from. What is not given is not sent: the service's own
    default holds. `run` calls those that are newer."""

    def run(self, operation: str, image: ImageLike = None, /, **values: Any) -> R:
        raise NotImplementedError

    def accumulate(
        self,
        image_1: ImageLike,
        /,
        *,
        image_2: ImageLike = None,
        image_3: ImageLike = None,
        image_4: ImageLike = None,
        image_5: ImageLike = None,
        image_6: ImageLike = None,
        image_7: ImageLike = None,
        image_8: ImageLike = None,
        image_9: ImageLike = None,
        image_10: ImageLike = None,
        image_11: ImageLike = None,
        image_12: ImageLike = None,
        image_13: ImageLike = None,
        image_14: ImageLike = None,
        image_15: ImageLike = None,
        image_16: ImageLike = None,
        weights: Numbers | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Sums up to sixteen images by weights: means of exposures and frames, differences, filters in time.

        image_1: the first image
        image_2: a further image of the same size and channels
        image_3: a further image of the same size and channels
        image_4: a further image of the same size and channels
        image_5: a further image of the same size and channels
        image_6: a further image of the same size and channels
        image_7: a further image of the same size and channels
        image_8: a further image of the same size and channels
        image_9: a further image of the same size and channels
        image_10: a further image of the same size and channels
        image_11: a further image of the same size and channels
        image_12: a further image of the same size and channels
        image_13: a further image of the same size and channels
        image_14: a further image of the same size and channels
        image_15: a further image of the same size and channels
        image_16: a further image of the same size and channels
        weights: one for each image, in their order; a mean unless given
        method: compensated, plain
        """
        return self.run(
            "accumulate",
            image_1,
            image_2=image_2,
            image_3=image_3,
            image_4=image_4,
            image_5=image_5,
            image_6=image_6,
            image_7=image_7,
            image_8=image_8,
            image_9=image_9,
            image_10=image_10,
            image_11=image_11,
            image_12=image_12,
            image_13=image_13,
            image_14=image_14,
            image_15=image_15,
            image_16=image_16,
            weights=weights,
            **options,
        )

    def affine(
        self,
        image: ImageLike,
        /,
        *,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        width: int | None = None,
        height: int | None = None,
        matrix: Numbers | None = None,
        inverse: bool | None = None,
        points: float | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Scales, rotates, shears and moves an image by a matrix.

        image: a picture or data, any number of channels
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        width: columns of the result; the image's if left out; at least 1, at most 16384
        height: rows of the result; the image's if left out; at least 1, at most 16384
        matrix: two rows of three: input to output coordinates; default [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
        inverse: whether the matrix maps output to input coordinates instead; default false
        points: samples along each axis of an ellipse; 2 to 16; a knob
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        method: nearest, bilinear, bicubic, mitchell, bspline, lanczos2, lanczos3, mip, supersampled, ewa
        """
        return self.run(
            "affine",
            image,
            border=border,
            value=value,
            width=width,
            height=height,
            matrix=matrix,
            inverse=inverse,
            points=points,
            samples=samples,
            **options,
        )

    def ambient_occlusion(
        self,
        height: ImageLike,
        /,
        *,
        normal: ImageLike = None,
        source: Literal["height", "depth"] | None = None,
        scale: float | None = None,
        pixel_size: float | None = None,
        radius: float | None = None,
        directions: int | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        strength: float | None = None,
        spacing: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Shows how much of the sky each pixel of a relief or of a scene's depths sees.

        height: heights, or depths, in one channel
        normal: which way surfaces face: x, y up, z
        source: height: towards the viewer; depth: away from it, in perspective; default "height"
        scale: of heights: how high the value 1 is; at least 0, at most 1000000; px; default 8.0
        pixel_size: of depths: how large a pixel is at depth 1: 2 tan(fov / 2) over the picture's height; at least
            1e-06, at most 1; default 0.002
        radius: how far around itself a pixel looks; at least 1, at most 256; px; default 12.0
        directions: evenly around, the first to the right, then counterclockwise; at least 4, at most 64; default 8
        border: how the input continues beyond its edges; default "clamp"
        value: what lies beyond a constant border; at least -1000000, at most 1000000; default 0.0
        strength: how much of what is hidden is taken away; at least 0, at most 1; default 1.0
        spacing: pixels between the places that a direction looks at; 1 to 16; a knob
        method: march
        """
        return self.run(
            "ambient_occlusion",
            height,
            normal=normal,
            source=source,
            scale=scale,
            pixel_size=pixel_size,
            radius=radius,
            directions=directions,
            border=border,
            value=value,
            strength=strength,
            spacing=spacing,
            **options,
        )

    def arrange(
        self,
        image: ImageLike,
        /,
        *,
        left: int | None = None,
        top: int | None = None,
        right: int | None = None,
        bottom: int | None = None,
        transpose: bool | None = None,
        flip: Literal["none", "horizontal", "vertical", "both"] | None = None,
        tile: Numbers | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Crops, pads, transposes, flips and tiles an image; every sample stays as it is.

        image: a picture or data, any number of channels
        left: columns added on the left; cut off where negative; at least -16384, at most 16384; px; default 0
        top: rows added at the top; cut off where negative; at least -16384, at most 16384; px; default 0
        right: columns added on the right; cut off where negative; at least -16384, at most 16384; px; default 0
        bottom: rows added at the bottom; cut off where negative; at least -16384, at most 16384; px; default 0
        transpose: whether rows and columns change places; default false
        flip: which way the image is mirrored, after that; default "none"
        tile: how often it is repeated, across and down; default [1, 1]
        border: how the image continues where pixels are added; default "constant"
        value: what a constant border adds, in every channel; default 0.0
        method: exact
        """
        return self.run(
            "arrange",
            image,
            left=left,
            top=top,
            right=right,
            bottom=bottom,
            transpose=transpose,
            flip=flip,
            tile=tile,
            border=border,
            value=value,
            **options,
        )

    def background(
        self,
        image: ImageLike,
        /,
        *,
        depth: ImageLike,
        colour: float | Numbers | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Puts a colour where there is nothing: where depth is infinite.

        image: a picture
        depth: how far away each pixel is, or, of three channels, where
        colour: the light where there is nothing; one number, or one for each colour channel; at least -1000000, at
            most 1000000; default 0.0
        method: exact
        """
        return self.run("background", image, depth=depth, colour=colour, **options)

    def box(
        self,
        image: ImageLike,
        /,
        *,
        mask: ImageLike = None,
        width: int | None = None,
        height: int | None = None,
        anchor: Numbers | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        missing: Literal["spread", "skip", "inside"] | None = None,
        bits: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Mean of a rectangle around every pixel, in time that does not grow with it.

        image: a picture or data, any number of channels
        mask: weights of the pixels in [0, 1], one channel; 0 takes no part
        width: columns of the window; at least 1, at most 4095; px; default 5
        height: rows of the window; at least 1, at most 4095; px; default 5
        anchor: column and row of the window that lies over the output pixel; its middle if left out
        border: how the image continues beyond its edges; default "reflect"
        value: what lies beyond a constant border; default 0.0
        missing: what becomes of samples that are NaN or infinite; default "spread"
        bits: precision of the table: float32 or float64; 24 to 53; a knob
        method: running, table, centred
        """
        return self.run(
            "box",
            image,
            mask=mask,
            width=width,
            height=height,
            anchor=anchor,
            border=border,
            value=value,
            missing=missing,
            bits=bits,
            **options,
        )

    def bump(
        self,
        normal: ImageLike,
        /,
        *,
        position: ImageLike,
        height: ImageLike,
        scale: float | None = None,
        jump: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Bends normals by a relief on the surface: heights along the normal, in the unit of the positions.

        normal: which way the surface faces: x, y, z
        position: where each pixel's point is; infinite where there is nothing
        height: how far the relief rises along the normal
        scale: factor on heights, which makes them lengths of the positions' unit; negative presses the relief in; at
            least -1000000, at most 1000000; default 1.0
        jump: how many times as far away as the other a neighbour may be and still be of the same surface; 1: slopes
            are taken to the nearer neighbour wherever they differ; at least 1, at most 1000000; default 2.0
        method: single, exact
        """
        return self.run("bump", normal, position=position, height=height, scale=scale, jump=jump, **options)

    def chromatic_aberration(
        self,
        image: ImageLike,
        /,
        *,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        scales: Numbers | None = None,
        centre: Numbers | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Magnifies every colour by its own scale, as a lens without correction does, or takes that out.

        image: a picture of colours
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        scales: magnifications of red, green and blue; default [1.004, 1.0, 0.996]
        centre: of the lens; shares of width and height; default [0.5, 0.5]
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        method: bilinear, bicubic, lanczos3, ewa
        """
        return self.run(
            "chromatic_aberration",
            image,
            border=border,
            value=value,
            scales=scales,
            centre=centre,
            samples=samples,
            **options,
        )

    def colour_map(
        self,
        image: ImageLike,
        /,
        *,
        palette: ImageLike = None,
        map: Literal["viridis", "plasma", "inferno", "magma", "cividis", "turbo", "twilight"] | None = None,
        low: float | None = None,
        high: float | None = None,
        beyond: Literal["clamp", "repeat", "mirror"] | None = None,
        bands: bool | None = None,
        channel: int | None = None,
        spacing: float | None = None,
        offset: float | None = None,
        line_width: float | None = None,
        line: Numbers | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Shows a scalar by the colours of a palette, with contours.

        image: values, as they are stored
        palette: colours in its first row, in place of a named map
        map: the palette, unless it is an input; default "viridis"
        low: the value shown by the palette's first colour; the least there is unless given; at least -1e+30, at most
            1e+30
        high: the value shown by its last colour; the largest there is unless given; below low turns the palette
            round; at least -1e+30, at most 1e+30
        beyond: beyond low and high: the end's colour, the palette again, or turned back; default "clamp"
        bands: whether each colour is shown as it is, in bands, instead of colours between them; default false
        channel: the channel of the image that is shown, from 0; at least 0, at most 63; default 0
        spacing: difference of value between contours; none are drawn unless given; above 0, at most 1e+30
        offset: the value of one of the contours; at least -1e+30, at most 1e+30; default 0.0
        line_width: width of contours; above 0, at most 64; px; default 1.0
        line: colour of contours: one number, or one for each channel of the palette; default [0.0]
        method: exact
        """
        return self.run(
            "colour_map",
            image,
            palette=palette,
            map=map,
            low=low,
            high=high,
            beyond=beyond,
            bands=bands,
            channel=channel,
            spacing=spacing,
            offset=offset,
            line_width=line_width,
            line=line,
            **options,
        )

    def compare(
        self,
        image: ImageLike,
        /,
        *,
        reference: ImageLike,
        map: Literal["absolute", "signed", "ciede2000", "flip"] | None = None,
        peak: float | None = None,
        margin: int | None = None,
        metrics: Numbers | None = None,
        pixels_per_degree: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Compares two pictures: a map of their differences, and every figure of the accuracy engine.

        image: the picture
        reference: what it is compared with: of its size, channels, alpha and space
        map: absolute or signed differences of every channel, or the difference seen: ciede2000, flip; default
            "absolute"
        peak: the largest value that the signal can have, for the peak signal-to-noise ratio; above 0, at most
            1000000; default 1.0
        margin: width of the border whose differences are stated apart; at least 0, at most 4096; px; default 1
        metrics: the figures that are found beside the differences: regions, codes, ulps, ciede2000, flip; default
            ["regions", "codes", "ulps"]
        pixels_per_degree: of visual angle, for flip: 67 is a screen of 3840 pixels over 0.7 m, seen from 0.7 m; at
            least 1, at most 200; default 67.0
        method: exact
        """
        return self.run(
            "compare",
            image,
            reference=reference,
            map=map,
            peak=peak,
            margin=margin,
            metrics=metrics,
            pixels_per_degree=pixels_per_degree,
            **options,
        )

    def composite(
        self,
        image: ImageLike,
        /,
        *,
        base: ImageLike,
        mask: ImageLike = None,
        operator: Literal[
            "clear",
            "copy",
            "destination",
            "over",
            "destination_over",
            "in",
            "destination_in",
            "out",
            "destination_out",
            "atop",
            "destination_atop",
            "xor",
            "plus",
            "saturate",
        ]
        | None = None,
        blend: Literal[
            "normal",
            "multiply",
            "screen",
            "overlay",
            "darken",
            "lighten",
            "color_dodge",
            "color_burn",
            "hard_light",
            "soft_light",
            "difference",
            "exclusion",
            "hue",
            "saturation",
            "color",
            "luminosity",
        ]
        | None = None,
        opacity: float | None = None,
        light: Literal["linear", "stored"] | None = None,
        x: int | None = None,
        y: int | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Composites a picture with another: all operators of Porter and Duff, all blend modes of W3C.

        image: the picture on top
        base: the picture below it, of as many colours; the result has its size
        mask: weights of the image's pixels, its last channel; of the image's size
        operator: what of either picture remains; default "over"
        blend: what colour the image gets where both cover; default "normal"
        opacity: what the image is multiplied by, colour and coverage; at least 0, at most 1; default 1.0
        light: linear: sums of light; stored: the numbers as they are, as style sheets do; default "linear"
        x: column of the base at which the image begins; what hangs over is cut off; at least -65536, at most 65536;
            px; default 0
        y: row of the base at which the image begins; at least -65536, at most 65536; px; default 0
        method: exact
        """
        return self.run(
            "composite",
            image,
            base=base,
            mask=mask,
            operator=operator,
            blend=blend,
            opacity=opacity,
            light=light,
            x=x,
            y=y,
            **options,
        )

    def convert(
        self,
        image: ImageLike,
        /,
        *,
        target: Literal[
            "srgb",
            "linear_bt709",
            "bt2020",
            "linear_bt2020",
            "bt2100_pq",
            "display_p3",
            "linear_p3",
            "dci_p3",
            "linear_dci_p3",
            "adobe_rgb",
            "linear_adobe_rgb",
            "aces2065_1",
            "acescg",
            "xyz",
            "xyy",
            "lab",
            "lch",
            "luv",
            "oklab",
            "oklch",
            "hsv",
            "hsl",
            "yiq",
            "ycbcr_601",
            "ycbcr_601_narrow",
            "ycbcr_709",
            "ycbcr_709_narrow",
            "ycbcr_2020",
            "ycbcr_2020_narrow",
            "cmy",
            "cmyk",
            "luminance",
            "luminance_scotopic",
        ]
        | None = None,
        source: Literal[
            "srgb",
            "linear_bt709",
            "bt2020",
            "linear_bt2020",
            "bt2100_pq",
            "display_p3",
            "linear_p3",
            "dci_p3",
            "linear_dci_p3",
            "adobe_rgb",
            "linear_adobe_rgb",
            "aces2065_1",
            "acescg",
            "xyz",
            "xyy",
            "lab",
            "lch",
            "luv",
            "oklab",
            "oklch",
            "hsv",
            "hsl",
            "yiq",
            "ycbcr_601",
            "ycbcr_601_narrow",
            "ycbcr_709",
            "ycbcr_709_narrow",
            "ycbcr_2020",
            "ycbcr_2020_narrow",
            "cmy",
            "cmyk",
            "luminance",
            "luminance_scotopic",
        ]
        | None = None,
        white: Literal["a", "c", "d50", "d55", "d65", "d75", "e", "aces", "dci"] | None = None,
        adaptation: Literal["bradford", "cat16", "von_kries", "none"] | None = None,
        degree: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Converts pictures from one colour space to another.

        image: the picture; channels after its colours pass unchanged
        target: the space to convert to; default "lab"
        source: the space of the picture's numbers; what the picture says unless given
        white: the white that XYZ, xyY, L*a*b*, LCh, L*u*v* and luminance are relative to; default "d65"
        adaptation: how colours are carried from one white to another; default "bradford"
        degree: degree of the polynomials; 3 to 6; a knob
        method: single, fitted, double
        """
        return self.run(
            "convert", image, target=target, source=source, white=white, adaptation=adaptation, degree=degree, **options
        )

    def convolve(
        self,
        image: ImageLike,
        /,
        *,
        mask: ImageLike = None,
        kernel: Numbers | None = None,
        kernels: Numbers | None = None,
        name: Literal[
            "box",
            "smooth",
            "highpass",
            "highpass5",
            "sharpen",
            "laplacian",
            "laplacian5",
            "sobel_x",
            "sobel_y",
            "compass_n",
            "compass_ne",
            "compass_e",
            "compass_se",
            "compass_s",
            "compass_sw",
            "compass_w",
            "compass_nw",
            "lines_horizontal",
            "lines_vertical",
            "lines_falling",
            "lines_rising",
            "emboss",
            "disc",
            "line",
        ]
        | None = None,
        size: int | None = None,
        radius: float | None = None,
        length: float | None = None,
        angle: float | None = None,
        mode: Literal["convolution", "correlation"] | None = None,
        anchor: Numbers | None = None,
        normalise: bool | None = None,
        scale: float | None = None,
        bias: float | None = None,
        coverage: Literal["convolved", "kept"] | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        missing: Literal["spread", "skip", "inside"] | None = None,
        tolerance: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Convolution or correlation with any kernel, given as a matrix or by name.

        image: a picture or data, any number of channels
        mask: weights of the pixels in [0, 1], one channel; 0 takes no part
        kernel: rows of weights, all of one length; overrides `name`
        kernels: a kernel for each channel; overrides `kernel` and `name`
        name: a kernel by name, where none is given; default "smooth"
        size: rows and columns of the named kernels box and smooth; at least 1, at most 63; default 3
        radius: of the named kernel disc; above 0, at most 255; px; default 5.0
        length: of the named kernel line; above 0, at most 500; px; default 15.0
        angle: of the named kernel line, from x towards y; at least -360, at most 360; deg; default 0.0
        mode: which way a given kernel lies on the image; default "convolution"
        anchor: column and row of the kernel that lies over the output pixel; its middle if left out
        normalise: divide the kernel by its sum; default false
        scale: factor on the kernel; at least -1000000, at most 1000000; default 1.0
        bias: added to every result; at least -1000000, at most 1000000; default 0.0
        coverage: what becomes of alpha; default "convolved"
        border: how the image continues beyond its edges; default "reflect"
        value: what lies beyond a constant border; default 0.0
        missing: what becomes of samples that are NaN or infinite; default "spread"
        tolerance: share of the kernel's l1 norm that is left out; 0 to 0.5; a knob
        method: direct, separable, fft
        """
        return self.run(
            "convolve",
            image,
            mask=mask,
            kernel=kernel,
            kernels=kernels,
            name=name,
            size=size,
            radius=radius,
            length=length,
            angle=angle,
            mode=mode,
            anchor=anchor,
            normalise=normalise,
            scale=scale,
            bias=bias,
            coverage=coverage,
            border=border,
            value=value,
            missing=missing,
            tolerance=tolerance,
            **options,
        )

    def critical_points(
        self,
        field: ImageLike,
        /,
        *,
        radius: float | None = None,
        scale: float | None = None,
        bias: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Finds where a vector field vanishes: place, kind and Jacobian, and a picture that marks them.

        field: vectors: x to the right, y down; further channels are not read
        radius: of the marks; at least 0.5, at most 64; px; default 4.0
        scale: v = (c - bias) * scale; at least -1000000, at most 1000000; default 1.0
        bias: the stored value of a zero component; at least -1000000, at most 1000000; default 0.0
        method: direct
        """
        return self.run("critical_points", field, radius=radius, scale=scale, bias=bias, **options)

    def curve(
        self,
        image: ImageLike,
        /,
        *,
        points: Numbers | None = None,
        interpolation: Literal["monotone", "linear"] | None = None,
        beyond: Literal["clamp", "extend"] | None = None,
        channel: int | None = None,
        size: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Passes colour through a curve drawn by control points, monotone wherever they are.

        image: a picture or data; its coverage channel, if it has one, passes unchanged
        points: control points [x, y], x ascending; default [[0.0, 0.0], [1.0, 1.0]]
        interpolation: between the points: monotone cubic pieces (PCHIP), or straight lines; default "monotone"
        beyond: beyond the points: clamp keeps the end's value, extend goes on straight; default "clamp"
        channel: the one colour channel that is changed, counted from 0; all unless given; at least 0, at most 63
        size: cells of the table; 16 to 65536; a knob
        method: exact, table
        """
        return self.run(
            "curve",
            image,
            points=points,
            interpolation=interpolation,
            beyond=beyond,
            channel=channel,
            size=size,
            **options,
        )

    def deproject(
        self,
        depth: ImageLike,
        /,
        *,
        fov: float | None = None,
        depth_kind: Literal["planar", "euclidean", "window", "reversed"] | None = None,
        near: float | None = None,
        far: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Turns a camera's depths into the points that they were seen at.

        depth: how far away each pixel is
        fov: the camera's vertical angle of view; at least 0.01, at most 175; deg; default 50.0
        depth_kind: planar: along the viewing direction; euclidean: from the eye; window: 0 at near, 1 at far;
            reversed: 1 to 0; default "planar"
        near: of a window's depth; above 0, at most 1000000000; default 0.1
        far: of a window's depth; none: infinitely far; above 0, at most 1000000000000
        method: exact
        """
        return self.run("deproject", depth, fov=fov, depth_kind=depth_kind, near=near, far=far, **options)

    def depth_of_field(
        self,
        image: ImageLike,
        /,
        *,
        depth: ImageLike,
        focus: float | None = None,
        blur: float | None = None,
        largest: float | None = None,
        blades: int | None = None,
        rotation: float | None = None,
        samples: float | None = None,
        layers: float | None = None,
        views: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Blurs what lies off the plane in focus, as a lens with an aperture of a shape does.

        image: a picture
        depth: distances along the view
        focus: depth of the plane in focus, in the units of the depths; above 0, at most 1000000000; default 1.0
        blur: radius at which points at infinity are seen; at least 0, at most 10000; px; default 8.0
        largest: no radius is larger; at least 0, at most 64; px; default 16.0
        blades: of the aperture: 3 or more, or 0 for a disc; at least 0, at most 16; default 0
        rotation: of the blades, to the left; at least -100000, at most 100000; deg; default 0.0
        samples: pixels taken around each; 4 to 1024; a knob
        layers: ranges of circles that are blurred alike; 1 to 64; a knob
        views: points of the lens; 1 to 1024; a knob
        method: gather, sampled, layered, light_field
        """
        return self.run(
            "depth_of_field",
            image,
            depth=depth,
            focus=focus,
            blur=blur,
            largest=largest,
            blades=blades,
            rotation=rotation,
            samples=samples,
            layers=layers,
            views=views,
            **options,
        )

    def derivative(
        self,
        image: ImageLike,
        /,
        *,
        valid: ImageLike = None,
        mask: Literal["sobel", "scharr", "prewitt", "central", "gaussian"] | None = None,
        sigma: float | None = None,
        output: Literal["x", "y", "along", "l2", "l1", "direction"] | None = None,
        angle: float | None = None,
        scale: float | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        missing: Literal["spread", "skip", "inside"] | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Slope of an image along an axis or angle, or magnitude and direction of its gradient.

        image: a picture or data, any number of channels
        valid: which pixels take part, one channel: those where it is not 0
        mask: how the difference is smoothed across; default "sobel"
        sigma: standard deviation of the mask gaussian; at least 0.3, at most 10; px; default 1.0
        output: what is made of the two slopes; default "l2"
        angle: of the output along, from x towards y; at least -360, at most 360; deg; default 0.0
        scale: factor on the slopes; no part in a direction; at least -1000000, at most 1000000; default 1.0
        border: how the image continues beyond its edges; default "reflect"
        value: what lies beyond a constant border; default 0.0
        missing: what becomes of samples that are NaN or infinite; default "spread"
        method: direct
        """
        return self.run(
            "derivative",
            image,
            valid=valid,
            mask=mask,
            sigma=sigma,
            output=output,
            angle=angle,
            scale=scale,
            border=border,
            value=value,
            missing=missing,
            **options,
        )

    def difference(
        self,
        image: ImageLike,
        /,
        *,
        reference: ImageLike,
        formula: Literal["cie76", "cie94", "ciede2000"] | None = None,
        source: Literal["linear_bt709", "lab"] | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Tells how different the colours of two pictures look, pixel by pixel.

        image: the picture
        reference: what it is compared with, of the same size
        formula: the distance; default "ciede2000"
        source: what the numbers of both are, where they do not say it themselves: linear light, or L*a*b*; default
            "linear_bt709"
        method: exact, single
        """
        return self.run("difference", image, reference=reference, formula=formula, source=source, **options)

    def disparity(
        self,
        depth: ImageLike,
        /,
        *,
        baseline: float | None = None,
        convergence: float | None = None,
        fov: float | None = None,
        largest: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Tells from depths how far apart two eyes see each pixel.

        depth: distances along the view
        baseline: between the eyes, in the units of the depths; at least -1000000, at most 1000000; default 0.065
        convergence: the depth that coincides; infinity if left out; above 1e-06, at most 1000000000
        fov: of the cameras, from top to bottom; at least 0.01, at most 179; deg; default 40.0
        largest: no disparity is larger, either way; at least 0, at most 1000000; px; default 10000.0
        method: exact
        """
        return self.run(
            "disparity", depth, baseline=baseline, convergence=convergence, fov=fov, largest=largest, **options
        )

    def displace(
        self,
        image: ImageLike,
        /,
        *,
        map: ImageLike = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        width: int | None = None,
        height: int | None = None,
        pattern: Literal["map", "ripple", "swirl", "taper", "haze"] | None = None,
        amplitude: float | None = None,
        bias: float | None = None,
        length: float | None = None,
        phase: float | None = None,
        angle: float | None = None,
        reach: float | None = None,
        centre: Numbers | None = None,
        seed: int | None = None,
        octaves: int | None = None,
        lacunarity: float | None = None,
        gain: float | None = None,
        points: float | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Displaces every pixel by a map, or by a ripple, swirl, taper, or a haze of one octave or more.

        image: what is displaced
        map: x and y of every pixel's displacement
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        width: columns of the result; the image's if left out; at least 1, at most 16384
        height: rows of the result; the image's if left out; at least 1, at most 16384
        pattern: a map, or one of the patterns; default "map"
        amplitude: how far: px, or the factor of a map or of a taper; at least -100000, at most 100000; default 1.0
        bias: the map's value that means no displacement, such as 0.5; at least -1000000, at most 1000000; default 0.0
        length: of a wave, or of a cell of haze, px; above 0.001, at most 1000000; default 32.0
        phase: of a ripple, or the height of the haze, in whole periods; at least -1000000, at most 1000000; default
            0.0
        angle: of a swirl at its centre; at least -100000, at most 100000; deg; default 90.0
        reach: where a swirl ends (half the smaller side if left out), or a ripple fades, px; at least 0.001, at most
            1000000
        centre: shares of width and height; default [0.5, 0.5]
        seed: of the haze; at least 0, at most 4294967295; default 0
        octaves: of the haze: noises of ever smaller cells that are added; at least 1, at most 12; default 1
        lacunarity: from one octave's frequency to the next one's; at least 1, at most 8; default 2.0
        gain: from one octave's amplitude to the next one's; at least 0, at most 1; default 0.5
        points: samples along each axis of an ellipse; 2 to 16; a knob
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        method: nearest, bilinear, bicubic, mitchell, bspline, lanczos2, lanczos3, mip, supersampled, ewa
        """
        return self.run(
            "displace",
            image,
            map=map,
            border=border,
            value=value,
            width=width,
            height=height,
            pattern=pattern,
            amplitude=amplitude,
            bias=bias,
            length=length,
            phase=phase,
            angle=angle,
            reach=reach,
            centre=centre,
            seed=seed,
            octaves=octaves,
            lacunarity=lacunarity,
            gain=gain,
            points=points,
            samples=samples,
            **options,
        )

    def dissolve(
        self,
        image: ImageLike,
        /,
        *,
        base: ImageLike,
        pattern: ImageLike = None,
        amount: float | None = None,
        softness: float | None = None,
        seed: int | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Turns one picture into another pixel by pixel, by noise or by a pattern.

        image: the picture at amount 0
        base: the picture at amount 1, of the same size and channels
        pattern: when each pixel turns, 0 to 1; noise by default
        amount: how far: 0 is the image, 1 the base; at least 0, at most 1; default 0.5
        softness: how much of the amount a pixel takes to turn; 0 at once, else 0.001 at least; at least 0, at most
            10; default 0.0
        seed: of the noise that stands in for a missing pattern; at least 0, at most 4294967295; default 0
        method: exact
        """
        return self.run(
            "dissolve", image, base=base, pattern=pattern, amount=amount, softness=softness, seed=seed, **options
        )

    def emboss(
        self,
        image: ImageLike,
        /,
        *,
        angle: float | None = None,
        distance: float | None = None,
        strength: float | None = None,
        bias: float | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Shades a picture as a relief that is lit from one side, by a single difference.

        image: heights; every colour is a relief of its own
        angle: where the lamp stands: 0 to the right, 90 above; at least -360, at most 360; deg; default 135.0
        distance: how far off the difference is taken; much more than a detail's size shows it twice; at least 0, at
            most 32; px; default 1.0
        strength: factor on the difference; negative presses the relief in; at least -10000, at most 10000; default
            1.0
        bias: the value of planes; at least -10000, at most 10000; default 0.5
        border: how heights continue beyond the edges; default "clamp"
        value: height beyond a constant border; at least -1000000, at most 1000000; default 0.0
        method: direct
        """
        return self.run(
            "emboss",
            image,
            angle=angle,
            distance=distance,
            strength=strength,
            bias=bias,
            border=border,
            value=value,
            **options,
        )

    def equalise(
        self,
        image: ImageLike,
        /,
        *,
        bins: int | None = None,
        low: float | None = None,
        high: float | None = None,
        over: Literal["together", "each"] | None = None,
        strength: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Equalises the histogram, of all colour channels together or of each.

        image: a picture or data; its coverage channel, if it has one, passes unchanged
        bins: how many equal ranges are counted; at least 2, at most 65536; default 256
        low: where the first bin begins; at least -1000000, at most 1000000; default 0.0
        high: where the last bin ends; above low; at least -1000000, at most 1000000; default 1.0
        over: together: all colour channels in one histogram; each: one for every channel; default "together"
        strength: how far from the value itself, limited, to the equalised one; at least 0, at most 1; default 1.0
        method: exact
        """
        return self.run("equalise", image, bins=bins, low=low, high=high, over=over, strength=strength, **options)

    def expression(
        self,
        a: ImageLike,
        /,
        *,
        b: ImageLike = None,
        c: ImageLike = None,
        d: ImageLike = None,
        expression: str | None = None,
        light: Literal["linear", "stored"] | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Computes an arithmetic expression over up to four images in one pass.

        a: the first image
        b: a further image of the same size
        c: a further image of the same size
        d: a further image of the same size
        expression: arithmetic over a, b, c, d, their channels a.r or a[0], x, y, width and height; default "a"
        light: stored: the numbers as they are; linear: pictures as scene-linear light; default "stored"
        method: compiled
        """
        return self.run("expression", a, b=b, c=c, d=d, expression=expression, light=light, **options)

    def field(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        kind: Literal["uniform", "circular", "saddle", "source", "gyre", "cylinder"] | None = None,
        strength: float | None = None,
        angle: float | None = None,
        centre: Numbers | None = None,
        radius: float | None = None,
        circulation: float | None = None,
        time: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Makes a vector field: uniform, circular, saddle, source, double gyre, or flow past a cylinder.

        width: of the field; at least 1, at most 16384; px; default 512
        height: of the field; at least 1, at most 16384; px; default 512
        kind: which flow; default "cylinder"
        strength: factor on all vectors; negative turns them round; at least -1000000, at most 1000000; default 1.0
        angle: turns the flow, from x towards y; at least -360, at most 360; deg; default 0.0
        centre: (x, y) of the flow's centre, in half shorter sides from the middle of the image; default [0.0, 0.0]
        radius: of the cylinder, in half shorter sides; at least 0.001, at most 10; default 0.3
        circulation: around the cylinder; 4 pi radius stops all before it; at least -100, at most 100; default 0.0
        time: of the gyre, whose middle sways once in 10 units; at least -1000000, at most 1000000; default 0.0
        method: direct
        """
        return self.run(
            "field",
            width=width,
            height=height,
            kind=kind,
            strength=strength,
            angle=angle,
            centre=centre,
            radius=radius,
            circulation=circulation,
            time=time,
            **options,
        )

    def fog(
        self,
        image: ImageLike,
        /,
        *,
        depth: ImageLike,
        emissive: ImageLike = None,
        fov: float | None = None,
        depth_kind: Literal["planar", "euclidean", "window", "reversed"] | None = None,
        near: float | None = None,
        far: float | None = None,
        kind: Literal["linear", "exponential", "squared", "layered", "height"] | None = None,
        distance: Literal["euclidean", "planar"] | None = None,
        density: float | None = None,
        start: float | None = None,
        end: float | None = None,
        colour: float | Numbers | None = None,
        heights: Numbers | None = None,
        densities: Numbers | None = None,
        base: float | None = None,
        falloff: float | None = None,
        eye: Numbers | None = None,
        up: Numbers | None = None,
        forward: Numbers | None = None,
        background: Literal["fog", "keep"] | None = None,
        entries: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Fades a picture into fog with distance: even, in layers, or thinning with height.

        image: a picture
        depth: how far away each pixel is, or, of three channels, where
        emissive: how much of each pixel fog does not hide, 0 to 1
        fov: the camera's vertical angle of view; at least 0.01, at most 175; deg; default 50.0
        depth_kind: planar: along the viewing direction; euclidean: from the eye; window: 0 at near, 1 at far;
            reversed: 1 to 0; default "planar"
        near: of a window's depth; above 0, at most 1000000000; default 0.1
        far: of a window's depth; none: infinitely far; above 0, at most 1000000000000
        kind: linear, exponential, squared (exponential of the square), layered (by a profile over height), height;
            default "exponential"
        distance: euclidean: from the eye; planar: along the viewing direction, as hardware once did; default
            "euclidean"
        density: what is hidden per unit of distance; of layered fog a factor; below 1e-30 none; at least 0, at most
            1000000; default 0.1
        start: of linear fog: nothing is hidden up to here; at least 0, at most 1000000000; default 1.0
        end: of linear fog: everything is hidden from here on; at least 0, at most 1000000000; default 100.0
        colour: the fog's light; one number, or one for each colour channel; at least -1000000, at most 1000000;
            default 0.5
        heights: of layered fog, rising; default [0.0]
        densities: at each of the heights; linear between them, constant beyond; default [1.0]
        base: of height fog: where the density is `density`; at least -1000000, at most 1000000; default 0.0
        falloff: of height fog: over this height the density falls to 1 / e; at least 1e-06, at most 1000000000;
            default 10.0
        eye: where the camera is; depths begin there; default [0.0, 0.0, 0.0]
        up: the direction in which heights are counted, in the axes of the positions, or of the camera; any length but
            0; default [0.0, 1.0, 0.0]
        forward: the viewing direction, where planar distances of positions are asked for; default [0.0, 0.0, -1.0]
        background: pixels that are infinitely far: fog as dense as it gets, or left as they are; default "fog"
        entries: of the table; 2 to 65536; a knob
        method: exact, table
        """
        return self.run(
            "fog",
            image,
            depth=depth,
            emissive=emissive,
            fov=fov,
            depth_kind=depth_kind,
            near=near,
            far=far,
            kind=kind,
            distance=distance,
            density=density,
            start=start,
            end=end,
            colour=colour,
            heights=heights,
            densities=densities,
            base=base,
            falloff=falloff,
            eye=eye,
            up=up,
            forward=forward,
            background=background,
            entries=entries,
            **options,
        )

    def frame_blur(
        self,
        image: ImageLike,
        /,
        *,
        frames: int | None = None,
        window: int | None = None,
        stride: int | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Blurs motion by the mean of neighbouring frames, for every step of a sequence.

        image: frames of equal height, one below the other
        frames: pictures in the image, one below the other; at least 1, at most 4096; default 1
        window: frames of an exposure; all of them if left out; at least 1, at most 4096
        stride: frames from one exposure to the next; at least 1, at most 4096; default 1
        method: summed, running, single
        """
        return self.run("frame_blur", image, frames=frames, window=window, stride=stride, **options)

    def gabor_noise(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        seed: int | None = None,
        low: float | None = None,
        high: float | None = None,
        cell: float | Numbers | None = None,
        x: float | None = None,
        y: float | None = None,
        tile: bool | None = None,
        fractal: Literal["none", "fbm", "turbulence", "billow", "ridged"] | None = None,
        octaves: int | None = None,
        lacunarity: float | None = None,
        gain: float | None = None,
        antialias: bool | None = None,
        warp: float | None = None,
        dimensions: int | None = None,
        z: float | None = None,
        w: float | None = None,
        loop: int | None = None,
        output: Literal["value", "derivatives"] | None = None,
        impulses: int | None = None,
        angle: float | None = None,
        waves: float | None = None,
        spread: float | None = None,
        tail: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Gabor noise: random short waves of one frequency, in one direction or in all; tileable.

        width: of the picture; at least 1, at most 16384; px; default 512
        height: of the picture; at least 1, at most 16384; px; default 512
        seed: which of the noises; at least 0, at most 4294967295; default 0
        low: what noise of -1 becomes; at least -1000000, at most 1000000; default 0.0
        high: what noise of +1 becomes; at least -1000000, at most 1000000; default 1.0
        cell: side of a cell, or its sides along x and y; at least 1e-06, at most 1000000; px; default 64.0
        x: of the picture's left edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        y: of the picture's upper edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        tile: whether the picture repeats without a seam; a whole number of cells is fitted into it; default false
        fractal: how octaves are summed; default "none"
        octaves: octaves at most; 0 gives the middle; at least 0, at most 30; default 6
        lacunarity: from one octave's frequency to the next one's; at least 1, at most 16; default 2.0
        gain: from one octave's amplitude to the next one's; lacunarity^-H; at least 0, at most 8; default 0.5
        antialias: whether octaves that pixels cannot show are replaced by their mean, the last one fading; default
            true
        warp: how far places are moved by two more such noises; at least 0, at most 16384; px; default 0.0
        dimensions: of the noise; beyond two, the picture is a slice at z and w; at least 2, at most 4; default 2
        z: third coordinate, in cells: time, or depth; at least -1000000000, at most 1000000000; default 0.0
        w: fourth coordinate, in cells; at least -1000000000, at most 1000000000; default 0.0
        loop: cells of z after which the noise comes again; 0: never; at least 0, at most 65536; default 0
        output: the noise alone, or its derivatives with it; default "value"
        impulses: of a cell; with few, single ones show; at least 1, at most 32; default 4
        angle: direction, from x towards y; at least -360, at most 360; deg; default 0.0
        waves: cycles of a wave in a cell; its window is two cells across; at least 0.01, at most 32; default 2.0
        spread: how far directions stray from angle; 90 for all; at least 0, at most 90; deg; default 90.0
        tail: share of the output's range that octaves may be left out for; 0 to 0.5; a knob
        method: single, double
        """
        return self.run(
            "gabor_noise",
            width=width,
            height=height,
            seed=seed,
            low=low,
            high=high,
            cell=cell,
            x=x,
            y=y,
            tile=tile,
            fractal=fractal,
            octaves=octaves,
            lacunarity=lacunarity,
            gain=gain,
            antialias=antialias,
            warp=warp,
            dimensions=dimensions,
            z=z,
            w=w,
            loop=loop,
            output=output,
            impulses=impulses,
            angle=angle,
            waves=waves,
            spread=spread,
            tail=tail,
            **options,
        )

    def gamma(
        self,
        image: ImageLike,
        /,
        *,
        gamma: float | Numbers | None = None,
        direction: Literal["decode", "encode"] | None = None,
        negative: Literal["mirror", "clamp"] | None = None,
        size: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Raises every colour channel to a power.

        image: the picture; its coverage channel, if it has one, passes unchanged
        gamma: the exponent, or one for each colour channel; at least 0.1, at most 10; default 2.2
        direction: decode raises to gamma, encode to its reciprocal; default "decode"
        negative: negative values: mirror keeps them by odd extension, clamp makes them 0; default "mirror"
        size: cells of the table at most; 256 to 65536; a knob
        method: exact, table
        """
        return self.run("gamma", image, gamma=gamma, direction=direction, negative=negative, size=size, **options)

    def gamut(
        self,
        image: ImageLike,
        /,
        *,
        action: Literal["clip", "compress", "expand", "report"] | None = None,
        target: Literal["bt709", "bt2020", "p3_d65", "p3_dci", "adobe", "ap0", "ap1"] | None = None,
        source: Literal["bt709", "bt2020", "p3_d65", "p3_dci", "adobe", "ap0", "ap1"] | None = None,
        peak: float | None = None,
        threshold: Numbers | None = None,
        limit: Numbers | None = None,
        power: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Clips or compresses colours into a gamut, expands them again, or reports what lies outside.

        image: the picture; channels after the third pass unchanged
        action: what is done with colours outside; default "compress"
        target: the gamut, by its primaries; default "bt709"
        source: the primaries of the picture's linear light; default "bt709"
        peak: light above it is outside too, for clip and report; none is unless given; above 0, at most 1000000
        threshold: distances of red, green and blue up to which colours stay, for compress and expand; default [0.815,
            0.803, 0.88]
        limit: distances that land on the gamut's wall; default [1.147, 1.264, 1.312]
        power: how sharply the curve bends: 1 is softest; at least 1, at most 5; default 1.2
        method: exact
        """
        return self.run(
            "gamut",
            image,
            action=action,
            target=target,
            source=source,
            peak=peak,
            threshold=threshold,
            limit=limit,
            power=power,
            **options,
        )

    def gaussian(
        self,
        image: ImageLike,
        /,
        *,
        sigma: float,
        mask: ImageLike = None,
        sigma_x: float | None = None,
        sigma_y: float | None = None,
        angle: float | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        missing: Literal["spread", "skip", "inside"] | None = None,
        tail: float | None = None,
        bits: float | None = None,
        order: float | None = None,
        poles: float | None = None,
        extended: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Gaussian blur of any width, with a stated error.

        image: a picture or data, any number of channels
        mask: weights of the pixels in [0, 1], one channel; 0 takes no part
        sigma: standard deviation; at least 0, at most 100000; px
        sigma_x: along the first axis, x unless it is turned; sigma if left out; at least 0, at most 100000
        sigma_y: along the second axis, y unless it is turned; sigma if left out; at least 0, at most 100000
        angle: by which both axes are turned, from x towards y; at least -360, at most 360; deg; default 0.0
        border: how the image continues beyond its edges; default "reflect"
        value: what lies beyond a constant border; default 0.0
        missing: what becomes of samples that are NaN or infinite; default "spread"
        tail: weight of the modes that are dropped; 1e-09 to 0.5; a knob
        bits: precision of the transforms: float32 or float64; 24 to 53; a knob
        order: exponentials in the response; 2 to 8; a knob
        poles: poles of the all-pole filter; 3 to 5; a knob
        extended: 1: boxes with parts of pixels at their ends; 0 to 1; a knob
        method: fir, fft, multirate, dct, deriche, vliet-young, box3
        """
        return self.run(
            "gaussian",
            image,
            sigma=sigma,
            mask=mask,
            sigma_x=sigma_x,
            sigma_y=sigma_y,
            angle=angle,
            border=border,
            value=value,
            missing=missing,
            tail=tail,
            bits=bits,
            order=order,
            poles=poles,
            extended=extended,
            **options,
        )

    def gbuffer(
        self,
        *,
        eye: Numbers | None = None,
        target: Numbers | None = None,
        up: Numbers | None = None,
        fov: float | None = None,
        extent: float | None = None,
        width: int | None = None,
        height: int | None = None,
        buffer: Literal[
            "depth", "distance", "position", "normal", "albedo", "roughness", "mask", "height", "motion", "emissive"
        ]
        | None = None,
        frame: Literal["camera", "world"] | None = None,
        far: float | None = None,
        objects: Numbers | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Casts rays at spheres, planes, boxes, blobs and terrains, and tells depth, normals, albedo and the rest.

        eye: where it stands; default [0.0, 0.0, 0.0]
        target: what it looks at; not the eye; default [0.0, 0.0, -1.0]
        up: what is up in its picture, roughly; not the viewing direction; default [0.0, 1.0, 0.0]
        fov: vertical angle of view; at least 0.01, at most 175; deg; default 50.0
        extent: without perspective: the height of what it sees; at least 1e-06, at most 1000000
        width: px; at least 1, at most 16384; default 256
        height: px; at least 1, at most 16384; default 256
        buffer: depth, distance, position, normal, albedo, roughness, mask, height, motion or emissive; default
            "depth"
        frame: whose axes positions and normals are told in; default "camera"
        far: depth beyond which nothing is seen; above 0, at most 1000000; default 10000.0
        objects: spheres, planes, boxes, blobs and terrains; default []
        method: exact
        """
        return self.run(
            "gbuffer",
            eye=eye,
            target=target,
            up=up,
            fov=fov,
            extent=extent,
            width=width,
            height=height,
            buffer=buffer,
            frame=frame,
            far=far,
            objects=objects,
            **options,
        )

    def homography(
        self,
        image: ImageLike,
        /,
        *,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        width: int | None = None,
        height: int | None = None,
        matrix: Numbers | None = None,
        inverse: bool | None = None,
        source_points: Numbers | None = None,
        target_points: Numbers | None = None,
        points: float | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Shows a plane from elsewhere: a projective warp by a matrix or by pairs of points.

        image: a picture or data, any number of channels
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        width: columns of the result; the image's if left out; at least 1, at most 16384
        height: rows of the result; the image's if left out; at least 1, at most 16384
        matrix: three rows of three: input to output coordinates; nothing moves if it is left out
        inverse: whether the matrix maps output to input coordinates instead; default false
        source_points: [x, y] of four or more points of the input, in px
        target_points: where these points shall lie in the output
        points: samples along each axis of an ellipse; 2 to 16; a knob
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        method: nearest, bilinear, bicubic, mitchell, bspline, lanczos2, lanczos3, mip, supersampled, ewa
        """
        return self.run(
            "homography",
            image,
            border=border,
            value=value,
            width=width,
            height=height,
            matrix=matrix,
            inverse=inverse,
            source_points=source_points,
            target_points=target_points,
            points=points,
            samples=samples,
            **options,
        )

    def horizon_map(
        self,
        height: ImageLike,
        /,
        *,
        source: Literal["height", "depth"] | None = None,
        scale: float | None = None,
        pixel_size: float | None = None,
        radius: float | None = None,
        directions: int | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        output: Literal["slope", "sine", "degrees"] | None = None,
        spacing: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Finds how high the horizon stands around each pixel of a relief, in several directions.

        height: heights, or depths, in one channel
        source: height: towards the viewer; depth: away from it, in perspective; default "height"
        scale: of heights: how high the value 1 is; at least 0, at most 1000000; px; default 8.0
        pixel_size: of depths: how large a pixel is at depth 1: 2 tan(fov / 2) over the picture's height; at least
            1e-06, at most 1; default 0.002
        radius: how far around itself a pixel looks; at least 1, at most 256; px; default 12.0
        directions: evenly around, the first to the right, then counterclockwise; at least 4, at most 64; default 8
        border: how the input continues beyond its edges; default "clamp"
        value: what lies beyond a constant border; at least -1000000, at most 1000000; default 0.0
        output: the tangent of the elevation, its sine, or the angle in degrees; default "degrees"
        spacing: pixels between the places that a direction looks at; 1 to 16; a knob
        method: march
        """
        return self.run(
            "horizon_map",
            height,
            source=source,
            scale=scale,
            pixel_size=pixel_size,
            radius=radius,
            directions=directions,
            border=border,
            value=value,
            output=output,
            spacing=spacing,
            **options,
        )

    def hue_rotate(self, image: ImageLike, /, *, angle: float | None = None, **options: Unpack[Options]) -> R:
        """Turns all hues by an angle; luminance and grey stay as they are.

        image: the picture; channels after the third pass unchanged
        angle: from red towards green; at least -36000, at most 36000; deg; default 90
        method: exact
        """
        return self.run("hue_rotate", image, angle=angle, **options)

    def laplacian(
        self,
        image: ImageLike,
        /,
        *,
        mask: Literal["four", "eight", "isotropic", "gaussian"] | None = None,
        sigma: float | None = None,
        scale: float | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Sum of the second derivatives, of the image or of its Gaussian blur.

        image: a picture or data, any number of channels
        mask: how the second derivatives are taken; default "four"
        sigma: standard deviation of the mask gaussian; at least 0.5, at most 100; px; default 1.5
        scale: factor on the result; at least -1000000, at most 1000000; default 1.0
        border: how the image continues beyond its edges; default "reflect"
        value: what lies beyond a constant border; default 0.0
        method: direct
        """
        return self.run("laplacian", image, mask=mask, sigma=sigma, scale=scale, border=border, value=value, **options)

    def lens_distort(
        self,
        image: ImageLike,
        /,
        *,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        width: int | None = None,
        height: int | None = None,
        model: Literal["brown_conrady", "division", "kannala_brandt"] | None = None,
        direction: Literal["distort", "undistort"] | None = None,
        k: Numbers | None = None,
        p: Numbers | None = None,
        focal: float | None = None,
        centre: Numbers | None = None,
        points: float | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Takes the distortion of a lens out of an image, or puts it in.

        image: a picture or data, any number of channels
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        width: columns of the result; the image's if left out; at least 1, at most 16384
        height: rows of the result; the image's if left out; at least 1, at most 16384
        model: the formula; default "brown_conrady"
        direction: whether the bend is taken out or put in; default "undistort"
        k: radial coefficients, of even powers from the square up; default [-0.1]
        p: tangential coefficients of brown_conrady; default [0.0, 0.0]
        focal: focal length; half the diagonal if left out; at least 0.001, at most 1000000; px
        centre: of the distortion; shares of width and height; default [0.5, 0.5]
        points: samples along each axis of an ellipse; 2 to 16; a knob
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        method: nearest, bilinear, bicubic, mitchell, bspline, lanczos2, lanczos3, mip, supersampled, ewa
        """
        return self.run(
            "lens_distort",
            image,
            border=border,
            value=value,
            width=width,
            height=height,
            model=model,
            direction=direction,
            k=k,
            p=p,
            focal=focal,
            centre=centre,
            points=points,
            samples=samples,
            **options,
        )

    def levels(
        self,
        image: ImageLike,
        /,
        *,
        black: float | Numbers | None = None,
        white: float | Numbers | None = None,
        gamma: float | Numbers | None = None,
        out_black: float | Numbers | None = None,
        out_white: float | Numbers | None = None,
        centre: float | None = None,
        width: float | None = None,
        clamp: bool | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Brings a black and a white level to others, with a gamma between: scale, bias, window and contrast.

        image: a picture or data; its coverage channel, if it has one, passes unchanged
        black: what becomes out_black; one number, or one for each colour channel; at least -1000000000, at most
            1000000000; default 0.0
        white: what becomes out_white; not black; at least -1000000000, at most 1000000000; default 1.0
        gamma: between the levels, t^(1 / gamma): above 1 lifts the middle; 0.01 to 100; default 1.0
        out_black: the result at black; at least -1000000000, at most 1000000000; default 0.0
        out_white: the result at white; at least -1000000000, at most 1000000000; default 1.0
        centre: middle of the window; with width, in place of black and white; at least -1000000000, at most
            1000000000
        width: width of the window; above 0, at most 1000000000
        clamp: whether what lies outside the levels is brought to them; default false
        method: exact
        """
        return self.run(
            "levels",
            image,
            black=black,
            white=white,
            gamma=gamma,
            out_black=out_black,
            out_white=out_white,
            centre=centre,
            width=width,
            clamp=clamp,
            **options,
        )

    def lic(
        self,
        field: ImageLike,
        /,
        *,
        texture: ImageLike = None,
        later: ImageLike = None,
        mask: ImageLike = None,
        length: float | None = None,
        kernel: Literal["box", "hann", "cosine", "gaussian", "ripple"] | None = None,
        ripples: int | None = None,
        phase: float | None = None,
        frames: int | None = None,
        oriented: bool | None = None,
        speed: Literal["arc", "field"] | None = None,
        scale: float | None = None,
        bias: float | None = None,
        time: float | None = None,
        interval: float | None = None,
        border: Literal["end", "wrap"] | None = None,
        field_sampling: Literal["nearest", "bilinear", "cubic"] | None = None,
        sampling: Literal["nearest", "bilinear", "cubic"] | None = None,
        enhance: float | None = None,
        contrast: float | None = None,
        colour: Literal["none", "viridis", "magma", "cividis"] | None = None,
        fastest: float | None = None,
        seed: int | None = None,
        grain: float | None = None,
        density: float | None = None,
        step: float | None = None,
        tolerance: float | None = None,
        distance: float | None = None,
        bits: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Line integral convolution: smears a texture, or noise, along the lines of a vector field.

        field: vectors: x to the right, y down; further channels are not read
        texture: what is smeared; covers the field's rectangle. White noise by default
        later: the field at the end of the interval
        mask: where it is below 1/2 there is no field
        length: how far to follow the line each way; at least 0, at most 1000; px; default 20.0
        kernel: weights along the line; default "box"
        ripples: waves of the kernel ripple over the whole line; at least 1, at most 64; default 2
        phase: of the kernel ripple, in turns; at least -1, at most 1; default 0.0
        frames: pictures of an animation, one below the other: the phase makes one turn over them, and the time goes
            from `time` to the second slice; at least 1, at most 256; default 1
        oriented: weights grow towards where the line comes from: drops become comets; default false
        speed: line by arc length, or by time (length is then in units of time); default "arc"
        scale: v = (c - bias) * scale; 2 for fields stored in [0, 1]; at least -1000000, at most 1000000; default 1.0
        bias: the stored value of a zero component; 0.50196 (128 / 255) or 0.5; at least -1000000, at most 1000000;
            default 0.0
        time: between the slices `field` (0) and `later` (1); at least 0, at most 1; default 0.0
        interval: time from one slice to the other, for speed=field: lines are those of particles in the changing
            field; 0: of the field as it stands at `time`; at least 0, at most 1000000; default 0.0
        border: where lines go at the border; default "end"
        field_sampling: what lies between the vectors of pixels; default "bilinear"
        sampling: what lies between the texels; default "bilinear"
        enhance: smears twice, and sharpens between: adds so much of the difference from the mean of 3 x 3; 9 is
            customary, 0 smears once; at least 0, at most 16; default 0.0
        contrast: for display only: brings the mean to 1/2 and the standard deviation to this, and cuts at 0 and 1; 0
            leaves values as they are; at least 0, at most 1; default 0.0
        colour: colours by the length of the vector; the picture is their brightness; default "none"
        fastest: length at the end of the map; 0: the longest of the field; at least 0, at most 1e+30; default 0.0
        seed: of the white noise that stands in for a missing texture; at least 0, at most 4294967295; default 0
        grain: of that noise; at least 1, at most 64; px; default 1.0
        density: of drops: below 1, so many of its grains are 1 and the others are 0; above 0, at most 1; default 1.0
        step: longest step along the line, px (units of time for speed=field); 0.125 to 8; a knob
        tolerance: error of a step along the line, px; 0.0001 to 1; a knob
        distance: from a line to the centres of the pixels it serves, px; 0.03 to 0.5; a knob
        bits: of a stored position or vector; 4 to 16; a knob
        method: nearest, euler, rk2, rk4, rk45, fastlic, fixed
        """
        return self.run(
            "lic",
            field,
            texture=texture,
            later=later,
            mask=mask,
            length=length,
            kernel=kernel,
            ripples=ripples,
            phase=phase,
            frames=frames,
            oriented=oriented,
            speed=speed,
            scale=scale,
            bias=bias,
            time=time,
            interval=interval,
            border=border,
            field_sampling=field_sampling,
            sampling=sampling,
            enhance=enhance,
            contrast=contrast,
            colour=colour,
            fastest=fastest,
            seed=seed,
            grain=grain,
            density=density,
            step=step,
            tolerance=tolerance,
            distance=distance,
            bits=bits,
            **options,
        )

    def lighting(
        self,
        normal: ImageLike,
        /,
        *,
        position: ImageLike = None,
        albedo: ImageLike = None,
        specular: ImageLike = None,
        roughness: ImageLike = None,
        tangent: ImageLike = None,
        visibility: ImageLike = None,
        slide: ImageLike = None,
        slab: ImageLike = None,
        tiles: ImageLike = None,
        lights: Numbers | None = None,
        model: Literal[
            "lambert", "phong", "blinn_phong", "cosine_lobe", "lafortune", "torrance_sparrow", "ward", "banks"
        ]
        | None = None,
        diffuse: Numbers | None = None,
        highlight: Numbers | None = None,
        facet_roughness: float | None = None,
        exponent: float | None = None,
        index: float | None = None,
        distribution: Literal["gaussian", "beckmann", "ggx"] | None = None,
        masking: Literal["v_groove", "smith"] | None = None,
        grain: Numbers | None = None,
        stretch: float | None = None,
        lobe: Numbers | None = None,
        eye: Numbers | None = None,
        view: Numbers | None = None,
        local_viewer: bool | None = None,
        effect: int | None = None,
        faint: float | None = None,
        size: float | None = None,
        share: float | None = None,
        step: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Lights surfaces given by their normals: lamps of six kinds, eight models of reflection.

        normal: which way surfaces face: x, y, z of any length
        position: where surfaces are: x, y, z
        albedo: diffuse colour, or grey
        specular: colour of highlights, or grey
        roughness: of the facets, 0 to 1
        tangent: which way the grain goes: x, y, z of any length
        visibility: share of each lamp that is seen, 1 where nothing is in the way
        slide: what projectors show; of any size
        slab: what leaves slabs: a sheet of pictures, one for each of their cells
        tiles: what is left out in squares of 32 px: the lamp where the channel `effect` is more than 0; of any size
        lights: the lamps, each by its kind (directional, point, spot, area, projector, slab), colour, intensity and
            place; default [{"kind": "directional", "position": [0.0, 0.0, 0.0], "direction": [-1.0, -1.0, -2.0],
            "up": [0.0, 1.0, 0.0], "colour": [1.0, 1.0, 1.0], "intensity": 1.0, "radius": 0.05, "nearest": 0.0,
            "falloff": [0.0, 0.0, 1.0], "inner": 30.0, "outer": 45.0, "size": [1.0, 1.0], "samples": 16, "fov": 45.0,
            "aspect": 1.0, "cells": [8, 8], "lit": null, "distance": null}]
        model: how the surface reflects besides diffusely; default "torrance_sparrow"
        diffuse: share of light that is reflected diffusely, linear; times the input albedo; default [0.8, 0.8, 0.8]
        highlight: factor on highlights, linear; times the input specular; 0 leaves them out; default [1.0, 1.0, 1.0]
        facet_roughness: where there is no input roughness; its square is the slope of facets; less than 0.05 is taken
            as that; at least 0, at most 1; default 0.4
        exponent: of the models that are powers of a cosine, in place of the one from the roughness; at least 1, at
            most 100000
        index: of refraction, for torrance_sparrow; null: all is reflected; at least 1, at most 1000; default 1.5
        distribution: of the facets of torrance_sparrow; default "ggx"
        masking: how facets of torrance_sparrow hide one another; default "smith"
        grain: its direction for ward, lafortune and banks, where there is no input tangent; default [1.0, 0.0, 0.0]
        stretch: for ward: how much rougher the surface is along the grain than on the mean, and smoother across it;
            at least 0.1, at most 10; default 1.0
        lobe: for lafortune: factors along the grain, across it and along the normal; -1, -1, 1 mirrors; default
            [-1.0, -1.0, 1.0]
        eye: where the viewer is; default [0.0, 0.0, 0.0]
        view: the direction towards a viewer at infinity; default [0.0, 0.0, 1.0]
        local_viewer: whether the viewer is at `eye`, given positions, or at infinity; default true
        effect: the channel of `tiles` that is about the first lamp; the others follow; at least 0, at most 4095;
            default 0
        faint: what `tiles` leave out of the light of a pixel at most: it counts as an error; at least 0, at most
            1000000; default 0.0
        size: entries of each table; 4 to 4096; a knob
        share: of the discs that make up areas; 0.000976562 to 1; a knob
        step: px between those that are lit: the nearest power of 2; 1 to 64; a knob
        method: tables, schlick, sparse, coarse, exact
        """
        return self.run(
            "lighting",
            normal,
            position=position,
            albedo=albedo,
            specular=specular,
            roughness=roughness,
            tangent=tangent,
            visibility=visibility,
            slide=slide,
            slab=slab,
            tiles=tiles,
            lights=lights,
            model=model,
            diffuse=diffuse,
            highlight=highlight,
            facet_roughness=facet_roughness,
            exponent=exponent,
            index=index,
            distribution=distribution,
            masking=masking,
            grain=grain,
            stretch=stretch,
            lobe=lobe,
            eye=eye,
            view=view,
            local_viewer=local_viewer,
            effect=effect,
            faint=faint,
            size=size,
            share=share,
            step=step,
            **options,
        )

    def mask(
        self,
        image: ImageLike,
        /,
        *,
        counter: ImageLike = None,
        test: Literal["never", "always", "less", "at_most", "equal", "at_least", "greater", "unequal"] | None = None,
        against: Literal["reference", "counter"] | None = None,
        reference: float | None = None,
        channel: int | None = None,
        on_pass: Literal["keep", "zero", "replace", "increment", "decrement", "invert"] | None = None,
        on_fail: Literal["keep", "zero", "replace", "increment", "decrement", "invert"] | None = None,
        write: Literal["value", "image"] | None = None,
        value: float | None = None,
        bits: int | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Tests pixels for masks, counters and priorities: thresholds, logic of masks, layers counted.

        image: what is tested, as it is stored
        counter: masks or counters so far
        test: what the image's value must be; default "at_least"
        against: compared with what; default "reference"
        reference: what it is compared with; at least -1e+30, at most 1e+30; default 0.5
        channel: the channel of the image that is tested, from 0; at least 0, at most 63; default 0
        on_pass: what becomes of the counter where the test passes; default "replace"
        on_fail: and where it does not; default "keep"
        write: what replaces: value, or the image's own; default "value"
        value: what replaces counters; at least -1e+30, at most 1e+30; default 1.0
        bits: counters end at 2^bits - 1; at least 1, at most 24; default 8
        method: exact
        """
        return self.run(
            "mask",
            image,
            counter=counter,
            test=test,
            against=against,
            reference=reference,
            channel=channel,
            on_pass=on_pass,
            on_fail=on_fail,
            write=write,
            value=value,
            bits=bits,
            **options,
        )

    def matrix(self, image: ImageLike, /, *, matrix: Numbers | None = None, **options: Unpack[Options]) -> R:
        """Mixes the channels of every pixel by a matrix, with an addition if wanted.

        image: the picture; channels after the matrix's pass unchanged
        matrix: rows of factors, 3x3 or 4x4; or 3x4 or 4x5, whose last column is added; default [[1, 0, 0], [0, 1, 0],
            [0, 0, 1]]
        method: exact
        """
        return self.run("matrix", image, matrix=matrix, **options)

    def median(
        self,
        image: ImageLike,
        /,
        *,
        mask: ImageLike = None,
        size: Literal[1, 3, 5, 7, 9, 11, 13, 15] | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        missing: Literal["spread", "skip", "inside"] | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Middle value of a square window: removes outliers and keeps edges.

        image: a picture or data
        mask: which pixels take part, one channel: those where it is not 0
        size: rows and columns of the window, odd; px; default 3
        border: how the image continues beyond its edges; default "reflect"
        value: what lies beyond a constant border; default 0.0
        missing: what becomes of samples that are NaN or infinite; default "spread"
        method: network, bisect
        """
        return self.run("median", image, mask=mask, size=size, border=border, value=value, missing=missing, **options)

    def mesh(
        self,
        image: ImageLike,
        /,
        *,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        width: int | None = None,
        height: int | None = None,
        grid: Numbers | None = None,
        relative: bool | None = None,
        patches: Literal["bilinear", "bicubic"] | None = None,
        points: float | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Bends an image by a grid of control points, with bilinear or bicubic patches.

        image: a picture or data, any number of channels
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        width: columns of the result; the image's if left out; at least 1, at most 16384
        height: rows of the result; the image's if left out; at least 1, at most 16384
        grid: rows of [x, y], all of one length, px; default [[[0.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]]
        relative: whether x and y count from where a plain stretch looks; default true
        patches: how places between nodes follow from them; default "bicubic"
        points: samples along each axis of an ellipse; 2 to 16; a knob
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        method: nearest, bilinear, bicubic, mitchell, bspline, lanczos2, lanczos3, mip, supersampled, ewa
        """
        return self.run(
            "mesh",
            image,
            border=border,
            value=value,
            width=width,
            height=height,
            grid=grid,
            relative=relative,
            patches=patches,
            points=points,
            samples=samples,
            **options,
        )

    def mix(
        self,
        image: ImageLike,
        /,
        *,
        base: ImageLike = None,
        amount: float | None = None,
        preset: Literal["brightness", "contrast", "saturation", "sharpen"] | None = None,
        weights: Numbers | None = None,
        sigma: float | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        tail: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Blends two pictures or exaggerates their difference: brightness, contrast, saturation and sharpness.

        image: the picture at amount 1
        base: the picture at amount 0, of the same size and channels
        amount: 0 is the base, 1 the image; beyond either extrapolates; at least -100, at most 100; default 0.5
        preset: a base made of the image itself, in place of the input base
        weights: of red, green and blue in luminance, for contrast and saturation: not negative, together 1; those of
            BT.709; default [0.2126, 0.7152, 0.0722]
        sigma: standard deviation of the blur, for preset=sharpen; at least 0, at most 1000; px; default 1.0
        border: how the image continues, for preset=sharpen; constant is 0; default "reflect"
        tail: weight that the blur cuts off; 1e-09 to 0.5; a knob
        method: direct, fir, dct
        """
        return self.run(
            "mix",
            image,
            base=base,
            amount=amount,
            preset=preset,
            weights=weights,
            sigma=sigma,
            border=border,
            tail=tail,
            **options,
        )

    def morphology(
        self,
        image: ImageLike,
        /,
        *,
        mask: ImageLike = None,
        step: Literal["erode", "dilate", "open", "close", "gradient", "tophat", "blackhat"] | None = None,
        width: int | None = None,
        height: int | None = None,
        anchor: Numbers | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        missing: Literal["spread", "skip", "inside"] | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Erosion and dilation by a rectangle, opening, closing, gradient and hats.

        image: a picture or data, any number of channels
        mask: which pixels take part, one channel: those where it is not 0
        step: what is computed; default "dilate"
        width: columns of the rectangle; at least 1, at most 4095; px; default 3
        height: rows of the rectangle; at least 1, at most 4095; px; default 3
        anchor: column and row of the rectangle that lies over the output pixel; its middle if left out
        border: how the image continues beyond its edges; default "reflect"
        value: what lies beyond a constant border; default 0.0
        missing: what becomes of samples that are NaN or infinite; default "spread"
        method: blocks
        """
        return self.run(
            "morphology",
            image,
            mask=mask,
            step=step,
            width=width,
            height=height,
            anchor=anchor,
            border=border,
            value=value,
            missing=missing,
            **options,
        )

    def motion_blur(
        self,
        image: ImageLike,
        /,
        *,
        motion: ImageLike,
        shutter: float | None = None,
        start: float | None = None,
        largest: float | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Blurs every pixel along its own motion vector while a shutter is open.

        image: a picture
        motion: px to the right and down that each pixel moves in a frame
        shutter: how long it is open, in frames; at least 0.001, at most 4; default 1.0
        start: when it opens, in frames from the picture's own time; at least -4, at most 4; default -0.5
        largest: longer motions are shortened to this; above 0, at most 1024; px; default 64.0
        border: how the picture continues beyond its edges; default "clamp"
        value: what lies beyond a constant border, in every channel; at least -1000000000, at most 1000000000; default
            0.0
        samples: bilinear samples along each path; 2 to 256; a knob
        method: exact, sampled
        """
        return self.run(
            "motion_blur",
            image,
            motion=motion,
            shutter=shutter,
            start=start,
            largest=largest,
            border=border,
            value=value,
            samples=samples,
            **options,
        )

    def normal_map(
        self,
        height: ImageLike,
        /,
        *,
        mask: Literal["central", "sobel", "gaussian"] | None = None,
        sigma: float | None = None,
        scale: float | None = None,
        encoding: Literal["signed", "unit"] | None = None,
        convention: Literal["opengl", "directx"] | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Makes a normal map of heights: central differences, Sobel, or the derivative of a Gaussian.

        height: heights, in one channel
        mask: central differences, sobel, or the derivative of a gaussian over 7 x 7; default "sobel"
        sigma: standard deviation of the gaussian; at least 0.3, at most 3; px; default 1.0
        scale: px; how high the value 1 is; negative presses the relief in; at least -1000000, at most 1000000;
            default 4.0
        encoding: signed: components from -1 to 1; unit: from 0 to 1; default "signed"
        convention: opengl: y points up; directx: down; default "opengl"
        border: how heights continue beyond the edges; default "clamp"
        value: height beyond a constant border; at least -1000000, at most 1000000; default 0.0
        method: exact
        """
        return self.run(
            "normal_map",
            height,
            mask=mask,
            sigma=sigma,
            scale=scale,
            encoding=encoding,
            convention=convention,
            border=border,
            value=value,
            **options,
        )

    def normals(
        self,
        image: ImageLike,
        /,
        *,
        detail: ImageLike = None,
        source: Literal["signed", "unit"] | None = None,
        target: Literal["signed", "unit"] | None = None,
        source_convention: Literal["opengl", "directx"] | None = None,
        target_convention: Literal["opengl", "directx"] | None = None,
        renormalise: bool | None = None,
        blend: Literal["linear", "partial", "whiteout", "udn", "reoriented"] | None = None,
        amount: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Decodes, encodes, turns, renormalises and blends normal maps.

        image: normals: x, y, z
        detail: normals of a detail to be laid on, stored as the image's are
        source: how the inputs' components are stored: unit, 0 to 1, or signed; default "unit"
        target: how those of the result are; default "signed"
        source_convention: which way y points in the inputs: opengl, up, or directx, down; default "opengl"
        target_convention: which way it points in the result; default "opengl"
        renormalise: whether lengths are brought to 1; what is blended always is; default true
        blend: how the input detail is laid on; default "reoriented"
        amount: factor on the detail's slopes; at least -100, at most 100; default 1.0
        method: exact
        """
        return self.run(
            "normals",
            image,
            detail=detail,
            source=source,
            target=target,
            source_convention=source_convention,
            target_convention=target_convention,
            renormalise=renormalise,
            blend=blend,
            amount=amount,
            **options,
        )

    def ocio(
        self,
        image: ImageLike,
        /,
        *,
        config: str | None = None,
        source: str | None = None,
        target: str | None = None,
        looks: str | None = None,
        display: str | None = None,
        view: str | None = None,
        inverse: bool | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Applies a conversion, look or view of an OpenColorIO configuration.

        image: the picture; channels after the third pass unchanged
        config: a built-in configuration as ocio://name, the text of one, or an archive (.ocioz) in base64; default
            "ocio://default"
        source: the colour space, or role, of the picture's numbers; default "scene_linear"
        target: the colour space or role to convert to; or give display and view
        looks: looks on the way to target, as OpenColorIO writes them: a, +b, -c
        display: the display to show it on
        view: the view of that display
        inverse: the other way round: from the target, or the display, to source; default false
        method: exact
        """
        return self.run(
            "ocio",
            image,
            config=config,
            source=source,
            target=target,
            looks=looks,
            display=display,
            view=view,
            inverse=inverse,
            **options,
        )

    def outline(
        self,
        image: ImageLike,
        /,
        *,
        width: float | None = None,
        jump: float | None = None,
        front: Literal["larger", "smaller"] | None = None,
        side: Literal["inside", "outside", "both"] | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Draws silhouettes and halos from a mask or a depth.

        image: a mask or a depth: its first channel, as it is stored
        width: how far from an edge pixels are drawn; at least 1, at most 32; px; default 1.0
        jump: differences above it are edges; at least 0, at most 1e+30; default 0.5
        front: larger values are in front, as in a mask, or smaller ones, as in most depths; default "larger"
        side: inside: the silhouette; outside: a halo; or both; default "inside"
        method: exact
        """
        return self.run("outline", image, width=width, jump=jump, front=front, side=side, **options)

    def panorama(
        self,
        image: ImageLike,
        /,
        *,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        width: int | None = None,
        height: int | None = None,
        source: Literal["latlong", "cube", "cube_cross", "cube_pages", "mirror_ball", "paraboloid", "fisheye"]
        | None = None,
        target: Literal["latlong", "cube", "cube_cross", "cube_pages", "mirror_ball", "paraboloid", "fisheye"]
        | None = None,
        view: float | None = None,
        yaw: float | None = None,
        pitch: float | None = None,
        roll: float | None = None,
        points: float | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Converts images of all directions: lat-long, cubes, mirror ball, dual paraboloid, fisheye; any to any.

        image: a picture or data, any number of channels
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        width: columns of the result; the image's if left out; at least 1, at most 16384
        height: rows of the result; the image's if left out; at least 1, at most 16384
        source: what the image is; default "latlong"
        target: what the result is; default "cube"
        view: across a fisheye; at least 1, at most 360; deg; default 180.0
        yaw: how far to the right to look; at least -100000, at most 100000; deg; default 0.0
        pitch: how far up; at least -100000, at most 100000; deg; default 0.0
        roll: how far to tilt clockwise; at least -100000, at most 100000; deg; default 0.0
        points: samples along each axis of an ellipse; 2 to 16; a knob
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        method: nearest, bilinear, bicubic, mitchell, bspline, lanczos2, lanczos3, mip, supersampled, ewa
        """
        return self.run(
            "panorama",
            image,
            border=border,
            value=value,
            width=width,
            height=height,
            source=source,
            target=target,
            view=view,
            yaw=yaw,
            pitch=pitch,
            roll=roll,
            points=points,
            samples=samples,
            **options,
        )

    def parallax(
        self,
        image: ImageLike,
        /,
        *,
        height: ImageLike,
        mode: Literal["limited", "divided", "march"] | None = None,
        view: Numbers | None = None,
        scale: float | None = None,
        reference: float | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        levels: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Moves a picture as its relief would be seen from aside: limited, divided, or by following rays.

        image: a picture of the surface from straight above
        height: its heights, from 0 to 1
        mode: limited, divided or march; default "march"
        view: direction to the viewer: x to the right, y up, z out of the surface, which is above 0; default [0.5,
            0.5, 1.0]
        scale: how high the height 1 is; for march not below 0; at least -1000, at most 1000; px; default 8.0
        reference: the height that stays in place; at least 0, at most 1; default 0.0
        border: how picture and heights continue beyond their edges; default "clamp"
        value: what lies beyond a constant border of the picture; heights are 0 there; at least -1000000, at most
            1000000; default 0.0
        levels: heights at which a ray looks at the relief; 2 to 256; a knob
        method: shift, march
        """
        return self.run(
            "parallax",
            image,
            height=height,
            mode=mode,
            view=view,
            scale=scale,
            reference=reference,
            border=border,
            value=value,
            levels=levels,
            **options,
        )

    def perlin_noise(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        seed: int | None = None,
        low: float | None = None,
        high: float | None = None,
        cell: float | Numbers | None = None,
        x: float | None = None,
        y: float | None = None,
        tile: bool | None = None,
        fractal: Literal["none", "fbm", "turbulence", "billow", "ridged"] | None = None,
        octaves: int | None = None,
        lacunarity: float | None = None,
        gain: float | None = None,
        antialias: bool | None = None,
        warp: float | None = None,
        dimensions: int | None = None,
        z: float | None = None,
        w: float | None = None,
        loop: int | None = None,
        output: Literal["value", "derivatives"] | None = None,
        fade: Literal["quintic", "cubic"] | None = None,
        tail: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Perlin noise: octaves of smooth gradient noise, tileable, in two to four dimensions, with derivatives.

        width: of the picture; at least 1, at most 16384; px; default 512
        height: of the picture; at least 1, at most 16384; px; default 512
        seed: which of the noises; at least 0, at most 4294967295; default 0
        low: what noise of -1 becomes; at least -1000000, at most 1000000; default 0.0
        high: what noise of +1 becomes; at least -1000000, at most 1000000; default 1.0
        cell: side of a cell, or its sides along x and y; at least 1e-06, at most 1000000; px; default 64.0
        x: of the picture's left edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        y: of the picture's upper edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        tile: whether the picture repeats without a seam; a whole number of cells is fitted into it; default false
        fractal: how octaves are summed; default "fbm"
        octaves: octaves at most; 0 gives the middle; at least 0, at most 30; default 6
        lacunarity: from one octave's frequency to the next one's; at least 1, at most 16; default 2.0
        gain: from one octave's amplitude to the next one's; lacunarity^-H; at least 0, at most 8; default 0.5
        antialias: whether octaves that pixels cannot show are replaced by their mean, the last one fading; default
            true
        warp: how far places are moved by two more such noises; at least 0, at most 16384; px; default 0.0
        dimensions: of the noise; beyond two, the picture is a slice at z and w; at least 2, at most 4; default 2
        z: third coordinate, in cells: time, or depth; at least -1000000000, at most 1000000000; default 0.0
        w: fourth coordinate, in cells; at least -1000000000, at most 1000000000; default 0.0
        loop: cells of z after which the noise comes again; 0: never; at least 0, at most 65536; default 0
        output: the noise alone, or its derivatives with it; default "value"
        fade: how values give way from corner to corner of a cell; default "quintic"
        tail: share of the output's range that octaves may be left out for; 0 to 0.5; a knob
        method: single, double
        """
        return self.run(
            "perlin_noise",
            width=width,
            height=height,
            seed=seed,
            low=low,
            high=high,
            cell=cell,
            x=x,
            y=y,
            tile=tile,
            fractal=fractal,
            octaves=octaves,
            lacunarity=lacunarity,
            gain=gain,
            antialias=antialias,
            warp=warp,
            dimensions=dimensions,
            z=z,
            w=w,
            loop=loop,
            output=output,
            fade=fade,
            tail=tail,
            **options,
        )

    def pixel_texture(
        self,
        image: ImageLike,
        /,
        *,
        texture: ImageLike,
        dimensions: int | None = None,
        depth: int | None = None,
        fourth: int | None = None,
        filter: Literal["nearest", "linear", "cubic"] | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | Numbers | None = None,
        background: float | None = None,
        units: Literal["unit", "texel"] | None = None,
        scale: float | Numbers | None = None,
        bias: float | Numbers | None = None,
        before: Numbers | None = None,
        matrix: Numbers | None = None,
        after: Numbers | None = None,
        projective: bool | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Takes every pixel's channels as coordinates into a texture of one to four dimensions.

        image: coordinates, as they are stored; channels after the fourth are not read
        texture: what is looked up: slices one below the other
        dimensions: axes of the texture; at least 1, at most 4; default 2
        depth: size of the third axis: slices that lie one below the other; at least 1, at most 4096; default 1
        fourth: size of the fourth axis: stacks of slices that lie one below the other; at least 1, at most 4096;
            default 1
        filter: nearest, linear or cubic; default "linear"
        border: how the texture goes on beyond its ends; one, or one for each axis; default "clamp"
        background: the value beyond a constant border, and behind the projector; at least -1000000, at most 1000000;
            default 0.0
        units: unit: coordinates run from 0 to 1 over the texture; texel: they count texels; default "unit"
        scale: what channels are multiplied by; at least -1000000, at most 1000000; default 1.0
        bias: what is added to them; at least -1000000, at most 1000000; default 0.0
        before: tables before the matrix, of one length: one for all channels, or one for each
        matrix: a row for each coordinate: factors of up to 4 channels; a fifth number is added
        after: tables after the matrix: one for all coordinates, or one for each
        projective: whether the coordinate after the last divides the others; up to 3 axes; default false
        method: exact, single
        """
        return self.run(
            "pixel_texture",
            image,
            texture=texture,
            dimensions=dimensions,
            depth=depth,
            fourth=fourth,
            filter=filter,
            border=border,
            background=background,
            units=units,
            scale=scale,
            bias=bias,
            before=before,
            matrix=matrix,
            after=after,
            projective=projective,
            **options,
        )

    def planar_shadow(
        self,
        matte: ImageLike,
        /,
        *,
        depth: ImageLike,
        fov: float | None = None,
        depth_kind: Literal["planar", "euclidean", "window", "reversed"] | None = None,
        near: float | None = None,
        far: float | None = None,
        light: Numbers | None = None,
        parallel: bool | None = None,
        extent: Numbers | None = None,
        samples: int | None = None,
        centre: Numbers | None = None,
        direction: Numbers | None = None,
        up: Numbers | None = None,
        size: Numbers | None = None,
        share: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Throws the shadow of a flat thing, given by a picture of its outline, on what is behind it.

        matte: how much of the light each point of the thing holds back, 0 to 1
        depth: how far from the camera each pixel is, or, of three channels, where
        fov: the camera's vertical angle of view; at least 0.01, at most 175; deg; default 50.0
        depth_kind: planar: along the viewing direction; euclidean: from the eye; window: 0 at near, 1 at far;
            reversed: 1 to 0; default "planar"
        near: of a window's depth; above 0, at most 1000000000; default 0.1
        far: of a window's depth; none: infinitely far; above 0, at most 1000000000000
        light: where the light is, in the axes of the positions, or of the camera; default [3.0, 5.0, 0.0]
        parallel: whether it shines from there, infinitely far away; default false
        extent: the light's width and height; default [0.0, 0.0]
        samples: points that stand for a light with extent, at least; at least 1, at most 1024; default 16
        centre: the middle of the flat thing; default [0.0, 1.0, -5.0]
        direction: across it; default [0.0, 0.0, 1.0]
        up: what is upwards in its picture; default [0.0, 1.0, 0.0]
        size: its width and height; default [1.0, 1.0]
        share: of the points of a light with extent; 0.000976562 to 1; a knob
        method: sparse, exact
        """
        return self.run(
            "planar_shadow",
            matte,
            depth=depth,
            fov=fov,
            depth_kind=depth_kind,
            near=near,
            far=far,
            light=light,
            parallel=parallel,
            extent=extent,
            samples=samples,
            centre=centre,
            direction=direction,
            up=up,
            size=size,
            share=share,
            **options,
        )

    def polar(
        self,
        image: ImageLike,
        /,
        *,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        width: int | None = None,
        height: int | None = None,
        direction: Literal["forward", "inverse"] | None = None,
        log: bool | None = None,
        centre: Numbers | None = None,
        inner: float | None = None,
        outer: float | None = None,
        start: float | None = None,
        points: float | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Turns circles into rows and rays into columns, linear or logarithmic, and back.

        image: a picture or data, any number of channels
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        width: columns of the result; the image's if left out; at least 1, at most 16384
        height: rows of the result; the image's if left out; at least 1, at most 16384
        direction: to polar coordinates, or back from them; default "forward"
        log: whether rows are even in the logarithm of the radius; default false
        centre: shares of the picture's width and height; default [0.5, 0.5]
        inner: radius of the upper edge, px; at least 0, at most 1000000; px
        outer: radius of the lower edge, px; above 0, at most 1000000; px
        start: angle of the left edge; at least -100000, at most 100000; deg; default 0.0
        points: samples along each axis of an ellipse; 2 to 16; a knob
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        method: nearest, bilinear, bicubic, mitchell, bspline, lanczos2, lanczos3, mip, supersampled, ewa
        """
        return self.run(
            "polar",
            image,
            border=border,
            value=value,
            width=width,
            height=height,
            direction=direction,
            log=log,
            centre=centre,
            inner=inner,
            outer=outer,
            start=start,
            points=points,
            samples=samples,
            **options,
        )

    def prefilter(
        self,
        image: ImageLike,
        /,
        *,
        chart: Literal["latlong", "cube", "cube_cross", "cube_pages", "mirror_ball", "paraboloid", "fisheye"]
        | None = None,
        lobe: Literal["diffuse", "phong", "ggx"] | None = None,
        exponent: float | None = None,
        roughness: float | None = None,
        target: Literal["latlong", "cube", "cube_cross", "cube_pages", "mirror_ball", "paraboloid", "fisheye"]
        | None = None,
        width: int | None = None,
        height: int | None = None,
        texels: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Blurs an environment by what a matt, glossy or rough surface sees of it.

        image: light from all directions, as `chart` says
        chart: how the image holds all directions; default "latlong"
        lobe: by what the light about a direction is weighted; default "diffuse"
        exponent: of a phong lobe; at least 0.01, at most 10000; default 50.0
        roughness: of a ggx lobe; at least 0.01, at most 1; default 0.3
        target: how the result holds all directions; default "latlong"
        width: columns of the result; by the target if left out; at least 1, at most 4096
        height: rows of the result; by the target if left out; at least 1, at most 4096
        texels: blocks that the image is put together to; 6 to 1e+06; a knob
        method: all, reduced
        """
        return self.run(
            "prefilter",
            image,
            chart=chart,
            lobe=lobe,
            exponent=exponent,
            roughness=roughness,
            target=target,
            width=width,
            height=height,
            texels=texels,
            **options,
        )

    def premultiply(self, image: ImageLike, /, *, inverse: bool | None = None, **options: Unpack[Options]) -> R:
        """Multiply colour by coverage (associated alpha), or divide it out again.

        image: a picture whose last channel is coverage
        inverse: from associated to straight instead; default false
        method: exact
        """
        return self.run("premultiply", image, inverse=inverse, **options)

    def pyramid(
        self,
        image: ImageLike,
        /,
        *,
        kernel: Literal["box", "binomial", "kaiser"] | None = None,
        level: int | None = None,
        layout: Literal["level", "atlas"] | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Halves an image again and again, by box, binomial or Kaiser weights: one level, or all of them.

        image: a picture or data, any number of channels
        kernel: the weights of a halving; default "binomial"
        level: how often the image is halved; no further than to one pixel; at least 0, at most 15; default 1
        layout: that level alone, or all of them beside one another; default "level"
        border: how the image continues beyond its edges; default "clamp"
        value: what lies beyond a constant border; default 0.0
        method: single, double
        """
        return self.run(
            "pyramid", image, kernel=kernel, level=level, layout=layout, border=border, value=value, **options
        )

    def quantise(
        self,
        image: ImageLike,
        /,
        *,
        levels: int | None = None,
        low: float | None = None,
        high: float | None = None,
        dither: Literal["none", "bayer", "blue_noise", "error_diffusion"] | None = None,
        side: Literal[2, 4, 8, 16] | None = None,
        diffusion: Literal["floyd_steinberg", "jarvis", "stucki", "atkinson"] | None = None,
        strength: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Rounds to few levels, with ordered, blue-noise or error-diffusion dither.

        image: a picture or data; its coverage channel, if it has one, passes unchanged
        levels: how many values remain, evenly spaced from low to high; at least 2, at most 65536; default 2
        low: the lowest level; at least -1000000, at most 1000000; default 0.0
        high: the highest level; above low; at least -1000000, at most 1000000; default 1.0
        dither: none, an ordered matrix, a blue-noise mask, or error diffusion; default "blue_noise"
        side: of the ordered matrix, in pixels, for dither=bayer; default 8
        diffusion: the weights, for dither=error_diffusion; default "floyd_steinberg"
        strength: how much of the dither: 0 is none; at least 0, at most 1; default 1.0
        method: exact
        """
        return self.run(
            "quantise",
            image,
            levels=levels,
            low=low,
            high=high,
            dither=dither,
            side=side,
            diffusion=diffusion,
            strength=strength,
            **options,
        )

    def reduced_lighting(
        self,
        normal: ImageLike,
        /,
        *,
        position: ImageLike = None,
        albedo: ImageLike = None,
        specular: ImageLike = None,
        roughness: ImageLike = None,
        lights: Numbers | None = None,
        model: Literal[
            "lambert", "phong", "blinn_phong", "cosine_lobe", "lafortune", "torrance_sparrow", "ward", "banks"
        ]
        | None = None,
        diffuse: Numbers | None = None,
        highlight: Numbers | None = None,
        facet_roughness: float | None = None,
        exponent: float | None = None,
        index: float | None = None,
        distribution: Literal["gaussian", "beckmann", "ggx"] | None = None,
        masking: Literal["v_groove", "smith"] | None = None,
        grain: Numbers | None = None,
        stretch: float | None = None,
        lobe: Numbers | None = None,
        eye: Numbers | None = None,
        view: Numbers | None = None,
        local_viewer: bool | None = None,
        effect: int | None = None,
        faint: float | None = None,
        factor: int | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Lights surfaces and makes the picture smaller: first lit and then filtered, or the other way round.

        normal: which way surfaces face: x, y, z of any length
        position: where surfaces are: x, y, z
        albedo: diffuse colour, or grey
        specular: colour of highlights, or grey
        roughness: of the facets, 0 to 1
        lights: the lamps, each by its kind (directional, point, spot, area, projector, slab), colour, intensity and
            place; default [{"kind": "directional", "position": [0.0, 0.0, 0.0], "direction": [-1.0, -1.0, -2.0],
            "up": [0.0, 1.0, 0.0], "colour": [1.0, 1.0, 1.0], "intensity": 1.0, "radius": 0.05, "nearest": 0.0,
            "falloff": [0.0, 0.0, 1.0], "inner": 30.0, "outer": 45.0, "size": [1.0, 1.0], "samples": 16, "fov": 45.0,
            "aspect": 1.0, "cells": [8, 8], "lit": null, "distance": null}]
        model: how the surface reflects besides diffusely; default "torrance_sparrow"
        diffuse: share of light that is reflected diffusely, linear; times the input albedo; default [0.8, 0.8, 0.8]
        highlight: factor on highlights, linear; times the input specular; 0 leaves them out; default [1.0, 1.0, 1.0]
        facet_roughness: where there is no input roughness; its square is the slope of facets; less than 0.05 is taken
            as that; at least 0, at most 1; default 0.4
        exponent: of the models that are powers of a cosine, in place of the one from the roughness; at least 1, at
            most 100000
        index: of refraction, for torrance_sparrow; null: all is reflected; at least 1, at most 1000; default 1.5
        distribution: of the facets of torrance_sparrow; default "ggx"
        masking: how facets of torrance_sparrow hide one another; default "smith"
        grain: its direction for ward, lafortune and banks, where there is no input tangent; default [1.0, 0.0, 0.0]
        stretch: for ward: how much rougher the surface is along the grain than on the mean, and smoother across it;
            at least 0.1, at most 10; default 1.0
        lobe: for lafortune: factors along the grain, across it and along the normal; -1, -1, 1 mirrors; default
            [-1.0, -1.0, 1.0]
        eye: where the viewer is; default [0.0, 0.0, 0.0]
        view: the direction towards a viewer at infinity; default [0.0, 0.0, 1.0]
        local_viewer: whether the viewer is at `eye`, given positions, or at infinity; default true
        effect: the channel of `tiles` that is about the first lamp; the others follow; at least 0, at most 4095;
            default 0
        faint: what `tiles` leave out of the light of a pixel at most: it counts as an error; at least 0, at most
            1000000; default 0.0
        factor: px; the side of the squares that become one pixel; at least 1, at most 256; default 4
        method: filtered_first, widened, lit_first
        """
        return self.run(
            "reduced_lighting",
            normal,
            position=position,
            albedo=albedo,
            specular=specular,
            roughness=roughness,
            lights=lights,
            model=model,
            diffuse=diffuse,
            highlight=highlight,
            facet_roughness=facet_roughness,
            exponent=exponent,
            index=index,
            distribution=distribution,
            masking=masking,
            grain=grain,
            stretch=stretch,
            lobe=lobe,
            eye=eye,
            view=view,
            local_viewer=local_viewer,
            effect=effect,
            faint=faint,
            factor=factor,
            **options,
        )

    def reflection(
        self,
        normal: ImageLike,
        /,
        *,
        environment: ImageLike,
        position: ImageLike = None,
        base: ImageLike = None,
        irradiance: ImageLike = None,
        tiles: ImageLike = None,
        encoding: Literal["signed", "unit"] | None = None,
        convention: Literal["opengl", "directx"] | None = None,
        fov: float | None = None,
        eye: Numbers | None = None,
        chart: Literal["latlong", "cube", "cube_cross", "cube_pages", "mirror_ball", "paraboloid", "fisheye"]
        | None = None,
        mode: Literal["mirror", "refraction", "glass"] | None = None,
        fresnel: Literal["none", "dielectric"] | None = None,
        reflectance: float | None = None,
        index: float | None = None,
        coated: bool | None = None,
        background: Literal["none", "environment"] | None = None,
        yaw: float | None = None,
        pitch: float | None = None,
        roll: float | None = None,
        effect: int | None = None,
        faint: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Shows an environment in a surface and through it: mirror, varnish, thin glass; from a picture of normals.

        normal: normals of any length, x, y and z, or x and y alone
        environment: light from all directions, as `chart` says
        position: where the surface is, x, y and z
        base: what the surface shows by itself
        irradiance: an environment that is looked up by the normal
        tiles: what is left out in squares of 32 px: the environment where the channel `effect` is more than 0; of any
            size
        encoding: signed normals, or unit: (n + 1) / 2; default "signed"
        convention: y of normals runs up (opengl) or down (directx); default "opengl"
        fov: of the camera from top to bottom; orthographic if left out; at least 0.01, at most 179
        eye: where the viewer is, in the space of the positions; default [0.0, 0.0, 0.0]
        chart: how the environment, and the irradiance, hold all directions; default "latlong"
        mode: what is reflected, what is seen through the surface, or both; default "mirror"
        fresnel: a constant reflectance, or that of a dielectric; default "none"
        reflectance: where fresnel is none; of refraction, what passes; at least 0, at most 1; default 1.0
        index: of refraction: the body's over that around it; at least 0.1, at most 1000; default 1.5
        coated: whether the base loses what is reflected above it; default false
        background: what shows where there is no surface; default "none"
        yaw: how far the environment's middle is turned to the right; at least -100000, at most 100000; deg; default
            0.0
        pitch: how far up; at least -100000, at most 100000; deg; default 0.0
        roll: how far it is tilted clockwise; at least -100000, at most 100000; deg; default 0.0
        effect: the channel of `tiles` that is about the environment; at least 0, at most 4095; default 0
        faint: what `tiles` leave out of a pixel's light at most; at least 0, at most 1000000; default 0.0
        method: exact, single, schlick, nearest
        """
        return self.run(
            "reflection",
            normal,
            environment=environment,
            position=position,
            base=base,
            irradiance=irradiance,
            tiles=tiles,
            encoding=encoding,
            convention=convention,
            fov=fov,
            eye=eye,
            chart=chart,
            mode=mode,
            fresnel=fresnel,
            reflectance=reflectance,
            index=index,
            coated=coated,
            background=background,
            yaw=yaw,
            pitch=pitch,
            roll=roll,
            effect=effect,
            faint=faint,
            **options,
        )

    def remap(
        self,
        image: ImageLike,
        /,
        *,
        map: ImageLike,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        units: Literal["pixels", "unit"] | None = None,
        origin: Literal["top", "bottom"] | None = None,
        points: float | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Fetches every pixel from where a map says: ST and UV maps, look-up of positions.

        image: what is fetched from
        map: x and y for every pixel of the result; further channels are not read
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        units: pixels, or shares of width and height; default "pixels"
        origin: from where y is measured; default "top"
        points: samples along each axis of an ellipse; 2 to 16; a knob
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        method: nearest, bilinear, bicubic, mitchell, bspline, lanczos2, lanczos3, mip, supersampled, ewa
        """
        return self.run(
            "remap",
            image,
            map=map,
            border=border,
            value=value,
            units=units,
            origin=origin,
            points=points,
            samples=samples,
            **options,
        )

    def resize(
        self,
        image: ImageLike,
        /,
        *,
        width: int | None = None,
        height: int | None = None,
        scale: float | Numbers | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Gives an image another number of rows and columns.

        image: a picture or data, any number of channels
        width: columns of the result; at least 1, at most 16384
        height: rows of the result; at least 1, at most 16384
        scale: in place of width and height: one factor, or one across and one down; above 0, at most 16384
        border: how the image continues beyond its edges; default "clamp"
        value: what lies beyond a constant border; default 0.0
        method: nearest, box, triangle, bicubic, mitchell, lanczos2, lanczos3
        """
        return self.run("resize", image, width=width, height=height, scale=scale, border=border, value=value, **options)

    def rotate(
        self,
        image: ImageLike,
        /,
        *,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        width: int | None = None,
        height: int | None = None,
        angle: float | None = None,
        expand: bool | None = None,
        points: float | None = None,
        samples: float | None = None,
        size: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Turns an image about its middle.

        image: a picture or data, any number of channels
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        width: columns of the result; the image's if left out; at least 1, at most 16384
        height: rows of the result; the image's if left out; at least 1, at most 16384
        angle: counterclockwise; at least -1000000, at most 1000000; deg; default 30.0
        expand: whether the result is as large as the turned image needs; default false
        points: samples along each axis of an ellipse; 2 to 16; a knob
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        size: samples on either side of a shifted one; 2 to 16; a knob
        method: nearest, bilinear, bicubic, mitchell, bspline, lanczos2, lanczos3, mip, supersampled, ewa, shears
        """
        return self.run(
            "rotate",
            image,
            border=border,
            value=value,
            width=width,
            height=height,
            angle=angle,
            expand=expand,
            points=points,
            samples=samples,
            size=size,
            **options,
        )

    def saturation(self, image: ImageLike, /, *, amount: float | None = None, **options: Unpack[Options]) -> R:
        """Moves colours away from the grey of their luminance, or towards it.

        image: the picture; channels after the third pass unchanged
        amount: distance from grey: 0 is grey, 1 as it was, more is more colourful, less than 0 the complement; at
            least -100, at most 100; default 1.5
        method: exact
        """
        return self.run("saturation", image, amount=amount, **options)

    def shadow(
        self,
        map: ImageLike,
        /,
        *,
        depth: ImageLike,
        normal: ImageLike = None,
        tiles: ImageLike = None,
        fov: float | None = None,
        depth_kind: Literal["planar", "euclidean", "window", "reversed"] | None = None,
        near: float | None = None,
        far: float | None = None,
        light_eye: Numbers | None = None,
        light_target: Numbers | None = None,
        light_up: Numbers | None = None,
        light_fov: float | None = None,
        light_extent: float | None = None,
        map_kind: Literal["planar", "window", "reversed"] | None = None,
        light_near: float | None = None,
        light_far: float | None = None,
        kind: Literal["pcf", "pcss", "variance"] | None = None,
        filter: float | None = None,
        source: float | None = None,
        slope: float | None = None,
        outside: Literal["lit", "dark"] | None = None,
        effect: int | None = None,
        taps: float | None = None,
        bits: float | None = None,
        digits: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Tells which share of a light reaches every point, by the depths that the light sees.

        map: the depths that the light sees
        depth: how far from the camera each pixel is, or, of three channels, where
        normal: the points' normals, of any length
        tiles: what is left out in squares of 32 px: the light, which then counts as 0, where the channel `effect` is
            more than 0; of any size
        fov: the camera's vertical angle of view; at least 0.01, at most 175; deg; default 50.0
        depth_kind: planar: along the viewing direction; euclidean: from the eye; window: 0 at near, 1 at far;
            reversed: 1 to 0; default "planar"
        near: of a window's depth; above 0, at most 1000000000; default 0.1
        far: of a window's depth; none: infinitely far; above 0, at most 1000000000000
        light_eye: where the light is, in the axes of the positions, or of the camera; default [3.0, 5.0, 0.0]
        light_target: what the map's middle shows; default [0.0, 0.0, -5.0]
        light_up: what is up in the map, roughly; default [0.0, 1.0, 0.0]
        light_fov: the map's vertical angle; at least 0.01, at most 175; deg; default 60.0
        light_extent: of light without perspective: the height of what the map shows; at least 1e-06, at most 1000000
        map_kind: planar: depth along the light's direction; window: 0 at light_near, 1 at light_far; reversed: 1 to
            0; default "planar"
        light_near: of a window's depth, and of depth in few bits; at least 1e-09, at most 1000000; default 0.1
        light_far: of a window's depth, and of depth in few bits; none: infinitely far; above 0, at most 1000000000
        kind: pcf: comparisons averaged; pcss: over as much as the penumbra is wide; variance: Chebyshev's bound;
            default "pcf"
        filter: side of the square that is averaged, texels; 0, and below 0.001: the nearest texel alone. Of pcss: the
            widest; at least 0, at most 32; default 0.0
        source: of pcss: the light's width; of light without perspective the tangent of the angle it fills; at least
            0, at most 1000000; default 0.2
        slope: without normals: the steepest receiver, depth over width, that casts no shadow on itself; at least 0,
            at most 100; default 1.0
        outside: beyond the map and behind the light; default "lit"
        effect: the channel of `tiles` that is about this light; at least 0, at most 4095; default 0
        taps: texels that are compared; 1 to 1024; a knob
        bits: of a stored depth; 4 to 32; a knob
        digits: significant bits of a stored depth: 11 as float16 has, 24 as float32; 4 to 40; a knob
        method: exact, sampled, linear, window, float, reversed
        """
        return self.run(
            "shadow",
            map,
            depth=depth,
            normal=normal,
            tiles=tiles,
            fov=fov,
            depth_kind=depth_kind,
            near=near,
            far=far,
            light_eye=light_eye,
            light_target=light_target,
            light_up=light_up,
            light_fov=light_fov,
            light_extent=light_extent,
            map_kind=map_kind,
            light_near=light_near,
            light_far=light_far,
            kind=kind,
            filter=filter,
            source=source,
            slope=slope,
            outside=outside,
            effect=effect,
            taps=taps,
            bits=bits,
            digits=digits,
            **options,
        )

    def sharpen(
        self,
        image: ImageLike,
        /,
        *,
        mask: ImageLike = None,
        sigma: float | None = None,
        amount: float | None = None,
        threshold: float | None = None,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        missing: Literal["spread", "skip", "inside"] | None = None,
        tail: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Unsharp mask: adds the detail that a Gaussian blur takes away, above a threshold.

        image: a picture or data, any number of channels
        mask: weights of the pixels in [0, 1], one channel; 0 takes no part
        sigma: standard deviation of the blur that detail is told by; at least 0, at most 100000; px; default 2.0
        amount: how much of the detail is added; at least -1, at most 100; default 1.0
        threshold: detail up to this is left alone; at least 0, at most 1000000; default 0.0
        border: how the image continues beyond its edges; default "reflect"
        value: what lies beyond a constant border; default 0.0
        missing: what becomes of samples that are NaN or infinite; default "spread"
        tail: weight of the modes that are dropped; 1e-09 to 0.5; a knob
        method: fir, dct
        """
        return self.run(
            "sharpen",
            image,
            mask=mask,
            sigma=sigma,
            amount=amount,
            threshold=threshold,
            border=border,
            value=value,
            missing=missing,
            tail=tail,
            **options,
        )

    def simplex_noise(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        seed: int | None = None,
        low: float | None = None,
        high: float | None = None,
        cell: float | Numbers | None = None,
        x: float | None = None,
        y: float | None = None,
        tile: bool | None = None,
        fractal: Literal["none", "fbm", "turbulence", "billow", "ridged"] | None = None,
        octaves: int | None = None,
        lacunarity: float | None = None,
        gain: float | None = None,
        antialias: bool | None = None,
        warp: float | None = None,
        dimensions: int | None = None,
        z: float | None = None,
        w: float | None = None,
        loop: int | None = None,
        output: Literal["value", "derivatives"] | None = None,
        tail: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Simplex noise: octaves of smooth bumps on triangles or tetrahedra, tileable, with derivatives.

        width: of the picture; at least 1, at most 16384; px; default 512
        height: of the picture; at least 1, at most 16384; px; default 512
        seed: which of the noises; at least 0, at most 4294967295; default 0
        low: what noise of -1 becomes; at least -1000000, at most 1000000; default 0.0
        high: what noise of +1 becomes; at least -1000000, at most 1000000; default 1.0
        cell: side of a cell, or its sides along x and y; at least 1e-06, at most 1000000; px; default 64.0
        x: of the picture's left edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        y: of the picture's upper edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        tile: whether the picture repeats without a seam; a whole number of cells is fitted into it; default false
        fractal: how octaves are summed; default "fbm"
        octaves: octaves at most; 0 gives the middle; at least 0, at most 30; default 6
        lacunarity: from one octave's frequency to the next one's; at least 1, at most 16; default 2.0
        gain: from one octave's amplitude to the next one's; lacunarity^-H; at least 0, at most 8; default 0.5
        antialias: whether octaves that pixels cannot show are replaced by their mean, the last one fading; default
            true
        warp: how far places are moved by two more such noises; at least 0, at most 16384; px; default 0.0
        dimensions: of the noise; beyond two, the picture is a slice at z and w; at least 2, at most 4; default 2
        z: third coordinate, in cells: time, or depth; at least -1000000000, at most 1000000000; default 0.0
        w: fourth coordinate, in cells; at least -1000000000, at most 1000000000; default 0.0
        loop: cells of z after which the noise comes again; 0: never; at least 0, at most 65536; default 0
        output: the noise alone, or its derivatives with it; default "value"
        tail: share of the output's range that octaves may be left out for; 0 to 0.5; a knob
        method: single, double
        """
        return self.run(
            "simplex_noise",
            width=width,
            height=height,
            seed=seed,
            low=low,
            high=high,
            cell=cell,
            x=x,
            y=y,
            tile=tile,
            fractal=fractal,
            octaves=octaves,
            lacunarity=lacunarity,
            gain=gain,
            antialias=antialias,
            warp=warp,
            dimensions=dimensions,
            z=z,
            w=w,
            loop=loop,
            output=output,
            tail=tail,
            **options,
        )

    def spectral_noise(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        seed: int | None = None,
        low: float | None = None,
        high: float | None = None,
        beta: float | None = None,
        low_cut: float | None = None,
        high_cut: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Spectral noise: power falls as 1/f^beta, from white over pink to mountains; always tileable.

        width: of the picture; at least 1, at most 16384; px; default 512
        height: of the picture; at least 1, at most 16384; px; default 512
        seed: which of the noises; at least 0, at most 4294967295; default 0
        low: what noise of -1 becomes; at least -1000000, at most 1000000; default 0.0
        high: what noise of +1 becomes; at least -1000000, at most 1000000; default 1.0
        beta: power falls as frequency^-beta; at least -4, at most 8; default 2.0
        low_cut: frequencies below are left out; at least 0, below 0.71; cycles/px; default 0.0
        high_cut: frequencies above are left out; above 0, at most 0.75; cycles/px; default 0.75
        method: single, double
        """
        return self.run(
            "spectral_noise",
            width=width,
            height=height,
            seed=seed,
            low=low,
            high=high,
            beta=beta,
            low_cut=low_cut,
            high_cut=high_cut,
            **options,
        )

    def spherical_harmonics(
        self,
        image: ImageLike,
        /,
        *,
        chart: Literal["latlong", "cube", "cube_cross", "cube_pages", "mirror_ball", "paraboloid", "fisheye"]
        | None = None,
        bands: int | None = None,
        output: Literal["radiance", "irradiance"] | None = None,
        target: Literal["latlong", "cube", "cube_cross", "cube_pages", "mirror_ball", "paraboloid", "fisheye"]
        | None = None,
        width: int | None = None,
        height: int | None = None,
        texels: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Takes an environment apart into spherical harmonics, and shows the light or the irradiance these make.

        image: light from all directions, as `chart` says
        chart: how the image holds all directions; default "latlong"
        bands: degrees; their square is the number of coefficients; at least 1, at most 10; default 3
        output: the light by its coefficients, or what a matt surface shows; default "radiance"
        target: how the result holds all directions; default "latlong"
        width: columns of the result; by the target if left out; at least 1, at most 4096
        height: rows of the result; by the target if left out; at least 1, at most 4096
        texels: blocks that the image is put together to; 6 to 1e+06; a knob
        method: all, reduced
        """
        return self.run(
            "spherical_harmonics",
            image,
            chart=chart,
            bands=bands,
            output=output,
            target=target,
            width=width,
            height=height,
            texels=texels,
            **options,
        )

    def spot_noise(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        seed: int | None = None,
        low: float | None = None,
        high: float | None = None,
        cell: float | Numbers | None = None,
        x: float | None = None,
        y: float | None = None,
        tile: bool | None = None,
        fractal: Literal["none", "fbm", "turbulence", "billow", "ridged"] | None = None,
        octaves: int | None = None,
        lacunarity: float | None = None,
        gain: float | None = None,
        antialias: bool | None = None,
        warp: float | None = None,
        dimensions: int | None = None,
        z: float | None = None,
        w: float | None = None,
        loop: int | None = None,
        output: Literal["value", "derivatives"] | None = None,
        impulses: int | None = None,
        angle: float | None = None,
        stretch: float | None = None,
        tail: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Spot noise: random smooth spots, round or stretched along a direction, without a lattice; tileable.

        width: of the picture; at least 1, at most 16384; px; default 512
        height: of the picture; at least 1, at most 16384; px; default 512
        seed: which of the noises; at least 0, at most 4294967295; default 0
        low: what noise of -1 becomes; at least -1000000, at most 1000000; default 0.0
        high: what noise of +1 becomes; at least -1000000, at most 1000000; default 1.0
        cell: side of a cell, or its sides along x and y; at least 1e-06, at most 1000000; px; default 64.0
        x: of the picture's left edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        y: of the picture's upper edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        tile: whether the picture repeats without a seam; a whole number of cells is fitted into it; default false
        fractal: how octaves are summed; default "none"
        octaves: octaves at most; 0 gives the middle; at least 0, at most 30; default 6
        lacunarity: from one octave's frequency to the next one's; at least 1, at most 16; default 2.0
        gain: from one octave's amplitude to the next one's; lacunarity^-H; at least 0, at most 8; default 0.5
        antialias: whether octaves that pixels cannot show are replaced by their mean, the last one fading; default
            true
        warp: how far places are moved by two more such noises; at least 0, at most 16384; px; default 0.0
        dimensions: of the noise; beyond two, the picture is a slice at z and w; at least 2, at most 4; default 2
        z: third coordinate, in cells: time, or depth; at least -1000000000, at most 1000000000; default 0.0
        w: fourth coordinate, in cells; at least -1000000000, at most 1000000000; default 0.0
        loop: cells of z after which the noise comes again; 0: never; at least 0, at most 65536; default 0
        output: the noise alone, or its derivatives with it; default "value"
        impulses: of a cell; with few, single ones show; at least 1, at most 32; default 4
        angle: direction, from x towards y; at least -360, at most 360; deg; default 0.0
        stretch: how much longer than wide spots are; at least 1, at most 16; default 1.0
        tail: share of the output's range that octaves may be left out for; 0 to 0.5; a knob
        method: single, double
        """
        return self.run(
            "spot_noise",
            width=width,
            height=height,
            seed=seed,
            low=low,
            high=high,
            cell=cell,
            x=x,
            y=y,
            tile=tile,
            fractal=fractal,
            octaves=octaves,
            lacunarity=lacunarity,
            gain=gain,
            antialias=antialias,
            warp=warp,
            dimensions=dimensions,
            z=z,
            w=w,
            loop=loop,
            output=output,
            impulses=impulses,
            angle=angle,
            stretch=stretch,
            tail=tail,
            **options,
        )

    def statistics(
        self,
        image: ImageLike,
        /,
        *,
        percentiles: Numbers | None = None,
        bins: int | None = None,
        low: float | None = None,
        high: float | None = None,
        resolution: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Finds extremes, mean, deviation, percentiles and histogram of every channel.

        image: a picture or data, taken as it is stored
        percentiles: percentiles to find, 0 to 100; default [1, 25, 50, 75, 99]
        bins: how many equal ranges are counted; none unless given; at least 0, at most 4096; default 0
        low: where the first bin begins; the least value unless given; at least -1e+30, at most 1e+30
        high: where the last bin ends; the largest value unless given; at least -1e+30, at most 1e+30
        resolution: bins in which percentiles are looked for; 16 to 1.04858e+06; a knob
        method: exact, binned
        """
        return self.run(
            "statistics",
            image,
            percentiles=percentiles,
            bins=bins,
            low=low,
            high=high,
            resolution=resolution,
            **options,
        )

    def stereo_view(
        self,
        image: ImageLike,
        /,
        *,
        depth: ImageLike,
        baseline: float | None = None,
        convergence: float | None = None,
        fov: float | None = None,
        largest: float | None = None,
        eye: Literal["left", "right"] | None = None,
        tear: float | None = None,
        steps: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Shows what an eye beside the camera sees, from a picture and its depths.

        image: the camera's picture
        depth: distances along the view
        baseline: between the eyes, in the units of the depths; at least -1000000, at most 1000000; default 0.065
        convergence: the depth that coincides; infinity if left out; above 1e-06, at most 1000000000
        fov: of the cameras, from top to bottom; at least 0.01, at most 179; deg; default 40.0
        largest: no pixel moves farther; at least 0, at most 512; px; default 32.0
        eye: the left or the right one; default "left"
        tear: neighbours that move apart by more are of two surfaces; at least 0, at most 512; px; default 1.0
        steps: looks back from each pixel; 1 to 32; a knob
        method: search, iterated
        """
        return self.run(
            "stereo_view",
            image,
            depth=depth,
            baseline=baseline,
            convergence=convergence,
            fov=fov,
            largest=largest,
            eye=eye,
            tear=tear,
            steps=steps,
            **options,
        )

    def streamlines(
        self,
        field: ImageLike,
        /,
        *,
        seeding: Literal["even", "grid", "points"] | None = None,
        spacing: float | None = None,
        points: Numbers | None = None,
        length: float | None = None,
        step: float | None = None,
        width: float | None = None,
        scale: float | None = None,
        bias: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Follows the lines of a vector field: polylines as findings, and a picture of them.

        field: vectors: x to the right, y down; further channels are not read
        seeding: where lines begin; default "even"
        spacing: between lines (even) or seeds (grid); at least 2, at most 4096; px; default 16.0
        points: seeds (x, y) in pixels, y down; default []
        length: how far to follow a line each way; at least 0, at most 20000; px; default 400.0
        step: between the points of a line; at least 0.1, at most 4; px; default 1.0
        width: of the pen; at least 0, at most 16; px; default 1.0
        scale: v = (c - bias) * scale; at least -1000000, at most 1000000; default 1.0
        bias: the stored value of a zero component; at least -1000000, at most 1000000; default 0.0
        method: direct
        """
        return self.run(
            "streamlines",
            field,
            seeding=seeding,
            spacing=spacing,
            points=points,
            length=length,
            step=step,
            width=width,
            scale=scale,
            bias=bias,
            **options,
        )

    def table3d(
        self,
        image: ImageLike,
        /,
        *,
        table: ImageLike = None,
        cube: str | None = None,
        clf: str | None = None,
        interpolation: Literal["tetrahedral", "trilinear"] | None = None,
        domain_min: Numbers | None = None,
        domain_max: Numbers | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Passes colour through a three-dimensional table, as of a .cube file.

        image: a picture of three colours; further channels pass unchanged
        table: n^2 rows of n colours, red fastest
        cube: the text of a .cube file, in place of the input table
        clf: the text of a Common LUT Format file, in place of a table
        interpolation: tetrahedral or trilinear: they are different definitions; default "tetrahedral"
        domain_min: the colour at the table's first node; that of the text, or 0, unless given
        domain_max: the colour at the table's last node; that of the text, or 1, unless given
        method: exact
        """
        return self.run(
            "table3d",
            image,
            table=table,
            cube=cube,
            clf=clf,
            interpolation=interpolation,
            domain_min=domain_min,
            domain_max=domain_max,
            **options,
        )

    def thin_plate(
        self,
        image: ImageLike,
        /,
        *,
        border: Literal["reflect", "reflect101", "clamp", "wrap", "constant"] | None = None,
        value: float | None = None,
        width: int | None = None,
        height: int | None = None,
        source_points: Numbers | None = None,
        target_points: Numbers | None = None,
        smoothing: float | None = None,
        points: float | None = None,
        samples: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Bends an image so that points come to lie on points, as smoothly as can be.

        image: a picture or data, any number of channels
        border: how the image continues beyond its edges; default "constant"
        value: the background, and what lies beyond a constant border, in every channel; default 0.0
        width: columns of the result; the image's if left out; at least 1, at most 16384
        height: rows of the result; the image's if left out; at least 1, at most 16384
        source_points: [x, y] of points of the input, px; default [[0.0, 0.0]]
        target_points: where these points shall lie in the result; default [[0.0, 0.0]]
        smoothing: the price of bending; 0 meets every point; at least 0, at most 1000000; default 0.0
        points: samples along each axis of an ellipse; 2 to 16; a knob
        samples: samples of the pyramid's level along half the shorter axis; 1 to 8; a knob
        method: nearest, bilinear, bicubic, mitchell, bspline, lanczos2, lanczos3, mip, supersampled, ewa
        """
        return self.run(
            "thin_plate",
            image,
            border=border,
            value=value,
            width=width,
            height=height,
            source_points=source_points,
            target_points=target_points,
            smoothing=smoothing,
            points=points,
            samples=samples,
            **options,
        )

    def tiles(
        self,
        position: ImageLike,
        /,
        *,
        normal: ImageLike,
        lights: Numbers | None = None,
        fog: Mapping[str, Any] | None = None,
        reflected: float | None = None,
        surroundings: Literal["none", "surfaces", "everywhere"] | None = None,
        brightest: float | None = None,
        faint: float | None = None,
        worth: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Tells for every tile of a picture which lamps, and whether an environment, give nothing there, and why.

        position: where surfaces are: x, y, z; infinite where there is nothing
        normal: which way they face, of any length
        lights: the lamps, as of lighting; default [{"kind": "directional", "position": [0.0, 0.0, 0.0], "direction":
            [0.0, 0.0, -1.0], "up": [0.0, 1.0, 0.0], "colour": [1.0, 1.0, 1.0], "intensity": 1.0, "radius": 0.05,
            "nearest": 0.0, "falloff": [0.0, 0.0, 1.0], "inner": 30.0, "outer": 45.0, "size": [1.0, 1.0], "samples":
            16, "fov": 45.0, "aspect": 1.0, "cells": [8, 8], "lit": null, "distance": null}]
        fog: parameters of the operation fog; what it hides needs no light
        reflected: the largest radiance that a surface sends of a lamp's 1; none: it has no bound; at least 0, at most
            1e+30
        surroundings: none, or where surfaces, or all pixels, show an environment: one more effect, after the lamps;
            default "none"
        brightest: the largest light that an environment adds to a pixel; none: it has no bound; at least 0, at most
            1e+30
        faint: the largest light of a pixel that may be left out; at least 0, at most 1000000; default 0.0
        worth: the share of pairs of a lamp and a tile that must be left out in every fourth tile of every fourth row
            (of fewer than 64 tiles in all), those aside where nothing is; where it is less, nothing is left out
            anywhere; at least 0, at most 1; default 0.0
        method: exact
        """
        return self.run(
            "tiles",
            position,
            normal=normal,
            lights=lights,
            fog=fog,
            reflected=reflected,
            surroundings=surroundings,
            brightest=brightest,
            faint=faint,
            worth=worth,
            **options,
        )

    def tone_map(
        self,
        image: ImageLike,
        /,
        *,
        operator: Literal["exposure", "reinhard", "reinhard_extended", "hable", "aces_narkowicz", "aces_hill"]
        | None = None,
        exposure: float | None = None,
        white: float | None = None,
        on: Literal["channels", "luminance"] | None = None,
        weights: Numbers | None = None,
        clamp: bool | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Brings scene light into the range of a display: exposure, then a tone curve.

        image: a scene-linear picture; its coverage channel, if it has one, passes unchanged
        operator: the tone curve; default "reinhard_extended"
        exposure: light is multiplied by 2^exposure first; at least -24, at most 24; stops; default 0.0
        white: light that becomes 1, for reinhard_extended and hable, after exposure; at least 0.1, at most 10000;
            default 4.0
        on: channels: every channel by itself; luminance: their ratios stay; default "channels"
        weights: of red, green and blue in luminance: not negative, together 1; those of BT.709; default [0.2126,
            0.7152, 0.0722]
        clamp: whether the result is limited to [0, 1]; default true
        method: exact
        """
        return self.run(
            "tone_map",
            image,
            operator=operator,
            exposure=exposure,
            white=white,
            on=on,
            weights=weights,
            clamp=clamp,
            **options,
        )

    def transfer(
        self,
        image: ImageLike,
        /,
        *,
        curve: Literal[
            "srgb",
            "gamma",
            "bt709",
            "bt1886",
            "pq",
            "hlg",
            "bt2020",
            "bt2020_12",
            "bt1361",
            "smpte_240m",
            "arib_b67",
            "h273_log",
            "h273_log_sqrt",
            "st428",
            "dicom_gsdf",
            "adobe_rgb",
            "romm",
            "rimm",
            "erimm",
            "acescc",
            "acescct",
            "apple_log",
            "arri_logc3",
            "arri_logc4",
            "blackmagic_film_5",
            "canon_log",
            "canon_log_v1",
            "canon_log2",
            "canon_log2_v1",
            "canon_log3",
            "canon_log3_v1",
            "cineon",
            "davinci_intermediate",
            "dji_dlog",
            "filmic_pro6",
            "filmlight_tlog",
            "flog",
            "flog2",
            "gopro_protune",
            "leica_llog",
            "log2",
            "mi_log",
            "nikon_nlog",
            "panalog",
            "plog",
            "red_log",
            "red_logfilm",
            "red_log3g10",
            "red_log3g10_v1",
            "red_log3g10_v2",
            "red_log3g12",
            "slog",
            "slog2",
            "slog3",
            "viper_log",
            "vlog",
        ]
        | None = None,
        direction: Literal["decode", "encode"] | None = None,
        gamma: float | Numbers | None = None,
        exposure_index: int | None = None,
        white: float | None = None,
        black: float | None = None,
        negative: Literal["mirror", "clamp"] | None = None,
        size: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Decodes a signal to linear light, or encodes light to a signal, by a standard transfer function.

        image: the picture; its coverage channel, if it has one, passes unchanged
        curve: the transfer function; default "srgb"
        direction: decode: signal to linear light; encode: linear light to signal; default "decode"
        gamma: decoding exponent, for curve=gamma, or one for each colour channel; encoding takes its reciprocal; at
            least 0.1, at most 10; default 2.2
        exposure_index: for curve=arri_logc3: 160, 200, 250, 320, 400, 500, 640, 800, 1000, 1280 or 1600; at least
            160, at most 1600; default 800
        white: luminance that linear 1 stands for, for curve=pq (203 unless given), bt1886 (100), st428 (48) and
            dicom_gsdf (100); at least 1, at most 10000
        black: luminance of the display's black, for curve=bt1886; below white; at least 0, at most 1000; cd/m2;
            default 0
        negative: negative light: mirror keeps it, by odd extension or as the curve's standard says; clamp makes it
            none; default "mirror"
        size: cells of the table at most; 256 to 65536; a knob
        method: exact, table, cubic, sextic
        """
        return self.run(
            "transfer",
            image,
            curve=curve,
            direction=direction,
            gamma=gamma,
            exposure_index=exposure_index,
            white=white,
            black=black,
            negative=negative,
            size=size,
            **options,
        )

    def value_noise(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        seed: int | None = None,
        low: float | None = None,
        high: float | None = None,
        cell: float | Numbers | None = None,
        x: float | None = None,
        y: float | None = None,
        tile: bool | None = None,
        fractal: Literal["none", "fbm", "turbulence", "billow", "ridged"] | None = None,
        octaves: int | None = None,
        lacunarity: float | None = None,
        gain: float | None = None,
        antialias: bool | None = None,
        warp: float | None = None,
        dimensions: int | None = None,
        z: float | None = None,
        w: float | None = None,
        loop: int | None = None,
        output: Literal["value", "derivatives"] | None = None,
        fade: Literal["quintic", "cubic"] | None = None,
        tail: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Value noise: octaves of smoothly interpolated random numbers, tileable, with derivatives.

        width: of the picture; at least 1, at most 16384; px; default 512
        height: of the picture; at least 1, at most 16384; px; default 512
        seed: which of the noises; at least 0, at most 4294967295; default 0
        low: what noise of -1 becomes; at least -1000000, at most 1000000; default 0.0
        high: what noise of +1 becomes; at least -1000000, at most 1000000; default 1.0
        cell: side of a cell, or its sides along x and y; at least 1e-06, at most 1000000; px; default 64.0
        x: of the picture's left edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        y: of the picture's upper edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        tile: whether the picture repeats without a seam; a whole number of cells is fitted into it; default false
        fractal: how octaves are summed; default "fbm"
        octaves: octaves at most; 0 gives the middle; at least 0, at most 30; default 6
        lacunarity: from one octave's frequency to the next one's; at least 1, at most 16; default 2.0
        gain: from one octave's amplitude to the next one's; lacunarity^-H; at least 0, at most 8; default 0.5
        antialias: whether octaves that pixels cannot show are replaced by their mean, the last one fading; default
            true
        warp: how far places are moved by two more such noises; at least 0, at most 16384; px; default 0.0
        dimensions: of the noise; beyond two, the picture is a slice at z and w; at least 2, at most 4; default 2
        z: third coordinate, in cells: time, or depth; at least -1000000000, at most 1000000000; default 0.0
        w: fourth coordinate, in cells; at least -1000000000, at most 1000000000; default 0.0
        loop: cells of z after which the noise comes again; 0: never; at least 0, at most 65536; default 0
        output: the noise alone, or its derivatives with it; default "value"
        fade: how values give way from corner to corner of a cell; default "quintic"
        tail: share of the output's range that octaves may be left out for; 0 to 0.5; a knob
        method: single, double
        """
        return self.run(
            "value_noise",
            width=width,
            height=height,
            seed=seed,
            low=low,
            high=high,
            cell=cell,
            x=x,
            y=y,
            tile=tile,
            fractal=fractal,
            octaves=octaves,
            lacunarity=lacunarity,
            gain=gain,
            antialias=antialias,
            warp=warp,
            dimensions=dimensions,
            z=z,
            w=w,
            loop=loop,
            output=output,
            fade=fade,
            tail=tail,
            **options,
        )

    def vector(
        self,
        image: ImageLike,
        /,
        *,
        make: Literal["gradient", "perpendicular", "rotate", "normalise", "curl", "divergence"] | None = None,
        angle: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Makes vector fields: gradients of pictures, turned and normalised fields, curl and divergence.

        image: a picture, of which the gradient is taken, or a field (x, y)
        make: what is made of the image; default "perpendicular"
        angle: of rotate, from x towards y; at least -360, at most 360; deg; default 90.0
        method: direct
        """
        return self.run("vector", image, make=make, angle=angle, **options)

    def vignette(
        self,
        image: ImageLike,
        /,
        *,
        fov: float | None = None,
        power: float | None = None,
        mechanical: float | None = None,
        remove: bool | None = None,
        largest: float | None = None,
        centre: Numbers | None = None,
        entries: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Darkens a picture towards its corners as a lens does, or takes that out.

        image: a picture
        fov: from the top of the picture to its bottom; at least 0.1, at most 170; deg; default 40.0
        power: of the cosine; 0 where there is no natural fall-off; at least 0, at most 16; default 4.0
        mechanical: how far the rims close the corners: 0 not at all, 1 wholly; at least 0, at most 1; default 0.0
        remove: whether the fall-off is taken out; default false
        largest: no pixel is made brighter by more, where it is taken out; at least 1, at most 1000; default 16.0
        centre: of the lens; shares of width and height; default [0.5, 0.5]
        entries: gains along the radius; 2 to 65536; a knob
        method: exact, table
        """
        return self.run(
            "vignette",
            image,
            fov=fov,
            power=power,
            mechanical=mechanical,
            remove=remove,
            largest=largest,
            centre=centre,
            entries=entries,
            **options,
        )

    def wavelet_noise(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        seed: int | None = None,
        low: float | None = None,
        high: float | None = None,
        cell: float | Numbers | None = None,
        x: float | None = None,
        y: float | None = None,
        tile: bool | None = None,
        fractal: Literal["none", "fbm", "turbulence", "billow", "ridged"] | None = None,
        octaves: int | None = None,
        lacunarity: float | None = None,
        gain: float | None = None,
        antialias: bool | None = None,
        warp: float | None = None,
        dimensions: int | None = None,
        z: float | None = None,
        w: float | None = None,
        loop: int | None = None,
        output: Literal["value", "derivatives"] | None = None,
        depth: Literal["projected", "solid"] | None = None,
        tail: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Wavelet noise: octaves of random bands of frequencies that do not overlap, tileable, with derivatives.

        width: of the picture; at least 1, at most 16384; px; default 512
        height: of the picture; at least 1, at most 16384; px; default 512
        seed: which of the noises; at least 0, at most 4294967295; default 0
        low: what noise of -1 becomes; at least -1000000, at most 1000000; default 0.0
        high: what noise of +1 becomes; at least -1000000, at most 1000000; default 1.0
        cell: side of a cell, or its sides along x and y; at least 1e-06, at most 1000000; px; default 64.0
        x: of the picture's left edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        y: of the picture's upper edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        tile: whether the picture repeats without a seam; a whole number of cells is fitted into it; default false
        fractal: how octaves are summed; default "fbm"
        octaves: octaves at most; 0 gives the middle; at least 0, at most 30; default 6
        lacunarity: from one octave's frequency to the next one's; at least 1, at most 16; default 2.0
        gain: from one octave's amplitude to the next one's; lacunarity^-H; at least 0, at most 8; default 0.5
        antialias: whether octaves that pixels cannot show are replaced by their mean, the last one fading; default
            true
        warp: how far places are moved by two more such noises; at least 0, at most 16384; px; default 0.0
        dimensions: of the noise; beyond two, the picture is a slice at z and w; at least 2, at most 4; default 2
        z: third coordinate, in cells: time, or depth; at least -1000000000, at most 1000000000; default 0.0
        w: fourth coordinate, in cells; at least -1000000000, at most 1000000000; default 0.0
        loop: cells of z after which the noise comes again; 0: never; at least 0, at most 65536; default 0
        output: the noise alone, or its derivatives with it; default "value"
        depth: what holds one octave of frequencies beyond two dimensions; default "projected"
        tail: share of the output's range that octaves may be left out for; 0 to 0.5; a knob
        method: single, double
        """
        return self.run(
            "wavelet_noise",
            width=width,
            height=height,
            seed=seed,
            low=low,
            high=high,
            cell=cell,
            x=x,
            y=y,
            tile=tile,
            fractal=fractal,
            octaves=octaves,
            lacunarity=lacunarity,
            gain=gain,
            antialias=antialias,
            warp=warp,
            dimensions=dimensions,
            z=z,
            w=w,
            loop=loop,
            output=output,
            depth=depth,
            tail=tail,
            **options,
        )

    def white_noise(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        seed: int | None = None,
        low: float | None = None,
        high: float | None = None,
        distribution: Literal["uniform", "triangular", "normal"] | None = None,
        channels: int | None = None,
        x: int | None = None,
        y: int | None = None,
        **options: Unpack[Options],
    ) -> R:
        """White noise: every pixel a random number of its own, uniform, triangular or normal.

        width: of the picture; at least 1, at most 16384; px; default 512
        height: of the picture; at least 1, at most 16384; px; default 512
        seed: which of the noises; at least 0, at most 4294967295; default 0
        low: what noise of -1 becomes; at least -1000000, at most 1000000; default 0.0
        high: what noise of +1 becomes; at least -1000000, at most 1000000; default 1.0
        distribution: how often a value comes; default "uniform"
        channels: of the picture, each a noise of its own; at least 1, at most 4; default 1
        x: of the first column; at least -2147483648, at most 2147483647; px; default 0
        y: of the first row; at least -2147483648, at most 2147483647; px; default 0
        method: exact
        """
        return self.run(
            "white_noise",
            width=width,
            height=height,
            seed=seed,
            low=low,
            high=high,
            distribution=distribution,
            channels=channels,
            x=x,
            y=y,
            **options,
        )

    def worley_noise(
        self,
        *,
        width: int | None = None,
        height: int | None = None,
        seed: int | None = None,
        low: float | None = None,
        high: float | None = None,
        cell: float | Numbers | None = None,
        x: float | None = None,
        y: float | None = None,
        tile: bool | None = None,
        fractal: Literal["none", "fbm", "turbulence", "billow", "ridged"] | None = None,
        octaves: int | None = None,
        lacunarity: float | None = None,
        gain: float | None = None,
        antialias: bool | None = None,
        warp: float | None = None,
        dimensions: int | None = None,
        z: float | None = None,
        w: float | None = None,
        loop: int | None = None,
        output: Literal["value", "derivatives"] | None = None,
        metric: Literal["euclidean", "manhattan", "chebyshev"] | None = None,
        feature: Literal["f1", "f2", "f2-f1"] | None = None,
        jitter: float | None = None,
        tail: float | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Worley noise: distances to the nearest of strewn points, as cobbles, cells and cracks; tileable.

        width: of the picture; at least 1, at most 16384; px; default 512
        height: of the picture; at least 1, at most 16384; px; default 512
        seed: which of the noises; at least 0, at most 4294967295; default 0
        low: what noise of -1 becomes; at least -1000000, at most 1000000; default 0.0
        high: what noise of +1 becomes; at least -1000000, at most 1000000; default 1.0
        cell: side of a cell, or its sides along x and y; at least 1e-06, at most 1000000; px; default 64.0
        x: of the picture's left edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        y: of the picture's upper edge; at least -1000000000000, at most 1000000000000; px; default 0.0
        tile: whether the picture repeats without a seam; a whole number of cells is fitted into it; default false
        fractal: how octaves are summed; default "fbm"
        octaves: octaves at most; 0 gives the middle; at least 0, at most 30; default 6
        lacunarity: from one octave's frequency to the next one's; at least 1, at most 16; default 2.0
        gain: from one octave's amplitude to the next one's; lacunarity^-H; at least 0, at most 8; default 0.5
        antialias: whether octaves that pixels cannot show are replaced by their mean, the last one fading; default
            true
        warp: how far places are moved by two more such noises; at least 0, at most 16384; px; default 0.0
        dimensions: of the noise; beyond two, the picture is a slice at z and w; at least 2, at most 4; default 2
        z: third coordinate, in cells: time, or depth; at least -1000000000, at most 1000000000; default 0.0
        w: fourth coordinate, in cells; at least -1000000000, at most 1000000000; default 0.0
        loop: cells of z after which the noise comes again; 0: never; at least 0, at most 65536; default 0
        output: the noise alone, or its derivatives with it; default "value"
        metric: how far a way is; default "euclidean"
        feature: which distance is shown; default "f1"
        jitter: how far points stray from the middle of their cells; at least 0, at most 1; default 1.0
        tail: share of the output's range that octaves may be left out for; 0 to 0.5; a knob
        method: single, double, near
        """
        return self.run(
            "worley_noise",
            width=width,
            height=height,
            seed=seed,
            low=low,
            high=high,
            cell=cell,
            x=x,
            y=y,
            tile=tile,
            fractal=fractal,
            octaves=octaves,
            lacunarity=lacunarity,
            gain=gain,
            antialias=antialias,
            warp=warp,
            dimensions=dimensions,
            z=z,
            w=w,
            loop=loop,
            output=output,
            metric=metric,
            feature=feature,
            jitter=jitter,
            tail=tail,
            **options,
        )

    def z_composite(
        self,
        image: ImageLike,
        /,
        *,
        depth: ImageLike,
        base: ImageLike,
        base_depth: ImageLike,
        nearer: Literal["smaller", "larger"] | None = None,
        tolerance: float | None = None,
        coplanar: Literal["image", "base", "mean", "over"] | None = None,
        scale: float | None = None,
        bias: float | None = None,
        partial: bool | None = None,
        output: Literal["picture", "depth"] | None = None,
        **options: Unpack[Options],
    ) -> R:
        """Takes of two pictures with depth what is nearer, with a rule for what is coplanar.

        image: a picture
        depth: its depth
        base: another picture of the same size and channels
        base_depth: its depth
        nearer: whether smaller or larger depths are nearer; default "smaller"
        tolerance: depths that differ by no more are coplanar; at least 0, at most 1e+30; default 0.0
        coplanar: what is taken of coplanar pictures: image, base, mean, or over (the image over the base); default
            "base"
        scale: what the image's depth is multiplied by; at least -1000000, at most 1000000; default 1.0
        bias: what is added to it then; at least -1000000, at most 1000000; default 0.0
        partial: whether what is farther shows as far as what is nearer does not cover it; default false
        output: the picture, or its depth; default "picture"
        method: exact
        """
        return self.run(
            "z_composite",
            image,
            depth=depth,
            base=base,
            base_depth=base_depth,
            nearer=nearer,
            tolerance=tolerance,
            coplanar=coplanar,
            scale=scale,
            bias=bias,
            partial=partial,
            output=output,
            **options,
        )
