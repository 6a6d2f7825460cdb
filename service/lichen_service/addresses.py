"""The one spelling of an address that stands for a run: what caches and people should call it.

Two addresses mean the same run when their parameters do: in any order, with defaults written out or left out, with
`3`, `3.0` or `+3e0`. The canonical one names only what is not the default, sorted, each value as plain as it can be.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from urllib.parse import quote, urlencode

from lichen.operation import Operation
from lichen_service.descriptions import path_of
from lichen_service.documents import as_query, plain
from lichen_service.queries import Query


def canonical_of(operation: Operation[Any], query: Query) -> str:
    """Path and query of a run whose images are all stored."""
    fields = operation.parameters.model_fields
    declared = {name: value for name, value in query.values.items() if name in fields}
    knobs = {name: float(value) for name, value in query.values.items() if name not in fields}
    values: dict[str, Any] = {
        **operation.validate(declared).model_dump(exclude_defaults=True),
        **query.options.model_dump(exclude_defaults=True),
        **knobs,
        **query.assets,
    }
    return address_of(operation, values)


def address_of(operation: Operation[Any], values: Mapping[str, Any]) -> str:
    """Path and query of a run with these values, as they are called in queries."""
    pairs = sorted(as_query({name: _short(plain(value)) for name, value in values.items()}))
    path = quote(path_of(operation.name))
    return f"{path}?{urlencode(pairs, quote_via=quote, safe=':,[]')}" if pairs else path


def link_to(address: str) -> Mapping[str, str]:
    """The header field that names it (RFC 6596)."""
    return {"Link": f'<{address}>; rel="canonical"'}


def _short(value: Any) -> Any:
    """Whole numbers without a fraction, in lists too."""
    if isinstance(value, list):
        return [_short(each) for each in value]
    if isinstance(value, Mapping):
        return {name: _short(each) for name, each in value.items()}
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < 1e15 else value
