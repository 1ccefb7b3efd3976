"""regen up: the console with the runtime and simulated robots; regen doctor: checks a data folder."""

import secrets
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from importlib import import_module
from pathlib import Path
from threading import Event, Thread
from typing import Annotated, Any

import typer
from pydantic import SecretStr

from app.auth.commit_authority import authority
from app.auth.exposure import check_exposure
from app.auth.oidc_settings import identity_provider
from app.background.evaluation_jobs import EvaluationJobs
from app.background.evaluations import evaluator_folder
from app.background.mission_history import Histories
from app.background.release_watch import ReleaseWatch
from app.background.replays import ReplayJobs
from app.background.retention import Retention
from app.background.robot_reports import Fleet
from app.background.signals import SignalBroker
from app.cli import driving, output
from app.cli.audit import log_problems
from app.cli.data_folder import duplicate_starts, opened
from app.cli.identity import examine_issuer
from app.cli.person import host_user
from app.cli.shipped_candidate import put_in_review
from app.console import ClearWay
from app.i18n.reasons.rendering import explained, sentence
from app.main import bind, create_app, open_accounts, serve
from app.scene.servers import Scenes
from app.settings import ConsoleSettings
from app.web.starting_page import starting
from harness.adapters.process_priority import ask_for
from harness.adapters.providers.http.robot import HttpRobot
from harness.anchors import compared_with_file
from harness.bootstrap import Harness, open_harness, owner_of, read_harness
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.erasure_events import ERASURES
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.ids import RobotId
from harness.contracts.reasons import because
from harness.extra_templates import begin
from harness.recordings import replayed_beside
from harness.runtime import Start
from harness.site_robots import robot_names
from rsi_reviews.candidate_queries import on_trial, selected
from rsi_reviews.deciders import DECIDERS
from rsi_reviews.release_service import ReleaseService
from simulator.in_process import SIMULATOR

LOADED_FIRST = ("scipy.ndimage", "scipy.signal")
"""What missions use, loaded while the robots start: for the seconds it takes, a stop would wait."""


