"""What comes back: the pixels, and the service's account of how it made them."""

from __future__ import annotations

import json
import os
import re
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lichen_client.npy import MEDIA_TYPE as NPY
from lichen_client.npy import from_npy
from lichen_client.retry import Reply

if TYPE_CHECKING:
    import numpy as np

MIXED = "multipart/mixed"
_SUFFIXES = {
    ".npy": NPY,
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".webp": "image/webp",
    ".tif": "image/tiff",
    ".tiff": "image/tiff",
    ".exr": "image/x-exr",
}


@dataclass(frozen=True, slots=True)
class Error:
    """How far the result may be from the exact one, in output units.

    `kind` is "bound" (proved), "estimate" (from a calibration corpus) or "measured" (on this image); `metric` says over
    what, such as "max".
    """

    value: float
    kind: str
    metric: str


@dataclass(frozen=True, slots=True)
class Measured:
    """How far the result is from the exact one, as found on this image, in output units."""

    largest: float
    p999: float
    """exceeded by one sample in a thousand"""
    rms: float
    mismatched: int
    """samples that are NaN or infinite on one side only"""
    sampled: float
    """the share of the pixels that were compared"""
    codes: int | None = None
    """the largest difference in code values, where the result has integers"""
    ciede2000: float | None = None
    """the largest, where the result is a picture"""


@dataclass(frozen=True, slots=True)
class Report:
    """How a result was made."""

    method: str
    device: str
    error: Error | None
    measured: Measured | None
    """where `verify=True` was asked and could be had"""
    timing: Mapping[str, float]
    """seconds per stage, as the service measured them"""
    skipped: str
    """work the service left out because it could not change the result, or ''"""
    nonfinite: int | None
    """NaN and infinite samples in the result; None where the service did not count"""
    request_id: str
    etag: str
    space: str = ""
    """what the numbers mean: srgb, linear or data"""

    @classmethod
    def read(cls, headers: Mapping[str, str]) -> Report:
        """From the header fields of an answer (lower-case names). What is absent or unreadable is left empty."""
        nonfinite = headers.get("lichen-nonfinite", "").partition(";")[0].strip()
        return cls(
            method=headers.get("lichen-method", ""),
            device=headers.get("lichen-device", ""),
            error=_read_error(headers.get("lichen-error", "")),
            measured=_read_measured(headers.get("lichen-measured", "")),
            timing=_read_timing(headers.get("server-timing", "")),
            skipped=headers.get("lichen-skipped", ""),
            nonfinite=int(nonfinite) if nonfinite.isascii() and nonfinite.isdigit() else None,
            request_id=headers.get("x-request-id", ""),
            etag=headers.get("etag", ""),
            space=headers.get("lichen-space", "").partition(";")[0].strip(),
        )


def _read_error(value: str) -> Error | None:
    parts = [part.strip() for part in value.split(";")]
    try:
        number = float(parts[0])
    except ValueError:
        return None
    return Error(number, *[*parts[1:3], "", ""][:2])


def _read_measured(value: str) -> Measured | None:
    """From "1.2e-07; measured; max; sampled=1; p999=...; rms=...; mismatched=0; codes=1; ciede2000=0.1", the last two
    of some results only; None where it says anything else."""
    first, *rest = (part.strip() for part in value.split(";"))
    given = dict(part.partition("=")[::2] for part in rest)
    try:
        largest, p999, rms = (float(each) for each in (first, given["p999"], given["rms"]))
        codes = int(given["codes"]) if "codes" in given else None
        seen = float(given["ciede2000"]) if "ciede2000" in given else None
        return Measured(largest, p999, rms, int(given["mismatched"]), float(given["sampled"]), codes, seen)
    except (KeyError, ValueError):
        return None


def _read_timing(value: str) -> dict[str, float]:
    """Server-Timing ("decode;dur=1.25, plan;dur=0.1", milliseconds) as seconds; entries without a time are left out."""
    timing = {}
    for entry in value.split(","):
        name, *attributes = (part.strip() for part in entry.split(";"))
        for attribute in attributes:
            key, _, number = attribute.partition("=")
            if key.strip().lower() == "dur":
                try:
                    timing[name] = float(number.strip().strip('"')) / 1e3
                except ValueError:
                    continue
    return timing


