"""/candidates/new: a candidate of one's own, by its knobs or as JSON, checked before anything runs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import msgspec
from fastapi import APIRouter
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.catalogues import N_
from app.i18n.languages import explained
from app.i18n.messages import lazy_gettext, reasoned
from app.views.candidate_editor import EditorPage, EditResult, draft_of, editor_page
from app.views.refused_proposals import RefusedPage, refused_page
from app.web.rendering import render
from harness.contracts.actors import Actor
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.ids import MissionId
from harness.contracts.reasons import plain
from harness.contracts.values import encode
from rsi_reviews.contracts import Candidate, Motive, RestrictionViolation
from rsi_reviews.difference import difference
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.generate.person_edits import Intention, edited
from rsi_reviews.generate.trace import MissionTrace, mission_trace
from rsi_reviews.knobs import turned
from rsi_reviews.release_service import SignedBy

router = APIRouter(prefix="/candidates")
NOTHING = EditResult()
MOST_POSITIONS = 20


@router.get("/new")
def new(
    console: ConsoleDep,
    actor: ActorDep,
    by: str = "knobs",
    supersedes: str = "",
    knobs: str = "",
    mission: str = "",
    draft: str = "",
) -> HTMLResponse:
    """`knobs`: those to turn; `mission`: the one that led here; `draft`: a refused proposal to begin from.

    Raises UnknownName.
    """
    typed = {"by": by, "supersedes": supersedes[:64], "knobs": knobs[:2000], "mission": mission[:80]}
    if draft:
        typed |= {"by": "knobs", "draft": draft[:64]} | _drafted(console, draft[:64], by)
    return render("candidates/new.html", page_of(console, actor, typed))


@router.get("/refused/{candidate}")
def refused(console: ConsoleDep, actor: ActorDep, candidate: str) -> HTMLResponse:
    """Raises UnknownName."""
    return render("candidates/refused.html", refused_of(console, actor, candidate))


@router.post("/knobs")
def choose(console: ConsoleDep, actor: ActorDep, typed: FormDep) -> HTMLResponse:
    """The form with one knob more, or one less; nothing is written."""
    left = {name: text for name, text in typed.items() if name != typed.get("drop")}
    return render("candidates/new.html", page_of(console, actor, left))


@router.post("/check")
def check(console: ConsoleDep, actor: ActorDep, typed: FormDep) -> Response:
    """What the edit would change and which rules it breaks; nothing is written."""
    _, found = read(console, actor, typed)
    status = 422 if found.errors or found.refusals else 200
    return render("candidates/new.html", page_of(console, actor, typed, found), status=status)


@router.post("")
def propose(console: ConsoleDep, actor: ActorDep, typed: FormDep) -> Response:
    """303 to the new candidate, 422 with what to correct or which rule it breaks, 409 with another refusal."""
    candidate, found = read(console, actor, typed)
    if candidate is None:
        return render("candidates/new.html", page_of(console, actor, typed, found), status=422)
    decision = proposed(console, actor, candidate, typed.get("supersedes", "").strip())
    if not isinstance(decision, Refused):
        return RedirectResponse(f"/candidates/{candidate.candidate_id}", status_code=303)
    if found.refusals:
        found = replace(found, kept=candidate.candidate_id)
        return render("candidates/new.html", page_of(console, actor, typed, found), status=422)
    again = page_of(console, actor, typed, EditResult(errors=(reasoned(decision.reason),)))
    return render("candidates/new.html", again, status=409)


def proposed(console: Console, actor: Actor, candidate: Candidate, before: str) -> Accepted[Any] | Refused:
    """Put it on record as the successor of the candidate `before`, if it names one. Raises UnknownName."""
    supersedes = console.releases.review(before).candidate if before else None
    signed = SignedBy(actor, candidate.manifest.reason, f"propose:{candidate.candidate_id}")
    return console.releases.propose(candidate, signed, supersedes=supersedes)


def read(console: Console, actor: Actor, typed: Mapping[str, str]) -> tuple[Candidate | None, EditResult]:
    """The candidate of a form that can be read, or None; and what was found about it. It may break rules."""
    current = current_of(console)
    text = typed.get("configuration", "") if _by_text(typed) else turned(current, typed)
    try:
        made = edited(text, current, _intention(console, typed), who=actor.name)
    except CandidateInvalid as error:
        refusal = RestrictionViolation(rule=error.rule, path=plain(error.where) or "edit", reason=error.reason)
        return None, EditResult(errors=(explained(error),), refusals=(refusal,))
    except msgspec.ValidationError as error:
        return None, EditResult(errors=(lazy_gettext("The manifest does not stand: {error}.", error=str(error)),))
    return made, checked(console, made)


def checked(console: Console, candidate: Candidate) -> EditResult:
    """Which rules a candidate breaks against what is current, and what it would change; nothing is written."""
    return EditResult(
        refusals=console.releases.refusals(candidate),
        difference=difference(current_of(console), candidate.configuration),
    )


def current_of(console: Console) -> Configuration:
    """What is current everywhere: the baseline of every new candidate."""
    return console.runtime.stored_configuration(console.releases.current())


def page_of(console: Console, actor: Actor, typed: Mapping[str, str], found: EditResult = NOTHING) -> EditorPage:
    """Raises UnknownName for a mission that does not exist."""
    shell = console.shell(N_("Propose a change"), "candidates", actor)
    trace = _origin(console, typed)
    origin = (trace, _is_case(console, trace.mission_id)) if trace else None
    return editor_page(shell, current_of(console), typed, by_text=_by_text(typed), found=found, origin=origin)


def refused_of(console: Console, actor: Actor, candidate: str) -> RefusedPage:
    """Raises UnknownName."""
    one = console.releases.refused_proposal(candidate)
    shell = console.shell(N_("Refused proposal"), "candidates", actor)
    stored = console.runtime.stored_configuration
    return refused_page(
        shell,
        one,
        difference(stored(one.manifest.baseline), stored(one.configuration)),
        current=console.releases.current(),
    )


def _drafted(console: Console, candidate: str, by: str) -> dict[str, str]:
    """The form of a refused proposal; what no knob turns is edited as JSON."""
    one, stored = console.releases.refused_proposal(candidate), console.runtime.stored_configuration
    made = stored(one.configuration)
    form = draft_of(one, stored(one.manifest.baseline), made)
    if by == "text" or not form["knobs"]:
        return form | {"by": "text", "configuration": msgspec.json.format(encode(made), indent=2).decode()}
    return form


def _origin(console: Console, typed: Mapping[str, str]) -> MissionTrace | None:
    mission = typed.get("mission", "").strip()
    return mission_trace(console.runtime, console.runtime.mission(MissionId(mission)).mission_id) if mission else None


def _is_case(console: Console, mission_id: MissionId) -> bool:
    return any(one.mission_id == mission_id for one in console.releases.growth().added)


def _by_text(typed: Mapping[str, str]) -> bool:
    return typed.get("by", "knobs") == "text"


def _intention(console: Console, typed: Mapping[str, str]) -> Intention:
    """Raises msgspec.ValidationError for what cannot stand in a manifest, and UnknownName."""
    trace = _origin(console, typed)
    stated = {
        "reason": typed.get("reason", "").strip(),
        "intended_effect": typed.get("intended_effect", "").strip(),
        "metric": typed.get("metric", ""),
        "smallest_effect": typed.get("smallest_effect", "").strip(),
    }
    positions = tuple(one.position for one in trace.failures)[:MOST_POSITIONS] if trace else ()
    motives = (Motive(mission_id=trace.mission_id, positions=positions),) if trace else ()
    return msgspec.structs.replace(msgspec.convert(stated, Intention, strict=False), motives=motives)
