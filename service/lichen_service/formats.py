"""How a result is delivered: its format, and with it storage, colour space and alpha.

Rules
- `format=` decides; else `Accept` does; among formats liked equally the first input's own comes first, then PNG for
  integers and EXR for floats, then the others.
- A format that cannot hold the result (its channels, its side, the asked storage) is not offered.
- A picture is converted to the space and the kind of alpha that are natural to the format, unless the operation's very
  purpose was to change them: then the numbers stay as they are, and a format in which they are natural is preferred.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lichen.errors import Flaw, InvalidRequest
from lichen.files import FORMATS, READABLE, Format
from lichen.image import Alpha, Image, Space, Storage
from lichen.operation import Facts
from lichen_service.negotiation import acceptable
from lichen_service.queries import Options
from lichen_service.refusals import Refusal


@dataclass(frozen=True, slots=True)
class Delivery:
    """How the result leaves. `space` and `alpha` of None leave the result's own."""

    format: Format
    storage: Storage
    space: Space | None
    alpha: Alpha | None


@dataclass(frozen=True, slots=True)
class Origin:
    """What of the first input the choice depends on."""

    format: str
    storage: Storage
    space: Space
    alpha: Alpha


NOWHERE = Origin("", Storage.FLOAT32, Space.DATA, Alpha.NONE)
"""For operations that read no image."""


def readable() -> tuple[str, ...]:
    """Every media type an image may be sent in, sorted."""
    return _READABLE


def agree(options: Options, accept: str | None, result: Facts, origin: Origin) -> Delivery:
    """The delivery of a result of which `result` is known.

    Raises `InvalidRequest` when what the query asks for cannot be had, and the 406 refusal, which lists what can,
    when `Accept` names nothing of it.
    """
    deliveries = {name: _deliver(each, options, result, origin) for name, each in FORMATS.items()}
    reasons = {name: _unfit(each, options, result) for name, each in deliveries.items()}
    if options.format is not None:
        if reasons[options.format]:
            raise InvalidRequest(
                f"The result cannot be sent as {options.format}.", [_flaw(options, reasons[options.format])]
            )
        return deliveries[options.format]
    fitting = [name for name, reason in reasons.items() if not reason]
    if not fitting:
        raise InvalidRequest("No format can hold the result.", [_flaw(options, "; ".join(reasons.values()))])
    liked = acceptable(accept, _MEDIA_TYPES, _preference(result, origin))
    chosen = next((name for name in liked if name in fitting), None)
    if chosen is None:
        raise _not_acceptable(fitting, {name: reasons[name] for name in liked})
    return deliveries[chosen]


_READABLE = tuple(sorted({media_type for each in READABLE.values() for media_type in each.media_types}))
_MEDIA_TYPES = {name: each.media_types for name, each in FORMATS.items()}


def _deliver(format: Format, options: Options, result: Facts, origin: Origin) -> Delivery:
    storage = options.storage or format.storage_for(origin.storage)
    natural = format.natural_space(storage)
    keep = natural is Space.DATA or result.space is not origin.space
    space = options.space or (None if keep else natural)
    alpha = options.alpha or (format.association if result.alpha is origin.alpha else result.alpha)
    return Delivery(format, storage, space, None if result.alpha is Alpha.NONE else alpha)


def _unfit(delivery: Delivery, options: Options, result: Facts) -> str:
    """Why a format cannot hold the result; empty when it can."""
    format = delivery.format
    if delivery.storage not in format.storages:
        return f"{format.name} holds {' or '.join(format.storages)}, not {delivery.storage}"
    height = result.height // result.pages
    if max(result.width, height) > format.largest_side:
        return f"the result is {result.width}x{height} px and {format.name} ends at {format.largest_side} px"
    if reason := format.unfit_pages(result.pages):
        return reason
    if delivery.alpha is not None and format.association not in (None, delivery.alpha):
        return f"{format.name} holds {format.association} alpha only"
    converted = Space.DATA not in (result.space, delivery.space) and delivery.space is not None
    stand_in = Image(
        np.broadcast_to(np.float32(0), (result.height, result.width, result.channels)),  # no memory behind it
        delivery.space if converted and delivery.space else result.space,
        delivery.alpha or result.alpha,
        delivery.storage,
    )
    return format.unfit(stand_in) or ""


def _preference(result: Facts, origin: Origin) -> list[str]:
    """Formats in the order in which they suit the result."""
    integer = origin.storage.integer and result.space is not Space.LINEAR
    usual = ["png", "tiff", "exr"] if integer else ["exr", "tiff", "png"]
    own = [origin.format] if result.space is origin.space or integer else []
    return [*own, *usual, *FORMATS]


def _flaw(options: Options, reason: str) -> Flaw:
    asked = next((name for name in ("storage", "alpha", "format") if getattr(options, name) is not None), "format")
    return Flaw(f"/query/{asked}", reason)


def _not_acceptable(fitting: list[str], liked: Mapping[str, str]) -> Refusal:
    available = ", ".join(sorted(FORMATS[name].media_types[0] for name in fitting))
    because = "".join(f" {reason}." for reason in liked.values() if reason)
    return Refusal(
        406,
        "not-acceptable",
        "The result cannot be sent in a format you accept",
        f"The result can be sent as {available}.{because}",
        headers={"Vary": "Accept"},
    )
