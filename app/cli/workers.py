"""regen worker: drives robots on a shared database, without a console of its own."""

import signal
from contextlib import ExitStack
from threading import Event
from types import FrameType
from typing import Annotated

import typer

from app.cli import driving, output
from app.cli.data_folder import running
from harness.adapters.stores.log_address import is_server
from harness.site_robots import robot_names


def worker(
    data: output.Data = output.DEFAULT_DATA,
    site: output.Site = None,
    robots: driving.Robots = None,
    name: Annotated[str | None, typer.Option(help="By which name the fleet's list calls it.")] = None,
    speed: driving.Speed = None,
    seed: driving.Seed = 1,
    fidelity: driving.Fidelity = None,
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
        stack.callback(driving.drive(stack, harness, settings).close)
        typer.echo(f"Worker drives {', '.join(robot_names(settings))}")
        while not ended.wait(1.0):
            pass
