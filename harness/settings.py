"""Settings of the runtime, read from the environment once and passed down."""

import sys
from pathlib import Path
from typing import Annotated

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict

from harness.contracts.simulation import Fidelity

RobotName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,30}$")]

ROBOT_COMMAND = (sys.executable, "-m", "simulator")
"""The command that starts a simulated robot as a separate program."""


class HarnessSettings(BaseSettings):
    """From `REGEN_*` variables or by constructor. `speed` is mission seconds per second; 0 is as fast as possible.

    `robots` names every robot of the site; without it there is one, `robot_id`. `robot_command` starts a robot program,
    which serves the HTTP provider protocol; its robot's name, folder, speed and seed follow as options. `database` is
    where the event log is: empty is SQLite in the data folder, else postgresql://USER:PASSWORD@HOST/NAME. `blobs` is
    where evidence is: empty is the data folder, else s3://BUCKET/PREFIX?endpoint=URL&region=NAME.
    `no_robots`: this process drives none, and other processes on the same database do. `worker` is the name by which
    the fleet's list calls this process; without one, its host and process id.
    `snapshot_key_file` seals snapshots and lies outside the data folder; without one, a key is made in the user's
    state folder. While a process owns the folder it adds an anchor to `anchor_file`, outside the data folder, every
    `anchor_every` events, signed with `anchor_key_file` (Ed25519, PEM or 32 bytes) if there is one.
    `media_days`: voice and photographs of a mission are erased so many days after it ended; never without it.
    `vision_folder`: what `regen vision install` filled (REGEN_VISION_FOLDER); without it no model looks at pictures.
    `site_folder`: a site's own folder, as `regen init` writes one (REGEN_SITE_FOLDER); without one, the simulated site.
    """

    model_config = SettingsConfigDict(env_prefix="REGEN_", frozen=True, extra="ignore")

    data_folder: Path = Path("var")
    speed: Annotated[float, Field(ge=0, le=100)] = 4.0
    seed: Annotated[int, Field(ge=0)] = 1
    fidelity: Fidelity = "mujoco"
    robot_id: RobotName = "vbot-1"
    robots: tuple[RobotName, ...] = ()
    robot_command: tuple[str, ...] = ROBOT_COMMAND
    no_robots: bool = False
    worker: Annotated[str, Field(max_length=80)] = ""
    failpoint: str = ""
    database: Annotated[str, Field(repr=False)] = ""
    blobs: Annotated[str, Field(repr=False)] = ""
    snapshot_key_file: Path | None = None
    anchor_file: Path | None = None
    anchor_every: Annotated[int, Field(ge=1)] = 1000
    anchor_key_file: Path | None = None
    site_folder: Path | None = None
    vision_folder: Path | None = None
    media_days: Annotated[float, Field(gt=0)] | None = None

    @property
    def fleet(self) -> tuple[str, ...]:
        """Every simulated robot that is named here, once, in order; a site's folder names robots of its own."""
        return tuple(dict.fromkeys(self.robots)) or (self.robot_id,)
