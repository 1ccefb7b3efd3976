"""The settings of the console, read once at start and passed down."""

from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

from pydantic import Field, SecretStr, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict, SettingsError

from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because

ROOT = Path(__file__).resolve().parents[1]


class OidcSettings(BaseSettings):
    """The OpenID Connect provider that people may sign in at, from REGEN_OIDC_*; none without `issuer`.

    `roles` says which roles a group has here: {"robot-operators": ["operator"]}; who has none is refused. Groups stand
    in the claim `groups_claim` of the identity token, else of the userinfo endpoint. `hosts` may be asked beside the
    issuer's own; `authority` is a file of certificates to trust for it.
    """

    model_config = SettingsConfigDict(env_prefix="REGEN_OIDC_", frozen=True, extra="ignore")

    issuer: str = ""
    client_id: str = ""
    client_secret: SecretStr = SecretStr("")
    client_secret_file: Path | None = None
    scopes: tuple[str, ...] = ("openid", "profile")
    groups_claim: str = "groups"
    roles: dict[str, tuple[str, ...]] = {}
    hosts: tuple[str, ...] = ()
    authority: Path | None = None
    title: Annotated[str, Field(max_length=60)] = ""

    @property
    def name(self) -> str:
        """What the button on the sign-in page calls it: the title, else the issuer's host; empty without an issuer."""
        return self.title or urlsplit(self.issuer).hostname or ""


def oidc_settings() -> OidcSettings:
    """From the environment. Raises ContractInvalid that names the setting, and not what stands in it."""
    try:
        return OidcSettings()
    except ValidationError as error:
        named = "_".join(str(part) for part in error.errors()[0]["loc"][:1])
    except SettingsError as error:
        named = next((one for one in OidcSettings.model_fields if f'"{one}"' in str(error)), "")
    raise ContractInvalid(because("identity_setting_unreadable"), where=f"REGEN_OIDC_{named.upper()}")


class ConsoleSettings(BaseSettings):
    """Settings of one console, from REGEN_* or from the caller. `owner_token` opens the API to the command line
    of a user of this machine, `owner`, as whom nothing is decided; `regen up` takes whoever it runs as.

    `names` are the host names (with a port unless it is the usual one) that people use beside loopback's; `proxies`
    the addresses of TLS proxies in front, whose word on where a request comes from is taken. `streams` are the live
    pages and 3D views that one person or token may hold open, `connections` those of everybody together.
    `upload_bytes`: the largest recording or map that is taken from a browser or a command line; 0 takes none.
    `niceness`: where the console asks to stand in the queue for a processor, so that a stop is not late on a busy
    machine; a system that does not allow it leaves it where it is.
    `otlp_endpoint`: where ended missions are sent to as OpenTelemetry traces (extra `otel`); nowhere without it.
    `notify_networks`: private networks, such as 10.1.0.0/16, that the addresses in `notify` may lead into.
    """

    model_config = SettingsConfigDict(env_prefix="REGEN_", frozen=True, extra="ignore")

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8000
    names: tuple[str, ...] = ()
    tls_certificate: Path | None = None
    tls_key: Path | None = None
    proxies: tuple[str, ...] = ()
    password_memory_kib: Annotated[int, Field(ge=19456, le=2**21)] = 65536
    rate_per_s: Annotated[float, Field(gt=0)] = 200.0
    rate_burst: Annotated[float, Field(ge=1)] = 1000.0
    stranger_rate_per_s: Annotated[float, Field(gt=0)] = 20.0
    stranger_rate_burst: Annotated[float, Field(ge=1)] = 300.0
    streams: Annotated[int, Field(ge=1)] = 32
    connections: Annotated[int, Field(ge=8)] = 512
    niceness: Annotated[int, Field(ge=-20, le=19)] = -10
    speed: Annotated[float, Field(ge=0)] = 4.0
    robots: tuple[str, ...] = ("vbot-1",)
    operator: str = "operator"
    owner: str = "owner"
    owner_token: SecretStr = SecretStr("")
    session_idle_s: Annotated[float, Field(gt=0)] = 8 * 3600.0
    session_age_s: Annotated[float, Field(gt=0)] = 24 * 3600.0
    scenes: Annotated[int, Field(ge=1)] = 8
    otlp_endpoint: str = ""
    upload_bytes: Annotated[int, Field(ge=0)] = 2 * 2**30
    notify: dict[str, SecretStr] = {}
    notify_networks: tuple[str, ...] = ()
    oidc: OidcSettings = Field(default_factory=oidc_settings)
    static: Path = ROOT / "static"
    templates: Path = ROOT / "templates"
    results: Path = ROOT / "docs" / "results"

    @property
    def services(self) -> tuple[str, ...]:
        """Names of the external services that are notified of alerts; their addresses are secret and never shown."""
        return tuple(self.notify)

    @property
    def hosts(self) -> frozenset[str]:
        """Names under which this console answers: loopback's and the declared ones; a rebound name reaches nothing."""
        names = ("127.0.0.1", "localhost", "[::1]")
        declared = frozenset(name.lower() for name in self.names)
        return frozenset(names) | {f"{name}:{self.port}" for name in names} | declared

    @property
    def secure(self) -> bool:
        """Whether browsers come over TLS, so that cookies may say so."""
        return bool(self.tls_certificate or self.proxies)

    @property
    def address(self) -> str:
        """The address that people use: the first declared name, else loopback."""
        scheme = "https" if self.secure else "http"
        return f"{scheme}://{self.names[0] if self.names else f'127.0.0.1:{self.port}'}"

    @property
    def back(self) -> str:
        """Where the identity provider sends people: the redirect address to register there."""
        return f"{self.address}/account/oidc/back"

    @property
    def local_address(self) -> str:
        """Where the command line on this machine finds it."""
        scheme = "https" if self.tls_certificate else "http"
        host = "127.0.0.1" if self.host in ("0.0.0.0", "::", "localhost") else self.host
        return f"{scheme}://{host}:{self.port}"

    @property
    def cookie(self) -> str:
        """One name per port: cookies do not tell ports apart, and two consoles may run on one machine."""
        return f"{'__Host-' if self.secure else ''}regen_session_{self.port}"

    @property
    def passing_cookie(self) -> str:
        """The cookie of a browser that is under way to the identity provider and back."""
        return f"{'__Host-' if self.secure else ''}regen_sign_in_{self.port}"
