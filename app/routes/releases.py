"""/releases: what new missions run under, its history, and who must agree before it changes."""

from collections.abc import Mapping
from datetime import UTC, datetime

from fastapi import APIRouter
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.acts.releases import SavePolicyAct
from app.auth.permissions import permissions_of
from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.messages import reasoned
from app.views import releases
from app.web.rendering import render
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted, Refused
from rsi_reviews.release_service import SignedBy

router = APIRouter(prefix="/releases")
NOBODY: Mapping[str, str] = {}


@router.get("")
def index(console: ConsoleDep, actor: ActorDep, at: str = "") -> HTMLResponse:
    return render("releases/index.html", page_of(console, actor, at=at))


@router.get("/now")
def now(console: ConsoleDep, actor: ActorDep, at: str = "") -> HTMLResponse:
    return render("releases/_now.html", page_of(console, actor, at=at))


@router.post("/policy")
def save_policy(console: ConsoleDep, actor: ActorDep, typed: FormDep) -> Response:
    """303 saved, 422 not well said, 409 refused because nobody could meet it."""
    act = SavePolicyAct.from_form(typed)
    if isinstance(act, tuple):
        return _again(console, actor, typed, refused=" ".join(one.text for one in act), status=422)
    decision = saved(console, actor, act)
    if isinstance(decision, Refused):
        return _again(console, actor, typed, refused=reasoned(decision.reason), status=409)
    return RedirectResponse("/releases#policy", status_code=303)


def saved(console: Console, actor: Actor, act: SavePolicyAct) -> Accepted[object] | Refused:
    """Asked with the people who hold the roles now."""
    around = around_of(console)
    signed = SignedBy(actor, act.reason, f"policy:{act.key or console.sessions.key()}"[:200])
    return console.releases.save_policy(
        act.policy(), signed, reviewers=tuple(around.reviewers), releasers=tuple(around.releasers)
    )


def instant_of(text: str) -> float | None:
    """Wall seconds of an ISO instant, UTC where it names no zone; None for what is none."""
    try:
        found = datetime.fromisoformat(text)
        return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        return None


def around_of(console: Console) -> releases.Around:
    """Candidates, pins, versions, and who may review and release now."""
    accounts = [one for one in console.sessions.accounts.store.accounts() if not one.disabled]
    alone = () if console.sessions.has_accounts else (console.settings.operator,)
    return releases.Around(
        reviews=console.releases.reviews(),
        pins=console.releases.pins(),
        versions=console.releases.versions(),
        robots=console.settings.robots,
        reviewers=(*(one.name for one in accounts if "reviewer" in one.roles), *alone),
        releasers=(*(one.name for one in accounts if "releaser" in one.roles), *alone),
    )


def page_of(
    console: Console, actor: Actor, *, at: str = "", typed: Mapping[str, str] = NOBODY, refused: str = ""
) -> releases.ReleasesPage:
    pointer, around = console.releases.pointer(), around_of(console)
    instant = at[:40].strip()
    return releases.releases_page(
        console.shell("Releases", "releases", actor),
        pointer,
        around,
        actor,
        key=console.sessions.key(),
        at=releases.at_instant(pointer, instant, instant_of(instant), console.settings.robots) if instant else None,
        policy=releases.policy_form(
            pointer, around, may="policy" in permissions_of(actor.role.split("+")), typed=typed, refused=refused
        ),
    )


def _again(console: Console, actor: Actor, typed: Mapping[str, str], *, refused: str, status: int) -> Response:
    return render("releases/index.html", page_of(console, actor, typed=typed, refused=refused), status=status)
