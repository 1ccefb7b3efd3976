"""/candidates/new: a candidate of one's own, from fields or as JSON, checked before anything runs."""

from collections.abc import Mapping
from typing import Any

import msgspec
from fastapi import APIRouter
from starlette.responses import HTMLResponse, RedirectResponse, Response

from app.console import ActorDep, Console, ConsoleDep, FormDep
from app.i18n.catalogues import N_
from app.i18n.languages import explained
from app.i18n.messages import lazy_gettext, reasoned
from app.views.candidate_editor import EditorPage, EditResult, edited_text, editor_page
from app.web.rendering import render
from harness.contracts.actors import Actor
from harness.contracts.configuration import Configuration
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.reasons import plain
from rsi_reviews.contracts import Candidate, RestrictionViolation
from rsi_reviews.difference import difference
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.generate.person_edits import Intention, edited
from rsi_reviews.release_service import SignedBy

router = APIRouter(prefix="/candidates")
NOTHING = EditResult()


@router.get("/new")
def new(console: ConsoleDep, actor: ActorDep, by: str = "fields", supersedes: str = "") -> HTMLResponse:
    typed = {"by": by, "supersedes": supersedes[:64]}
    return render("candidates/new.html", page_of(console, actor, typed))


@router.post("/check")
def check(console: ConsoleDep, actor: ActorDep, typed: FormDep) -> Response:
    """What the edit would change and which rules it breaks; nothing is written."""
    _, found = read(console, actor, typed)
    status = 422 if found.errors or found.refusals else 200
    return render("candidates/new.html", page_of(console, actor, typed, found), status=status)


@router.post("")
def propose(console: ConsoleDep, actor: ActorDep, typed: FormDep) -> Response:
    """303 to the new candidate, 422 with what to correct, 409 with the reason of the refusal."""
    candidate, found = read(console, actor, typed)
    if candidate is None:
        return render("candidates/new.html", page_of(console, actor, typed, found), status=422)
    decision = proposed(console, actor, candidate, typed.get("supersedes", "").strip())
    if isinstance(decision, Refused):
        again = page_of(console, actor, typed, EditResult(errors=(reasoned(decision.reason),)))
        return render("candidates/new.html", again, status=409)
    return RedirectResponse(f"/candidates/{candidate.candidate_id}", status_code=303)


def proposed(console: Console, actor: Actor, candidate: Candidate, before: str) -> Accepted[Any] | Refused:
    """Put it on record as the successor of the candidate `before`, if it names one. Raises UnknownName."""
    supersedes = console.releases.review(before).candidate if before else None
    signed = SignedBy(actor, candidate.manifest.reason, f"propose:{candidate.candidate_id}")
    return console.releases.propose(candidate, signed, supersedes=supersedes)


def read(console: Console, actor: Actor, typed: Mapping[str, str]) -> tuple[Candidate | None, EditResult]:
    """The candidate of a form that breaks no rule, or None; and what was found about it."""
    current = current_of(console)
    text = typed.get("configuration", "") if _by_text(typed) else edited_text(current, typed)
    try:
        made = edited(text, current, _intention(typed), who=actor.name)
    except CandidateInvalid as error:
        refusal = RestrictionViolation(rule=error.rule, path=plain(error.where) or "edit", reason=error.reason)
        return None, EditResult(errors=(explained(error),), refusals=(refusal,))
    except msgspec.ValidationError as error:
        return None, EditResult(errors=(lazy_gettext("The manifest does not stand: {error}.", error=str(error)),))
    found = checked(console, made)
    return (None if found.refusals else made), found


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
    shell = console.shell(N_("Propose a change"), "candidates", actor)
    return editor_page(shell, current_of(console), typed, by_text=_by_text(typed), found=found)


def _by_text(typed: Mapping[str, str]) -> bool:
    return typed.get("by", "fields") == "text"


def _intention(typed: Mapping[str, str]) -> Intention:
    """Raises msgspec.ValidationError for what cannot stand in a manifest."""
    effect = typed.get("smallest_effect", "").strip()
    stated = {
        "reason": typed.get("reason", "").strip(),
        "intended_effect": typed.get("intended_effect", "").strip(),
        "metric": typed.get("metric", ""),
        "smallest_effect": effect,
    }
    return msgspec.convert(stated, Intention, strict=False)
