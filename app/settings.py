"""What an installation chooses for its console. Read once, passed down, never read again."""

from pathlib import Path
from typing import Annotated

from pydantic import Field, SecretStr
from pydantic_settings import BaseSettings, SettingsConfigDict

ROOT = Path(__file__).resolve().parents[1]


class ConsoleSettings(BaseSettings):
    """Settings of one console, from REGEN_* or from the caller. `owner_token` opens the API to the command line."""

    model_config = SettingsConfigDict(env_prefix="REGEN_", frozen=True, extra="ignore")

    port: Annotated[int, Field(ge=0, le=65535)] = 8000
    speed: Annotated[float, Field(ge=0)] = 4.0
    robots: tuple[str, ...] = ("vbot-1",)
    operator: str = "operator"
    owner_token: SecretStr = SecretStr("")
    session_idle_s: Annotated[float, Field(gt=0)] = 8 * 3600.0
    session_age_s: Annotated[float, Field(gt=0)] = 24 * 3600.0
    scene_idle_s: Annotated[float, Field(gt=0)] = 600.0
    scenes: Annotated[int, Field(ge=1)] = 8
    static: Path = ROOT / "static"
    templates: Path = ROOT / "templates"

    @property
    def hosts(self) -> frozenset[str]:
        """Names under which this console answers: loopback only, so that a rebound name reaches nothing."""
        names = ("127.0.0.1", "localhost", "[::1]")
        return frozenset(names) | {f"{name}:{self.port}" for name in names}

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def cookie(self) -> str:
        """One name per port: cookies do not tell ports apart, and two consoles may run on one machine."""
        return f"regen_session_{self.port}"
