"""Checks where the console may listen: on loopback, or elsewhere once there are accounts and TLS."""

from ipaddress import ip_address

from app.settings import ConsoleSettings
from harness.contracts.errors import HarnessError
from harness.contracts.reasons import because


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
        raise ExposureRefused(because("tls_incomplete"))
    if settings.proxies and not settings.names:
        raise ExposureRefused(because("proxy_without_names"))
    if is_loopback(settings.host):
        return
    if not has_accounts:
        raise ExposureRefused(because("exposed_without_account", host=settings.host), where=settings.host)
    if not (settings.tls_certificate or settings.proxies):
        raise ExposureRefused(because("exposed_without_encryption", host=settings.host), where=settings.host)
