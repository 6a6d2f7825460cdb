"""Whose word is taken on where a request comes from.

A proxy that is trusted appends the address of its own client to `X-Forwarded-For`. So the list is read from its end,
for as long as the addresses are those of trusted proxies; the first other one is the client. What a client wrote
there itself lies further left and is never reached.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping
from dataclasses import dataclass

Network = ipaddress.IPv4Network | ipaddress.IPv6Network
UNIX = "unix"
"""Stands, in the list of trusted proxies, for whoever may open our unix socket."""


@dataclass(frozen=True, slots=True)
class Proxies:
    networks: tuple[Network, ...] = ()
    unix: bool = False

    @classmethod
    def parse(cls, text: str) -> Proxies:
        """From addresses and networks with commas between. Raises `ValueError`."""
        names = [each.strip() for each in text.split(",") if each.strip()]
        networks = tuple(ipaddress.ip_network(each) for each in names if each != UNIX)
        return cls(networks, UNIX in names)

    @property
    def any(self) -> bool:
        """Whether there are proxies whose word is taken."""
        return self.unix or bool(self.networks)

    def client(self, peer: str, headers: Mapping[str, str]) -> str:
        """The address a request comes from; `peer` is who opened the connection (empty for a unix socket)."""
        if not self.any:
            return peer
        address = peer
        hops = [each.strip() for each in headers.get("x-forwarded-for", "").split(",") if each.strip()]
        while hops and self._trusts(address):
            address = hops.pop()
            if _address(address) is None:
                return peer  # a proxy that writes something else is not the proxy we were told of
        return address

    def _trusts(self, name: str) -> bool:
        address = _address(name)
        if address is None:
            return self.unix and not name
        return any(address in each for each in self.networks if each.version == address.version)


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        address = ipaddress.ip_address(name)
    except ValueError:
        return None
    mapped = getattr(address, "ipv4_mapped", None)
    return mapped or address
