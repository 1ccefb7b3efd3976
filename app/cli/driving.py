"""Drives the robots of one process, a console or a worker, and reports them to the others on the same database."""

import os
import socket
import sys
import time
from contextlib import ExitStack
from typing import Annotated

import typer

from app.background.fleet_reports import ReportedRobots, Reporter
from app.background.robot_reports import Fleet
from app.cli import output
from harness.bootstrap import Harness, open_reports
from harness.contracts.ports import Signals
from harness.settings import HarnessSettings

Robots = Annotated[str | None, typer.Option(help="Names of the simulated robots: vbot-1,vbot-2.")]
Speed = Annotated[float | None, typer.Option(help="Mission seconds per second.")]
Seed = Annotated[int, typer.Option(min=0)]
Fidelity = Annotated[str | None, typer.Option(help="mujoco, kinematic or walking.")]


def drive(stack: ExitStack, harness: Harness, settings: HarnessSettings, signals: Signals | None = None) -> Fleet:
    """Missions, driving by hand and what is only watched, from now on until the stack is left. What is not connected
    is said on standard error.
    """
    output.warn_of_robots(harness.absent, harness.unused)
    harness.supervisor.serve()
    harness.teleoperation.watch()
    for shadow in harness.shadows.values():
        shadow.watch()
    if harness.shadows:
        sys.stderr.write(f"Watching, and not commanding: {', '.join(harness.shadows)}\n")
    stack.callback(harness.teleoperation.close)
    return _reported(stack, harness, settings, signals)


def _reported(stack: ExitStack, harness: Harness, settings: HarnessSettings, signals: Signals | None) -> Fleet:
    """The robots of this process, watched and reported to the others on the same database, and those of the others."""
    worker = settings.worker or f"{socket.gethostname()}-{os.getpid()}"
    reported = ReportedRobots(time.time, worker=worker, signals=signals)
    fleet = Fleet(harness.robots, harness.cameras, time.time, reported=reported, runtime=harness.runtime, worker=worker)
    fleet.watch()
    send = stack.enter_context(open_reports(settings.database, reported.receive))
    if send is not None:
        reporter = Reporter(fleet, send, worker=worker, clock=time.time)
        reporter.watch()
        stack.callback(reporter.close)
    return fleet
