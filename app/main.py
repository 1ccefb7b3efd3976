"""The console as one ASGI application, and how it is served: on loopback, by one process."""

import secrets
import shutil
import socket
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from functools import cache, partial
from pathlib import Path
from types import FrameType, MappingProxyType
from typing import Any

import uvicorn
from argon2 import PasswordHasher
from fastapi import FastAPI
from starlette.routing import BaseRoute

from app.auth.accounts import Accounts
from app.auth.exposure import check_exposure
from app.auth.guarded_releases import GuardedReleaseService
from app.auth.guarded_runtime import GuardedRuntime
from app.auth.oidc_settings import oidc_login
from app.auth.rate_limits import Buckets
from app.auth.sessions import SessionService
from app.background.alert_watch import AlertSources, AlertWatch
from app.background.alerts import Alerts
from app.background.evaluations import EvaluationCache, evaluator_folder
from app.background.lists import Lists
from app.background.mission_history import Histories
from app.background.notifications import Notices
from app.background.replays import ReplayJobs
from app.background.robot_reports import Fleet, no_fleet
from app.background.signals import SignalBroker
from app.background.speech_sessions import SpeechSessions
from app.background.trajectories import Measurements
from app.background.uploads import Uploads
from app.console import (
    Cards,
    ClearWay,
    Console,
    Dossier,
    EvaluationPort,
    Shadows,
    Starts,
    TeleoperationPort,
    no_cards,
    no_journal,
)
from app.i18n.languages import Languages
from app.routes import (
    account,
    alerts,
    api,
    api_admissions,
    api_alerts,
    api_events,
    api_evidence,
    api_goal_proposals,
    api_handoffs,
    api_leases,
    api_maps,
    api_people,
    api_places,
    api_reading,
    api_releases,
    api_robots,
    api_shadow,
    api_site_changes,
    api_speech,
    api_uploads,
    audit,
    candidate_comparison,
    candidate_editor,
    candidate_evaluation,
    candidates,
    driving,
    evaluation,
    evidence,
    exploration,
    handoffs,
    live,
    memory,
    metrics,
    missions,
    openapi,
    overview,
    own_missions,
    own_robots,
    places,
    providers,
    queue,
    recordings,
    releases,
    report,
    robots,
    scene,
    shadow,
    sign_in,
    site_routes,
    watch,
)
from app.routes import fleet as fleet_page
from app.scene.port import SceneViews
from app.settings import ConsoleSettings
from app.web import errors
from app.web.connections import ConnectionLimits, bounded_protocol
from app.web.errors import PortBusy
from app.web.idempotency import Idempotency
from app.web.response_cache import ResponseCache
from app.web.security import SecurityMiddleware, SecurityPolicy
from app.web.server_errors import ServerErrorMiddleware
from app.web.static_files import StampedFiles
from app.web.streams import StreamCounts
from harness.adapters.connection_guard import PublicOr
from harness.adapters.notify.services import NETWORKS, AppriseNotifier
from harness.adapters.stores.accounts import SqlAccounts
from harness.adapters.stores.audit_results import stored_audits
from harness.bootstrap import open_lists
from harness.contracts.ids import MissionId, ProviderId, RobotId
from harness.contracts.reasons import Reason, because
from harness.runtime import AnswerHandoff, FreeResource, HaltRobot, Runtime, unhalted, unobserved, unsupervised
from harness.site_robots import NO_SITE_ROBOTS, SiteRobots
from harness.workspace.reading import NO_FILES, SiteFiles

GRACE_S = 3
PAGES = (
    overview,
    robots,
    driving,
    scene,
    missions,
    queue,
    recordings,
    report,
    exploration,
    fleet_page,
    shadow,
    watch,
    places,
    site_routes,
    own_missions,
    own_robots,
    providers,
    memory,
    handoffs,
    alerts,
    evidence,
    candidate_editor,
    candidate_comparison,
    candidate_evaluation,
    candidates,
    releases,
    evaluation,
    sign_in,
    account,
    audit,
    live,
    metrics,
)
API = (
    api,
    api_handoffs,
    api_leases,
    api_alerts,
    api_maps,
    api_admissions,
    api_goal_proposals,
    api_places,
    api_site_changes,
    api_reading,
    api_releases,
    api_robots,
    api_people,
    api_events,
    api_evidence,
    api_shadow,
    api_speech,
    api_uploads,
)