@dataclass(frozen=True)
class Result:
    """A computed image: an array, or the bytes of the format that was asked for."""

    media_type: str
    report: Report
    body: bytearray = field(repr=False)
    """the bytes as they came; `array` shares their memory"""
    findings: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """what the operation reports beside pixels"""
    map: Result | None = field(default=None, repr=False)
    """with `verify=True`: a picture of the errors that were found"""
    plan: Callable[[], Any] | None = field(default=None, repr=False, compare=False)
    """asks the service for the plan that this result followed; see `explain`"""

    @classmethod
    def read(cls, reply: Reply) -> Result:
        """From an answer, of several parts too. Raises ValueError where these cannot be told apart."""
        if is_mixed(reply):
            return cls._of_parts(reply)
        media_type = reply.headers.get("content-type", "").partition(";")[0].strip().lower()
        return cls(media_type, Report.read(reply.headers), reply.body)

    @classmethod
    def _of_parts(cls, reply: Reply) -> Result:
        pictures: list[Result] = []
        findings: Mapping[str, Any] = {}
        for headers, body in parts_of(reply):
            if headers.get("content-type", "").startswith("application/json"):
                findings = json.loads(body)
            else:
                pictures.append(cls.read(Reply(reply.status, {**reply.headers, **headers}, body)))
        if not pictures:
            raise ValueError("it holds no picture")
        return replace(pictures[0], findings=findings, map=pictures[1] if len(pictures) > 1 else None)

    def explain(self) -> Any:
        """The plan this result followed: nodes, methods with what the others would have cost, decisions with reasons.

        Asks the service once more, without computing a pixel; of an `AsyncClient`, to be awaited. Raises ValueError
        for the result of a job that was found by its id alone.
        """
        return _asked(self.plan)

    def planned(self, plan: Callable[[], Any] | None) -> Result:
        """The same result, which knows where it came from."""
        return replace(self, plan=plan)

    def _repr_png_(self) -> bytes | None:
        """What a notebook shows."""
        if self.media_type == NPY:
            from lichen_client.preview import png_of

            return png_of(self.array, linear=self.report.space == "linear")
        return self.content if self.media_type == "image/png" else None

    def _repr_jpeg_(self) -> bytes | None:
        return self.content if self.media_type == "image/jpeg" else None

    @cached_property
    def array(self) -> np.ndarray[Any, np.dtype[Any]]:
        """Shape (height, width, channels), in the sample type the service sent; writable, without a copy.

        Raises ValueError where the result was asked for in an encoded format.
        """
        if self.media_type != NPY:
            raise ValueError(
                f"this result is {self.media_type or 'of unknown type'}; leave out `format` to get an array"
            )
        return from_npy(self.body)

    @property
    def content(self) -> bytes:
        """The bytes of the file, of type `media_type`."""
        return bytes(self.body)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the file at once or not at all. Raises ValueError where the suffix names another format."""
        target = Path(path)
        wanted = _SUFFIXES.get(target.suffix.lower(), self.media_type)
        if wanted != self.media_type:
            name = target.suffix.lower().lstrip(".")
            raise ValueError(f"this result is {self.media_type}; ask for {target.name} with format={name!r}")
        # Beside the target, so that the last step is a rename within one file system.
        part = target.with_name(f".{target.name}.{os.getpid()}-{threading.get_ident()}.part")
        try:
            part.write_bytes(self.body)
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)


@dataclass(frozen=True)
class Results(Mapping[str, Result]):
    """What a pipeline made, by the names of its outputs."""

    outputs: Mapping[str, Result]
    findings: Mapping[str, Any]
    """what its operations report beside pixels, by the names of the nodes"""
    maps: Mapping[str, Result]
    """with `verify=True`: pictures of the errors that were found, by the names of the outputs"""
    plan: Callable[[], Any] | None = field(default=None, repr=False, compare=False)
    """as of a `Result`"""

    def explain(self) -> Any:
        """The plan that all of them followed; see `Result.explain`."""
        return _asked(self.plan)

    def planned(self, plan: Callable[[], Any] | None) -> Results:
        """The same results, which know where they came from."""
        outputs = {name: each.planned(plan) for name, each in self.outputs.items()}
        return replace(self, outputs=outputs, plan=plan)

    def __getitem__(self, name: str) -> Result:
        return self.outputs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.outputs)

    def __len__(self) -> int:
        return len(self.outputs)

    def _repr_html_(self) -> str:
        """What a notebook shows: the outputs under their names."""
        import base64
        import html

        shown = []
        for name, result in self.outputs.items():
            jpeg, png = result._repr_jpeg_(), result._repr_png_()
            data, kind = (jpeg, "jpeg") if jpeg else (png, "png")
            source = f"data:image/{kind};base64,{base64.b64encode(data).decode()}" if data else ""
            picture = f'<img src="{source}">' if source else html.escape(result.media_type)
            shown.append(f"<figure>{picture}<figcaption>{html.escape(name)}</figcaption></figure>")
        return "\n".join(shown)

    @classmethod
    def read(cls, reply: Reply) -> Results:
        """From an answer of several parts. Raises ValueError where it is none."""
        outputs: dict[str, Result] = {}
        maps: dict[str, Result] = {}
        findings: dict[str, Any] = {}
        for headers, body in parts_of(reply):
            media_type = headers.get("content-type", "").partition(";")[0].strip().lower()
            if media_type == "application/json":
                findings = json.loads(body)
                continue
            result = Result.read(Reply(reply.status, {**reply.headers, **headers}, body))
            into = maps if "lichen-map" in headers else outputs
            into[headers.get("lichen-output", "result")] = result
        return cls(outputs, findings, maps)


def _asked(plan: Callable[[], Any] | None) -> Any:
    if plan is None:
        raise ValueError("this result does not know where it came from")
    return plan()


def is_mixed(reply: Reply) -> bool:
    """Whether an answer has several parts."""
    return reply.headers.get("content-type", "").lower().startswith("multipart/")


def parts_of(reply: Reply) -> Iterator[tuple[dict[str, str], bytearray]]:
    """Headers (lower-case) and bodies of a multipart body (RFC 2046). Raises ValueError."""
    content_type = reply.headers.get("content-type", "")
    found = re.search(r'boundary="?([^";]+)"?', content_type)
    if found is None or not content_type.lower().startswith("multipart/"):
        raise ValueError(f"it is {content_type or 'of unknown type'}, not multipart")
    mark = b"--" + found[1].encode()
    at = reply.body.find(mark)
    while at >= 0:
        at += len(mark)
        if reply.body[at : at + 2] == b"--":
            return
        begin, end = reply.body.find(b"\r\n\r\n", at), reply.body.find(b"\r\n" + mark, at)
        if begin < 0 or end < begin:
            break
        lines = reply.body[at:begin].decode("latin-1").strip().split("\r\n")
        headers = {name.strip().lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
        yield headers, reply.body[begin + 4 : end]
        at = end + 2
    raise ValueError("a part has no end")
