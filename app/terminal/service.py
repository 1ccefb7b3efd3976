"""regen up: the console with the runtime and the simulated robot. regen doctor: what is wrong with a data folder."""

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import SecretStr

from app.exposure import check_exposure
from app.live import SignalBroker
from app.main import bind, create_app, serve
from app.scene import Scenes
from app.settings import ConsoleSettings
from app.terminal.accounts import opened
from app.terminal.answers import DEFAULT_DATA, Data, Json, settings, show
from harness.bootstrap import Harness, open_harness, owner_of, read_harness
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, HarnessError, StoreUnavailable
from harness.contracts.ids import RobotId
from harness.runtime import Start


def up(
    data: Data = DEFAULT_DATA,
    port: Annotated[int | None, typer.Option(help="Loopback port of the console.", min=0, max=65535)] = None,
    speed: Annotated[float | None, typer.Option(help="Mission seconds per second.")] = None,
    start: Annotated[str | None, typer.Option(help="Begin with this task template.")] = None,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    fidelity: Annotated[str | None, typer.Option(help="mujoco or kinematic.")] = None,
) -> None:
    """Start the console and everything behind it; prints one sign-in link."""
    console = ConsoleSettings() if port is None else ConsoleSettings(port=port)
    chosen = settings(data_folder=data, speed=speed, seed=seed, fidelity=fidelity)
    if chosen.speed == 0:
        raise typer.BadParameter("a console shows missions at a speed above 0", param_hint="--speed")
    with opened(chosen.data_folder) as accounts:
        check_exposure(console, has_accounts=accounts.store.any_account())
    with ExitStack() as stack:
        listener = stack.enter_context(bind(console.port, console.host))
        console = console.model_copy(update={"port": listener.getsockname()[1]})
        broker = SignalBroker()
        sys.stderr.write(f"Opening {chosen.data_folder} and starting {chosen.robot_id} ...\n")
        harness = stack.enter_context(open_harness(chosen, signals=broker, url=console.local_address))
        console = console.model_copy(
            update={
                "speed": chosen.speed,
                "robots": tuple(harness.robots),
                "owner_token": SecretStr(harness.token),
            }
        )
        _begin(harness, start, seed=seed)
        harness.supervisor.serve()
        app = create_app(
            harness.runtime,
            console,
            broker,
            Scenes(harness.runtime),
            starts=harness.starts,
            cards=lambda: (one.card for robot in harness.robots.values() for one in robot.providers()),
            folder=chosen.data_folder,
        )
        doors = app.state.doors
        link = "" if doors.has_accounts else f"{console.address}{doors.invite()}"
        way_in = f"Sign in once: {link}" if link else "Sign in with your account."
        typer.echo(f"RegenHarness is at {console.address}  {way_in}")
        serve(app, listener)


def _begin(harness: Harness, template: str | None, *, seed: int) -> None:
    """Start a mission of this template unless one is still under way from last time."""
    if template is None or any(not mission.ended for mission in harness.runtime.missions()):
        return
    start = Start(
        actor=Actor(name="regen up", role="operator"),
        robot_id=RobotId(next(iter(harness.robots))),
        template=template,
        seed=seed,
    )
    begun = harness.runtime.start(start)
    if isinstance(begun, Refused):
        raise ContractInvalid(begun.message)


def doctor(data: Data = DEFAULT_DATA, as_json: Json = False) -> None:
    """Look at a data folder: owner, log, blobs. Exit 1 if anything is damaged."""
    found: dict[str, Any] = {"data": str(data), "problems": []}
    owner = owner_of(data)
    found["owner"] = {"pid": owner.pid, "url": owner.url} if owner else None
    try:
        _examine(data, found)
    except HarnessError as error:
        found["problems"].append(str(error))
    lines = [f"{name}: {value}" for name, value in found.items() if name != "problems"]
    show(found, as_json=as_json, lines=[*lines, *found["problems"], "" if found["problems"] else "No damage found."])
    raise typer.Exit(1 if found["problems"] else 0)


def _examine(data: Path, found: dict[str, Any]) -> None:
    if not data.exists():
        raise StoreUnavailable("There is no data folder", where=str(data), do="run a mission first, or name another")
    with read_harness(settings(data_folder=data)) as runtime:
        head = runtime.verify()
        found["events"], found["head"] = head.position, head.digest
        missions = runtime.missions()
        found["missions"] = len(missions)
        found["open_missions"] = [mission.mission_id for mission in missions if not mission.ended]
        for digest in runtime.blob_digests():
            try:
                runtime.blob(digest)
            except HarnessError as error:
                found["problems"].append(str(error))
