"""regen worker: drives robots on a shared database, without a console of its own."""

import signal
from contextlib import ExitStack
from threading import Event
from types import FrameType
from typing import Annotated

import typer

from app.cli import output
from app.cli.data_folder import running
from app.cli.service import reported_fleet
from harness.adapters.stores.log_address import is_server
from harness.site_robots import robot_names


def worker(
    data: output.Data = output.DEFAULT_DATA,
    site: output.Site = None,
    robots: Annotated[str | None, typer.Option(help="Names of the simulated robots: vbot-1,vbot-2.")] = None,
    name: Annotated[str | None, typer.Option(help="By which name the fleet's list calls it.")] = None,
    speed: Annotated[float | None, typer.Option(help="Mission seconds per second.")] = None,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    fidelity: Annotated[str | None, typer.Option(help="mujoco or kinematic.")] = None,
) -> None:
    """Drive this site's robots until SIGTERM: missions come from the database, which REGEN_DATABASE names.

    Each worker has a data folder and robots of its own. A worker that is killed goes on from the log when it is
    started again, with the same folder and robots.
    """
    settings = output.settings(
        data_folder=output.data_of(data, site),
        site_folder=site,
        robots=output.names(robots),
        worker=name,
        speed=speed,
        seed=seed,
        fidelity=fidelity,
    )
    if not is_server(settings.database):
        raise typer.BadParameter("a worker shares a PostgreSQL database: set REGEN_DATABASE", param_hint="--data")
    if settings.speed == 0:
        raise typer.BadParameter("a worker runs missions at a speed above 0", param_hint="--speed")
    ended = Event()

    def end(number: int, frame: FrameType | None) -> None:
        ended.set()

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGINT, end)
    with ExitStack() as stack:
        harness = stack.enter_context(running(settings))
        output.warn_of_robots(harness.absent, harness.unused)
        harness.supervisor.serve()
        harness.teleoperation.watch()
        for shadow in harness.shadows.values():
            shadow.watch()
        stack.callback(harness.teleoperation.close)
        stack.callback(reported_fleet(stack, harness, settings).close)
        typer.echo(f"Worker drives {', '.join(robot_names(settings))}")
        while not ended.wait(1.0):
            pass
