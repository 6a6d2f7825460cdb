"""Who can reach the service at all. The supervisor asks before it listens, and loads nothing else of the doors."""

from __future__ import annotations

import ipaddress
import socket

from lichen_service.access.proxies import Proxies
from lichen_service.http.address import UNIX, address_of
from lichen_service.settings import Settings


def must_not_listen(settings: Settings) -> str | None:
    """Why this configuration may not be served, or None: it would let everybody in from other machines."""
    Proxies.parse(settings.trusted_proxies)
    hosts = [settings.host, *([address_of(settings.metrics)[0]] if settings.metrics else [])]
    reachable = [host or "every interface" for host in hosts if not _is_loopback(host)]
    if settings.insecure == "on" or settings.key_file.exists() or not reachable:
        return None
    return (
        f"{reachable[0]} can be reached from other machines, and no key is needed here: "
        f"make one with 'lichen keys add', or say that this is meant with --insecure"
    )


def _is_loopback(host: str) -> bool:
    """Whether everything a name stands for is this machine alone; the file system is."""
    if not host or host.startswith(UNIX):
        return bool(host)
    try:
        found = {each[4][0] for each in socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)}
    except OSError:
        return False
    return all(ipaddress.ip_address(str(each).partition("%")[0]).is_loopback for each in found)