def up(
    data: output.Data = output.DEFAULT_DATA,
    site: output.Site = None,
    port: Annotated[int | None, typer.Option(help="Loopback port of the console.", min=0, max=65535)] = None,
    speed: driving.Speed = None,
    start: Annotated[str | None, typer.Option(help="Begin with this task template.")] = None,
    seed: driving.Seed = 1,
    fidelity: driving.Fidelity = None,
    robots: driving.Robots = None,
    no_robots: Annotated[
        bool,
        typer.Option("--no-robots", help="Only the console; `regen worker` on its database drives robots."),
    ] = False,
    fault: Annotated[
        list[str] | None, typer.Option(help="ROBOT=NAME[:persistent], for the missions that --start begins.")
    ] = None,
    start_now: Annotated[bool, typer.Option("--start-now", help="Begin at once, not at the first sign-in.")] = False,
    foxglove: Annotated[
        int | None,
        typer.Option(help="Loopback port where Foxglove and Lichtblick may watch the evidence.", min=0, max=65535),
    ] = None,
) -> None:
    """Start the console and everything behind it; prints one sign-in link.

    With --start, every robot of a new data folder begins a mission when the first person has signed in, so that it is
    seen from its beginning. A folder that has missions already starts none by itself.
    """
    console = ConsoleSettings() if port is None else ConsoleSettings(port=port)
    chosen = output.settings(
        data_folder=output.data_of(data, site),
        site_folder=site,
        speed=speed,
        seed=seed,
        fidelity=fidelity,
        robots=output.names(robots),
        no_robots=no_robots or None,
    )
    fleet_names = robot_names(chosen)
    faults = _faults(fault or [], fleet_names)
    if chosen.speed == 0:
        raise typer.BadParameter("a console shows missions at a speed above 0", param_hint="--speed")
    ask_for(console.niceness)
    with opened(chosen.data_folder) as accounts:
        check_exposure(console, has_accounts=accounts.store.any_account())
    identity_provider(console, clock=time.time)
    with ExitStack() as stack:
        listener = stack.enter_context(bind(console.port, console.host))
        console = console.model_copy(update={"port": listener.getsockname()[1]})
        broker = SignalBroker()
        accounts = open_accounts(console, chosen.data_folder)
        stack.callback(accounts.store.close)
        steps = Steps()
        steps.begin(f"Opening {chosen.data_folder} and starting {', '.join(fleet_names) or 'no robot'}")
        loading = Thread(target=_load, name="loading", daemon=True)
        loading.start()
        with starting(console, listener, fleet_names):
            harness = stack.enter_context(
                open_harness(
                    chosen,
                    signals=broker,
                    url=console.local_address,
                    deciders=DECIDERS,
                    authority=authority(accounts),
                    select=selected,
                    trial=on_trial,
                )
            )
        fleet = driving.drive(stack, harness, chosen, broker)
        console = console.model_copy(
            update={
                "speed": chosen.speed,
                "robots": tuple(harness.robots),
                "owner_token": SecretStr(harness.token),
                "owner": host_user(),
            }
        )
        steps.begin("Building the console")
        evaluations = EvaluationJobs(
            harness.runtime,
            evaluator_folder(chosen.data_folder),
            SIMULATOR,
            clock=time.time,
            now_s=time.monotonic,
            fresh=secrets.token_bytes,
            changed=broker.changed,
        )
        stack.callback(evaluations.close)
        replays = ReplayJobs(partial(replayed_beside, harness, chosen), changed=broker.changed)
        stack.callback(replays.close)
        app = create_app(
            harness.runtime,
            console,
            broker,
            Scenes(harness.runtime),
            accounts=accounts,
            answer=harness.supervisor.answer,
            free=harness.supervisor.free,
            halt=harness.supervisor.halt,
            starts=harness.starts,
            cards=lambda: (one.card for robot in harness.robots.values() for one in robot.providers()),
            folder=chosen.data_folder,
            fleet=fleet,
            teleoperation=harness.teleoperation,
            evaluations=evaluations,
            absent=harness.absent,
            unused=harness.unused,
            clear_way=_clear_way(harness),
            replays=replays,
            shadows=harness.shadows,
            site_files=harness.site_files,
            site_robots=harness.site_robots,
        )
        app.state.alert_watch.watch()
        evaluations.watch()
        replays.watch()
        _watch_releases(stack, harness, evaluator_folder(chosen.data_folder) if start is not None else None)
        if chosen.media_days is not None:
            retention = Retention(harness.runtime, days=chosen.media_days, clock=time.time)
            retention.watch()
            stack.callback(retention.close)
        app.state.notices.watch()
        if foxglove is not None:
            _show_evidence(stack, harness, fleet, foxglove)
        if console.otlp_endpoint:
            _export_traces(stack, harness, console.otlp_endpoint, chosen.data_folder)
        loading.join()
        steps.end()
        sessions = app.state.sessions
        if start is not None and harness.runtime.head().position and harness.runtime.missions():
            sys.stderr.write(f"{chosen.data_folder} has missions already: none is started by itself.\n")
        elif start is not None:
            first = Thread(
                target=_begin_at,
                args=(harness, start, None if start_now else sessions.entered),
                kwargs={"seed": seed, "faults": faults},
                name="first missions",
                daemon=True,
            )
            first.start()
        link = "" if sessions.has_accounts else f"{console.address}{sessions.invite()}"
        way_in = f"Sign in once: {link}" if link else "Sign in with your account."
        typer.echo(f"RegenHarness is at {console.address}  {way_in}")
        if link:
            sys.stderr.write(f"A lost link: regen account link --data {chosen.data_folder} prints a new one.\n")
        serve(app, listener)


def _load() -> None:
    for name in LOADED_FIRST:
        import_module(name)


def _show_evidence(stack: ExitStack, harness: Harness, fleet: Fleet, port: int) -> None:
    """Whoever is on this machine may watch, as there are no accounts in that protocol; nobody can send anything."""
    from app.background.foxglove_feed import (  # noqa: PLC0415  it loads the ROS types
        FoxgloveFeed,
        FoxgloveServer,
        topic_types,
    )

    server = FoxgloveServer(port, topic_types(fleet.own))
    stack.callback(server.close)
    feed = FoxgloveFeed(harness.runtime, fleet, server.publish, after=harness.runtime.head().position)
    feed.watch()
    stack.callback(feed.close)
    sys.stderr.write(f"Foxglove and Lichtblick may open {server.address}\n")


def _clear_way(harness: Harness) -> ClearWay:
    """Somebody takes away what stands in a simulated robot's way; another robot has nothing that could be."""

    def clear(robot_id: RobotId) -> None:
        robot = harness.robots[robot_id]
        if isinstance(robot, HttpRobot):
            robot.clear_way()

    return clear


def _watch_releases(stack: ExitStack, harness: Harness, evaluator: Path | None) -> None:
    """The release service follows what ends. An evaluator's folder gives a new data folder a candidate to show."""
    releases = ReleaseService(harness.runtime)
    watch = ReleaseWatch(
        releases=releases,
        head=harness.runtime.head,
        read=harness.runtime.log,
        duplicate_starts=lambda mission_id: duplicate_starts(harness, mission_id),
        first=(lambda: put_in_review(releases, evaluator)) if evaluator is not None else None,
    )
    watch.watch()
    stack.callback(watch.close)


