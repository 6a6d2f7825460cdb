"""At the door, before a body is read: who is it, may they, and not too often.

Doors are open (everybody may do everything) where no file of keys exists or `insecure` is on; the supervisor
refuses to listen beyond this machine then, unless it was told that this is meant. A file of keys that existed when
the process started keeps the door shut for as long as it runs, whatever becomes of the file.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from lichen_service.access import signing
from lichen_service.access.keys import SCOPES, Key, KeyFile
from lichen_service.access.proxies import Proxies
from lichen_service.access.rates import Rates, Verdict
from lichen_service.http.message import Head
from lichen_service.refusals import Refusal
from lichen_service.settings import Settings

REALM = 'Bearer realm="lichen"'
_SIGNED = frozenset(("run", "assets"))


class Caller(NamedTuple):
    """Who sent a request. `name` is a key's, empty where none was asked for; quotas of 0 are those of the settings."""

    address: str = ""
    name: str = ""
    scopes: frozenset[str] = frozenset(SCOPES)
    jobs: int = 0
    asset_bytes: int = 0
    rate: Verdict | None = None
    burst: int = 0
    window: float = 0.0

    @property
    def rate_headers(self) -> dict[str, str]:
        """What is left of the rate (the RateLimit header fields, an Internet-Draft of the IETF)."""
        if self.rate is None:
            return {}
        return {
            "RateLimit-Policy": f'"requests";q={self.burst};w={max(1, round(self.window))}',
            "RateLimit": f'"requests";r={self.rate.remaining};t={-(-self.rate.reset // 1):.0f}',
        }


class Guard:
    def __init__(self, settings: Settings, shared: Path | None = None) -> None:
        """`shared` is a folder that all worker processes of this service have in common."""
        self._settings = settings
        self._proxies = Proxies.parse(settings.trusted_proxies)
        path = settings.key_file
        self._keys = KeyFile(path) if path.exists() and settings.insecure == "off" else None
        self._rates = Rates(shared / "rates" if shared else None)

    @property
    def open(self) -> bool:
        return self._keys is None

    @property
    def indifferent(self) -> bool:
        """Whether everybody may come in, as often as they like, and nothing depends on who they are."""
        return self.open and not self._settings.rate and not self._proxies.any

    def admit(self, head: Head, scope: str) -> Caller:
        """The caller of a request that needs `scope` (empty: any good key). Raises the 401, 403 or 429 refusal."""
        address = self._proxies.client(head.peer, head.headers)
        if self._keys is None:
            return self._within_rate(Caller(address), f"address {address}", 0.0)
        authorization = head.headers.get("authorization")
        if authorization is None and signing.is_signed(head.query):
            return self._signed(head, address, scope)
        if authorization is None:
            raise _unauthorized("A key is needed: send it as 'Authorization: Bearer KEY'.", "")
        kind, _, token = authorization.partition(" ")
        key = self._keys.current().bearer(token.strip()) if kind.lower() == "bearer" else None
        if key is None:
            raise _unauthorized("The key is not good, or no longer.", ', error="invalid_token"')
        return self._held_to_scope(key, address, scope)

    def _held_to_scope(self, key: Key, address: str, scope: str) -> Caller:
        if scope and scope not in key.scopes:
            raise Refusal(
                403,
                "forbidden",
                "The key is not for this",
                f"The key {key.id} lacks the scope '{scope}'.",
                headers={"WWW-Authenticate": f'{REALM}, error="insufficient_scope", scope="{scope}"'},
            )
        caller = Caller(address, key.id, frozenset(key.scopes), key.jobs, key.asset_bytes)
        return self._within_rate(caller, f"key {key.id}", key.rate)

    def _signed(self, head: Head, address: str, scope: str) -> Caller:
        assert self._keys is not None
        try:
            key = signing.verify(head.path, head.query, self._keys.current())
        except signing.BadSignature as bad:
            raise _refused_signature(f"The signed address is not good: {bad}.") from None
        if head.method not in ("GET", "HEAD") or (scope and scope not in _SIGNED):
            raise _refused_signature("A signed address lets images be read; it permits nothing else.")
        return self._within_rate(Caller(address, f"signed-{key.id}", _SIGNED), f"key {key.id}", 0.0)

    def _within_rate(self, caller: Caller, name: str, own: float) -> Caller:
        per_minute, burst = own or self._settings.rate, self._settings.burst
        if not per_minute:
            return caller
        verdict = self._rates.ask(name, per_minute / 60, burst)
        caller = caller._replace(rate=verdict, burst=burst, window=60 * burst / per_minute)
        if verdict.allowed:
            return caller
        raise Refusal(
            429,
            "rate-exceeded",
            "Too many requests",
            f"More than {per_minute:g} requests a minute, and {burst} at once, are not answered.",
            headers={"Retry-After": str(max(1, -int(-verdict.retry_after // 1))), **caller.rate_headers},
            retryable=True,
            limit=per_minute,
        )


def _unauthorized(detail: str, error: str) -> Refusal:
    title = "The request is not authorised"
    return Refusal(401, "unauthorized", title, detail, headers={"WWW-Authenticate": REALM + error})


def _refused_signature(detail: str) -> Refusal:
    return Refusal(403, "bad-signature", "The signed address is not good", detail, headers={"WWW-Authenticate": REALM})
