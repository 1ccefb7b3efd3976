"""Settings of the runtime, read once and passed down. Nothing else reads the environment."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict

RobotName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,30}$")]


class HarnessSettings(BaseSettings):
    """From `REGEN_*` variables or by constructor. `speed` is mission seconds per second; 0 is as fast as possible.

    `robots` names every robot of the house; without it there is one, `robot_id`.
    `database` is where the event log lies: empty is SQLite in the data folder, else postgresql://USER:PASSWORD@HOST/NAME.
    """

    model_config = SettingsConfigDict(env_prefix="REGEN_", frozen=True, extra="ignore")

    data_folder: Path = Path("var")
    speed: Annotated[float, Field(ge=0, le=100)] = 4.0
    seed: Annotated[int, Field(ge=0)] = 1
    fidelity: Literal["mujoco", "kinematic"] = "mujoco"
    robot_id: RobotName = "vbot-1"
    robots: tuple[RobotName, ...] = ()
    failpoint: str = ""
    database: Annotated[str, Field(repr=False)] = ""

    @property
    def fleet(self) -> tuple[str, ...]:
        """Every robot once, in the order they were named."""
        return tuple(dict.fromkeys(self.robots)) or (self.robot_id,)