def _export_traces(stack: ExitStack, harness: Harness, endpoint: str, data: Path) -> None:
    """Ended missions as OpenTelemetry traces. Raises ContractInvalid without the extra `otel`."""
    try:
        from app.background.trace_export import TraceExport, otlp_exporter  # noqa: PLC0415  an extra
    except ImportError as error:
        raise ContractInvalid(because("otel_not_installed"), where="REGEN_OTLP_ENDPOINT") from error
    runtime = harness.runtime
    export = TraceExport(
        otlp_exporter(endpoint), Histories(runtime).of, runtime.head, runtime.log, data / "traces.json"
    )
    export.watch()
    stack.callback(export.close)


class Steps:
    """Says on standard error what is done, and how long each step took."""

    def __init__(self) -> None:
        self._began_s = 0.0

    def begin(self, name: str) -> None:
        """The step before is over; this one begins."""
        self.end()
        self._began_s = time.monotonic()
        sys.stderr.write(f"{name} ... ")
        sys.stderr.flush()

    def end(self) -> None:
        """The last step is over."""
        if self._began_s:
            sys.stderr.write(f"{time.monotonic() - self._began_s:.1f} s\n")
        self._began_s = 0.0


def _begin_at(
    harness: Harness, template: str, first_sign_in: Event | None, *, seed: int, faults: Mapping[str, str]
) -> None:
    """Begin once somebody has signed in; at once where there is nobody to wait for."""
    if first_sign_in is not None:
        first_sign_in.wait()
    _begin(harness, template, seed=seed, faults=faults)


def _begin(harness: Harness, template: str | None, *, seed: int, faults: Mapping[str, str]) -> None:
    """Start a mission of this template on every robot that has none under way from last time."""
    busy = {mission.robot_id for mission in harness.runtime.open_missions()}
    for index, robot_id in enumerate(harness.robots if template is not None else ()):
        if robot_id in busy:
            continue
        start = Start(
            actor=Actor(name="regen up", role="operator"),
            robot_id=robot_id,
            template=template or "",
            seed=seed + index,
            labels={"faults": faults[robot_id]} if robot_id in faults else {},
            channel="command-line",
        )
        decision = begin(harness.runtime, start)
        if isinstance(decision, Refused):
            raise ContractInvalid(decision.reason)


def _faults(given: Sequence[str], fleet: Sequence[str]) -> dict[str, str]:
    """Faults by robot. Raises BadParameter for a robot that does not start, UnknownName for an unknown fault."""
    found: dict[str, list[str]] = {}
    for text in given:
        robot_id, _, name = text.partition("=")
        if robot_id not in fleet or not name:
            raise typer.BadParameter(
                f"{text!r} is not ROBOT=NAME with a robot of {', '.join(fleet)}", param_hint="--fault"
            )
        SIMULATOR.check_faults([name])
        found.setdefault(robot_id, []).append(name)
    return {robot_id: ",".join(names) for robot_id, names in found.items()}


def doctor(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Look at a data folder: owner, log, blobs; and at the identity provider, if one is set up. Exit 1 for problems."""
    found: dict[str, Any] = {"data": str(data), "problems": []}
    owner = owner_of(data)
    found["owner"] = {"pid": owner.pid, "url": owner.url} if owner else None
    try:
        _examine(data, found)
    except HarnessError as error:
        found["problems"].append(explained(error))
    issuer, wrong = examine_issuer(ConsoleSettings(), running=owner.url if owner else "")
    if issuer is not None:
        found["identity_provider"] = issuer
        found["problems"] += wrong
    lines = [f"{name}: {value}" for name, value in found.items() if name != "problems"]
    output.show(
        found, as_json=as_json, lines=[*lines, *found["problems"], "" if found["problems"] else "No damage found."]
    )
    raise typer.Exit(1 if found["problems"] else 0)


def _examine(data: Path, found: dict[str, Any]) -> None:
    settings = output.settings(data_folder=data)
    with read_harness(settings, deciders=DECIDERS) as runtime:
        head = runtime.verify()
        found["events"], found["head"] = head.position, head.digest
        snapshots = runtime.audit_snapshots()
        anchors = compared_with_file(runtime, settings.anchor_file) if settings.anchor_file else ()
        found["snapshots"] = {"sealed": snapshots.sealed, "unsealed": snapshots.unsealed}
        if snapshots.unkeyed is not None:
            found["snapshots"]["unused"] = sentence(snapshots.unkeyed)
        found["problems"] += log_problems(snapshots, anchors)
        missions = runtime.missions()
        found["missions"] = len(missions)
        found["open_missions"] = [mission.mission_id for mission in missions if not mission.ended]
        found["problems"] += [
            f"{one.mission_id} is not run here: {sentence(one.reason)}" for one in runtime.unreadable()
        ]
        found["erased_blobs"] = len(runtime.streams(ERASURES))
        for digest in runtime.blob_digests():
            try:
                runtime.blob(digest)
            except HarnessError as error:
                found["problems"].append(explained(error))
