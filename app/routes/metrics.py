"""/metrics for Prometheus, and /readyz for load balancers."""

from fastapi import APIRouter
from starlette.responses import PlainTextResponse

from app.console import Console, ConsoleDep
from harness.contracts.errors import HarnessError

router = APIRouter()
FORMAT = "text/plain; version=0.0.4; charset=utf-8"


@router.get("/metrics")
def metrics(console: ConsoleDep) -> PlainTextResponse:
    """Gauges that are read at this instant, and counters of the signals to open pages since the start."""
    lines = []
    for kind, found in (("gauge", gauges(console)), ("counter", counters(console))):
        for name, meaning, value in found:
            lines += [f"# HELP {name} {meaning}", f"# TYPE {name} {kind}", f"{name} {value}"]
    return PlainTextResponse("\n".join(lines) + "\n", media_type=FORMAT)


def gauges(console: Console) -> list[tuple[str, str, int]]:
    """(name, meaning, value)."""
    return [
        ("regen_log_position", "Events in the log.", console.head().position),
        ("regen_missions_open", "Missions that have not ended.", len(console.open_missions())),
        ("regen_handoffs_open", "Handoffs that wait for a person.", len(console.lists.open_handoffs())),
        ("regen_live_pages", "Open streams of names.", console.broker.watching),
    ]


def counters(console: Console) -> list[tuple[str, str, int]]:
    """(name, meaning, value). A page reads its whole state again, so a joined or dropped signal costs nothing."""
    traffic = console.broker.traffic
    return [
        ("regen_live_signals_total", "Changes that an open page watches.", traffic.offered),
        ("regen_live_joined_total", "Of those, told together with an earlier one.", traffic.joined),
        ("regen_live_dropped_total", "Of those, never told: the page left first.", traffic.dropped),
    ]


@router.get("/readyz")
def readyz(console: ConsoleDep) -> PlainTextResponse:
    """200 once log and accounts can be read, 503 while they cannot. Says no more, because it needs no sign-in."""
    try:
        console.head()
        console.sessions.accounts.store.any_account()
    except HarnessError:
        return PlainTextResponse("not ready\n", status_code=503)
    return PlainTextResponse("ok\n")