def create_app(
    runtime: Runtime,
    settings: ConsoleSettings,
    broker: SignalBroker,
    scenes: SceneViews,
    *,
    accounts: Accounts,
    answer: AnswerHandoff = unsupervised,
    free: FreeResource = unobserved,
    halt: HaltRobot = unhalted,
    starts: Starts = no_journal,
    cards: Cards = no_cards,
    folder: Path | None = None,
    fleet: Fleet | None = None,
    teleoperation: TeleoperationPort | None = None,
    evaluations: EvaluationPort | None = None,
    absent: Mapping[RobotId, Reason] = MappingProxyType({}),
    unused: Mapping[RobotId, Mapping[ProviderId, Reason]] = MappingProxyType({}),
    clear_way: ClearWay | None = None,
    replays: ReplayJobs | None = None,
    shadows: Shadows = MappingProxyType({}),
    site_files: SiteFiles = NO_FILES,
    site_robots: SiteRobots = NO_SITE_ROBOTS,
) -> FastAPI:
    """The console over a runtime. `starts` reads the robots' journals, `cards` what they can do.

    The runtime's gate was built with the authority of these `accounts`; the console closes them when it ends. `answer`
    takes what people answer at handoffs, `free` frees resources in quarantine and `halt` stops at once: a supervisor's.

    `absent`: robots of the site that could not be connected; `unused`: providers that are not admitted; each with why.
    `clear_way` takes away what stands in a simulated robot's way.

    `fleet` shows what robots say of themselves, `teleoperation` lets people drive them; both are ended with the
    console. `evaluations` runs what people ask to have evaluated, `replays` the recordings that they upload. `shadows`
    are the robots that are only observed. `site_files` are what routes, missions and robots are changed beside,
    `site_robots` the robots as this process found them at its start.

    Sign-in links come from `app.state.sessions`. Its lists are kept in `folder`, or in memory without one, and have
    caught up with the log on return.
    """
    lists = Lists(runtime, open_lists(folder))
    lists.catch_up()
    sessions = _sessions(accounts, settings)
    inbox = Alerts(runtime)
    release_service = GuardedReleaseService(runtime, accounts.record)
    sources = AlertSources(fleet=fleet or no_fleet(), starts=starts, free_bytes=_free(folder), clock=time.time)
    services = AppriseNotifier(
        {name: address.get_secret_value() for name, address in settings.notify.items()},
        permits=PublicOr(settings.notify_networks, where=NETWORKS),
    )
    notices = Notices(runtime, services, time.time, settings.address)
    alert_watch = AlertWatch(runtime, inbox, sources, tell=notices.offer)

    speech = SpeechSessions(runtime.listen, clock=time.time, key=_fresh)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        yield
        broker.close()
        alert_watch.close()
        notices.close()
        speech.close()
        if fleet is not None:
            fleet.close()
        scenes.close()
        lists.close()
        accounts.store.close()

    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None, lifespan=lifespan)
    app.state.sessions = sessions
    app.state.alert_watch = alert_watch
    app.state.notices = notices
    app.state.console = Console(
        runtime=GuardedRuntime(runtime, answer=answer, free=free, halt=halt, audit_log=accounts.record),
        settings=settings,
        broker=broker,
        scenes=scenes,
        sessions=sessions,
        histories=Histories(runtime),
        lists=lists,
        measurements=Measurements(runtime),
        alerts=inbox,
        releases=release_service,
        evaluated=EvaluationCache(release_service, evaluator_folder(folder) if folder else None),
        clock=time.time,
        starts=starts,
        cards=cards,
        fleet=fleet or no_fleet(),
        teleoperation=teleoperation,
        evaluations=evaluations,
        absent=absent,
        unused=unused,
        clear_way=clear_way,
        dossier=_dossiers(runtime, folder),
        issuer=oidc_login(settings, sessions, clock=time.time, fresh=_fresh),
        speech=speech,
        replays=replays,
        shadows=shadows,
        site_files=site_files,
        site_robots=site_robots,
        fresh=_fresh,
        **_kept_in(folder, settings),
    )
    app.mount("/static", StampedFiles(directory=settings.static), name="static")
    app.router.routes.extend(_routes())
    openapi.install(app)
    errors.install(app)
    app.add_middleware(ResponseCache, changes=lambda: broker.changes, clock=time.monotonic)
    app.add_middleware(Idempotency, store=accounts.store, clock=time.time)
    app.add_middleware(ServerErrorMiddleware)
    app.add_middleware(SecurityMiddleware, sessions=sessions, policy=_policy(settings))
    app.add_middleware(Languages, secure=settings.secure)
    return app


@cache
def _routes() -> tuple[BaseRoute, ...]:
    """Every address, for all applications of a process: FastAPI reads the signatures of the handlers for each
    application that includes their routers.
    """
    console = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    for page in PAGES:
        console.include_router(page.router, include_in_schema=False)
    for part in API:
        console.include_router(part.router)
    return tuple(console.router.routes)


