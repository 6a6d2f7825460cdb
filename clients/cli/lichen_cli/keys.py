"""`lichen keys`: the keys that callers of the service need, and addresses signed with one.

    lichen keys add --note "the camera at the gate" --scope run --rate 60
    lichen keys list
    lichen keys revoke ID
    lichen keys add --signing
    lichen keys sign '/v1/operations/perlin?width=64&height=64' --for 3600

A new key is printed once, alone on standard output; the file keeps only what proves it. A running service that already
asks for keys sees every change with its next request; one that was started without a file of keys has to be restarted.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

from lichen_cli.main import FAILED, Parser, Usage


def main(arguments: Sequence[str]) -> int:
    from lichen_service.access.keys import SCOPES
    from lichen_service.configuration import load

    parser = Parser(prog="lichen keys", description="Make, list and revoke keys.", allow_abbrev=False)
    commands = parser.add_subparsers(dest="command", required=True, parser_class=Parser)
    add = commands.add_parser("add", help="make a key and print it, once")
    add.add_argument("--note", default="", help="whose it is, for the list")
    add.add_argument("--scope", action="append", choices=SCOPES, help="what it is for (default: everything)")
    add.add_argument("--rate", type=float, default=0.0, help="requests a minute (default: as the service is set)")
    add.add_argument("--jobs", type=int, default=0, help="jobs at a time (default: as the service is set)")
    add.add_argument("--asset-bytes", type=int, default=0, help="bytes of one asset (default: as the service is set)")
    add.add_argument("--signing", action="store_true", help="a key that signs addresses instead of one that is sent")
    commands.add_parser("list", help="list the keys")
    revoke = commands.add_parser("revoke", help="end a key")
    revoke.add_argument("id")
    sign = commands.add_parser("sign", help="sign an address")
    sign.add_argument("target", help="path and query, as /v1/operations/NAME?width=64")
    sign.add_argument("--for", dest="seconds", type=int, default=3600, help="seconds it is good for (default 3600)")
    sign.add_argument("--key", help="ID of the signing key (default: the newest)")
    for each in (*commands.choices.values(),):
        each.add_argument("--keys", metavar="FILE", help="file of keys (default: LICHEN_KEYS, or in the data folder)")
    given = parser.parse_args(arguments)
    return _COMMANDS[given.command](load({"keys": given.keys}).settings.key_file, given)


def _add(path: Path, given: argparse.Namespace) -> int:
    from lichen_service import durable
    from lichen_service.access import keys

    if given.rate < 0 or given.jobs < 0 or given.asset_bytes < 0:
        raise Usage("a quota cannot be negative")
    durable.private_folder(path.parent)
    with durable.locked(path.with_name(path.name + ".lock")):
        known = keys.read(path) if path.exists() else keys.Keys()
        if given.signing:
            known, signer = known.add_signing(given.note)
            keys.write(path, known)
            print(signer.secret)
            print(f"signing key {signer.id} in {path}", file=sys.stderr)
            return 0
        quotas = {"rate": given.rate, "jobs": given.jobs, "asset_bytes": given.asset_bytes}
        known, key, token = known.add(given.scope or keys.SCOPES, note=given.note, **quotas)
        keys.write(path, known)
    print(token)
    print(f"key {key.id} in {path}; it is shown this once", file=sys.stderr)
    return 0


def _list(path: Path, given: argparse.Namespace) -> int:
    from rich.console import Console
    from rich.table import Table

    from lichen_service.access import keys

    known = keys.read(path) if path.exists() else keys.Keys()
    table = Table("id", "for", "a minute", "made", "revoked", "note", box=None, header_style="dim")
    for key in known.keys:
        rate = f"{key.rate:g}" if key.rate else ""
        table.add_row(key.id, " ".join(key.scopes), rate, _day(key.created), _day(key.revoked), key.note)
    for signer in known.signing:
        table.add_row(signer.id, "signing", "", _day(signer.created), _day(signer.revoked), signer.note)
    Console(soft_wrap=True).print(table, markup=False)
    return 0


def _revoke(path: Path, given: argparse.Namespace) -> int:
    from lichen_service import durable
    from lichen_service.access import keys

    durable.private_folder(path.parent)
    with durable.locked(path.with_name(path.name + ".lock")):
        known = (keys.read(path) if path.exists() else keys.Keys()).revoke(given.id)
        if known is None:
            print(f"lichen: there is no live key {given.id} in {path}", file=sys.stderr)
            return FAILED
        keys.write(path, known)
    return 0


def _sign(path: Path, given: argparse.Namespace) -> int:
    from lichen_service.access import keys, signing

    known = keys.read(path) if path.exists() else keys.Keys()
    live = [each for each in known.signing if each.revoked is None and given.key in (None, each.id)]
    if not live:
        print(f"lichen: there is no such signing key in {path}; make one with 'keys add --signing'", file=sys.stderr)
        return FAILED
    try:
        print(signing.sign(given.target, live[-1], int(time.time()) + given.seconds))
    except ValueError as wrong:
        raise Usage(f"the address cannot be signed: {wrong}") from None
    return 0


def _day(seconds: float | None) -> str:
    return "" if seconds is None else datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d")


_COMMANDS: dict[str, Callable[[Path, argparse.Namespace], int]] = {
    "add": _add,
    "list": _list,
    "revoke": _revoke,
    "sign": _sign,
}
