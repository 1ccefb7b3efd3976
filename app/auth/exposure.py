"""Checks where the console may listen: on loopback, or elsewhere once there are accounts and TLS."""

from ipaddress import ip_address

from app.settings import ConsoleSettings
from harness.contracts.errors import HarnessError


class ExposureRefused(HarnessError):
    """The console would be reachable by others without accounts or without TLS."""

    code = "exposure_refused"


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches that address."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def check_exposure(settings: ConsoleSettings, *, has_accounts: bool) -> None:
    """Raises ExposureRefused unless the address is loopback, or there are accounts and TLS or a declared proxy."""
    half_tls = bool(settings.tls_certificate) != bool(settings.tls_key)
    if half_tls:
        raise ExposureRefused(
            "TLS needs a certificate and its key", do="set both REGEN_TLS_CERTIFICATE and REGEN_TLS_KEY, or neither"
        )
    if settings.proxies and not settings.names:
        raise ExposureRefused(
            "A proxy is declared, and no name under which people reach it",
            do="set REGEN_NAMES to the names that stand in people's address bars",
        )
    if is_loopback(settings.host):
        return
    if not has_accounts:
        raise ExposureRefused(
            f"Others would reach {settings.host}, and nobody has an account",
            where=settings.host,
            do="add an admin with `regen account add NAME --role admin`, or listen on 127.0.0.1",
        )
    if not (settings.tls_certificate or settings.proxies):
        raise ExposureRefused(
            f"Others would reach {settings.host} without encryption: passwords would be readable on the way",
            where=settings.host,
            do="set REGEN_TLS_CERTIFICATE and REGEN_TLS_KEY, or REGEN_PROXIES to the addresses of a TLS proxy in front",
        )