def _kept_in(folder: Path | None, settings: ConsoleSettings) -> dict[str, Any]:
    """What a console has that has a data folder: uploaded files, and results of audits."""
    if folder is None:
        return {}
    uploads = Uploads(folder / "uploads", most_bytes=settings.upload_bytes, clock=time.time, fresh=_fresh)
    return {"uploads": uploads, "audits": partial(stored_audits, folder)}


def _free(folder: Path | None) -> Callable[[], int | None]:
    return lambda: shutil.disk_usage(folder).free if folder is not None else None


def _dossiers(runtime: Runtime, folder: Path | None) -> Dossier | None:
    """Writes dossiers signed with the key of the data folder; None without a folder."""
    if folder is None:
        return None

    def export(mission_id: MissionId, file: Path, by: str) -> object:
        from app.web.dossier_export import export_with_report  # noqa: PLC0415  loads the PDF library, as the report does

        return export_with_report(runtime, mission_id, file, data=folder, exported_by=by)

    return export


def open_accounts(
    settings: ConsoleSettings, folder: Path | None = None, *, hasher: PasswordHasher | None = None
) -> Accounts:
    """The accounts of the console, stored in `folder`, or in memory without one; without a hasher, that of settings."""
    store = SqlAccounts(folder / "accounts.db" if folder else None)
    hasher = hasher or PasswordHasher(memory_cost=settings.password_memory_kib)
    return Accounts(store, clock=time.time, fresh=_fresh, hasher=hasher)


def _sessions(accounts: Accounts, settings: ConsoleSettings) -> SessionService:
    return SessionService(
        accounts,
        owner_token=settings.owner_token.get_secret_value(),
        operator=settings.operator,
        owner=settings.owner,
        limits=(settings.session_idle_s, settings.session_age_s),
        clock=time.time,
        fresh=_fresh,
    )


def _policy(settings: ConsoleSettings) -> SecurityPolicy:
    return SecurityPolicy(
        hosts=settings.hosts,
        cookie=settings.cookie,
        secure=settings.secure,
        known=Buckets(per_s=settings.rate_per_s, burst=settings.rate_burst, clock=time.monotonic),
        anonymous=Buckets(per_s=settings.stranger_rate_per_s, burst=settings.stranger_rate_burst, clock=time.monotonic),
        streams=StreamCounts(settings.streams),
    )


def _fresh() -> str:
    return secrets.token_urlsafe(32)


def bind(port: int, host: str = "127.0.0.1") -> socket.socket:
    """A listening socket, on loopback unless told; 0 takes a free port. Raises PortBusy that says what to do."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)  # else asyncio keeps Nagle on
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(128)
    except OSError as error:
        listener.close()
        raise PortBusy(
            because("port_busy", port=port, error=error.strerror or str(error)), where=f"{host}:{port}"
        ) from error
    return listener


class _Server(uvicorn.Server):
    """A server that ends the live streams as soon as it is asked to stop, so that no open page delays it."""

    def __init__(self, config: uvicorn.Config, broker: SignalBroker) -> None:
        super().__init__(config)
        self._broker = broker

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        self._broker.close()
        super().handle_exit(sig, frame)


def serve(app: FastAPI, listener: socket.socket) -> None:
    """Serve until SIGINT or SIGTERM; returns once the last answer is out or GRACE_S is over."""
    console: Console = app.state.console
    settings = console.settings
    check_exposure(settings, has_accounts=console.sessions.has_accounts)
    read_handlers(app)
    _Server(server_config(app, settings), console.broker).run(sockets=[listener])


def read_handlers(app: FastAPI) -> None:
    """FastAPI reads a router's handlers when it first looks for an address there, for 0.3 s in which nothing else is
    answered; the request that waits for it could be a stop."""
    nowhere = {"type": "http", "method": "GET", "path": "/-", "root_path": "", "headers": []}
    for route in app.router.routes:
        route.matches(nowhere)


def server_config(app: FastAPI, settings: ConsoleSettings) -> uvicorn.Config:
    """How the console is served: with bounds on connections and on half-sent requests."""
    return uvicorn.Config(
        app,
        http=bounded_protocol(ConnectionLimits(settings.connections)),
        log_level="warning",
        timeout_graceful_shutdown=GRACE_S,
        server_header=False,
        date_header=False,
        ssl_certfile=settings.tls_certificate,
        ssl_keyfile=settings.tls_key,
        proxy_headers=bool(settings.proxies),
        forwarded_allow_ips=list(settings.proxies),
    )
