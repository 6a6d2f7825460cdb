"""Keys of callers, and the file they are kept in.

A bearer key is `lichen_ID_SECRET`, 256 random bits behind its name; the file keeps SHA-256 of the secret only. A slow
hash would protect nothing here: nobody guesses 256 bits. A signing key has to be kept as it is, since both sides need
it to make the same signature; so the file is its owner's alone (0600).

A file that has changed is read again with the next request, so a revoked key ends without a restart. A file that
cannot be read any more ends all keys, with an entry in the log: doors fail closed.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import re
import secrets
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from lichen_service import durable
from lichen_service.logs import log

SCOPES = ("run", "assets", "jobs", "metrics")
"""What a key may be for: computing, storing inputs, work in the background, figures of the service."""
_TOKEN = re.compile(r"lichen_([a-z0-9]{8})_([A-Za-z0-9_-]{43})")
_NOBODY = hashlib.sha256(b"").hexdigest()


@dataclass(frozen=True, slots=True)
class Key:
    """A bearer key as it is kept. Quotas of 0 leave it to the settings of the service."""

    id: str
    digest: str
    scopes: tuple[str, ...] = SCOPES
    rate: float = 0.0
    """requests a minute"""
    jobs: int = 0
    """jobs that wait or run at a time"""
    asset_bytes: int = 0
    """bytes of one stored asset"""
    note: str = ""
    created: float = 0.0
    revoked: float | None = None


@dataclass(frozen=True, slots=True)
class SigningKey:
    id: str
    secret: str
    note: str = ""
    created: float = 0.0
    revoked: float | None = None


@dataclass(frozen=True, slots=True)
class Keys:
    """All keys of a file, revoked ones included."""

    keys: tuple[Key, ...] = ()
    signing: tuple[SigningKey, ...] = ()

    def bearer(self, token: str) -> Key | None:
        """The live key a token proves. Takes the same time for a key that does not exist."""
        match = _TOKEN.fullmatch(token)
        name, secret = match.groups() if match else ("", "")
        found = next((each for each in self.keys if each.id == name and each.revoked is None), None)
        same = hmac.compare_digest(_digest(secret), found.digest if found else _NOBODY)
        return found if same and found else None

    def signer(self, name: str) -> SigningKey | None:
        return next((each for each in self.signing if each.id == name and each.revoked is None), None)

    def add(self, scopes: Sequence[str] = SCOPES, **more: Any) -> tuple[Keys, Key, str]:
        """The keys with a new one, that key, and the token, which exists nowhere else."""
        secret = secrets.token_urlsafe(32)
        key = Key(_name(), _digest(secret), tuple(scopes), created=time.time(), **more)
        return replace(self, keys=(*self.keys, key)), key, f"lichen_{key.id}_{secret}"

    def add_signing(self, note: str = "") -> tuple[Keys, SigningKey]:
        key = SigningKey(_name(), secrets.token_urlsafe(32), note, time.time())
        return replace(self, signing=(*self.signing, key)), key

    def revoke(self, name: str) -> Keys | None:
        """The keys with this one revoked; None where no live key has the name."""
        live = {each.id for each in self.keys if each.revoked is None}
        if name not in live and self.signer(name) is None:
            return None
        now = time.time()
        keys = tuple(replace(each, revoked=now) if each.id == name else each for each in self.keys)
        signing = tuple(replace(each, revoked=now) if each.id == name else each for each in self.signing)
        return Keys(keys, signing)


def read(path: Path) -> Keys:
    """The keys of a file. Raises `OSError`, or `ValueError` for a file that holds something else."""
    try:
        document = json.loads(path.read_text("utf-8"))
        keys = tuple(Key(**{**each, "scopes": tuple(each["scopes"])}) for each in document["keys"])
        return Keys(keys, tuple(SigningKey(**each) for each in document["signing"]))
    except (KeyError, TypeError, UnicodeDecodeError, json.JSONDecodeError) as broken:
        raise ValueError(f"{path} is not a file of keys: {broken}") from None


def write(path: Path, keys: Keys) -> None:
    durable.private_folder(path.parent)
    durable.write(path, json.dumps(asdict(keys), indent=1).encode() + b"\n")


@dataclass
class KeyFile:
    """A file of keys that is looked at again whenever it has changed."""

    path: Path
    _keys: Keys = field(default_factory=Keys)
    _stamp: tuple[int, int, int] | None = None

    def current(self) -> Keys:
        try:
            status = os.stat(self.path)
            stamp = (status.st_mtime_ns, status.st_ino, status.st_size)
            if stamp != self._stamp:
                self._keys, self._stamp = read(self.path), stamp
        except (OSError, ValueError) as failure:
            if self._keys != Keys():
                log.error("the file of keys cannot be read; no key is good now", reason=str(failure))
            self._keys, self._stamp = Keys(), None
        return self._keys


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _name() -> str:
    return secrets.token_hex(4)
