"""Refuses a connection to an address that a request may not reach, at the moment it is made.

A name is looked up by whoever connects, so a check before it can be true and false a moment later (DNS rebinding), and
a redirect leads elsewhere. The interpreter announces every `connect` with the address itself; that is what is checked.
"""

import socket
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network
from typing import Any

from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because

Address = IPv4Address | IPv6Address
Permits = Callable[[Address], bool]
METADATA = frozenset({ip_address("fd00:ec2::254"), ip_address("100.100.100.200"), ip_address("192.0.0.192")})
"""Where clouds answer with credentials at addresses that are not link-local."""
_permits: ContextVar[Permits | None] = ContextVar("permits", default=None)


class ConnectionForbidden(OSError):
    """The address that a name led to is one that this request may not reach."""


def of_this_link(address: Address) -> bool:
    """Whether an address is link-local, multicast, unspecified, or one of cloud metadata: no service is there."""
    inner = _inner(address)
    return inner.is_link_local or inner.is_multicast or inner.is_unspecified or inner in METADATA


def not_of_this_link(address: Address) -> bool:
    """What an address that an administrator configured may lead to."""
    return not of_this_link(address)


class PublicOr:
    """Permits public addresses, and those of the named networks. Link-local and metadata addresses never.

    Raises ContractInvalid for what is no network.
    """

    def __init__(self, networks: Sequence[str], *, where: str) -> None:
        self._networks: list[IPv4Network | IPv6Network] = []
        for network in networks:
            try:
                self._networks.append(ip_network(network))
            except ValueError as error:
                raise ContractInvalid(because("network_invalid", network=network[:60]), where=where) from error

    def __call__(self, address: Address) -> bool:
        inner = _inner(address)
        if of_this_link(inner):
            return False
        return inner.is_global or any(inner in network for network in self._networks)


def addresses_of(host: str) -> tuple[Address, ...]:
    """Where a name leads now; nowhere for one that is unknown."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return ()
    return tuple(dict.fromkeys(ip_address(str(one[4][0]).partition("%")[0]) for one in found))


@contextmanager
def guarded(permits: Permits) -> Iterator[None]:
    """Within the block, in this thread, a connection to any other address raises ConnectionForbidden."""
    _installed()
    token = _permits.set(permits)
    try:
        yield
    finally:
        _permits.reset(token)


def _inner(address: Address) -> Address:
    """The IPv4 address within an IPv6 one, where it maps or tunnels one."""
    if isinstance(address, IPv6Address):
        return address.ipv4_mapped or address.sixtofour or address
    return address


@cache
def _installed() -> None:
    sys.addaudithook(_announced)


def _announced(event: str, arguments: tuple[Any, ...]) -> None:
    if event not in ("socket.connect", "socket.sendto"):
        return
    permits = _permits.get()
    if permits is None or arguments[0].family not in (socket.AF_INET, socket.AF_INET6):
        return
    host = str(arguments[1][0]).partition("%")[0]
    try:
        address = ip_address(host)
    except ValueError:
        raise ConnectionForbidden(f"{host} is a name, not an address") from None
    if not permits(address):
        raise ConnectionForbidden(f"{address} is not an address that this request may reach")
