"""Shapes the release pointer: the current version, how it got there, and which missions run under which version."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, reasoned
from app.views.canary import CanaryPanel, canary_panel
from app.views.release_plot import ReleasePlot, release_plots
from app.views.review import policy_sentence
from app.views.shell import Shell
from harness.contracts.actors import Actor
from harness.contracts.ids import Digest, RobotId
from rsi_reviews.pointers import Pointer, current_at
from rsi_reviews.projections import Review

CAUSES: Mapping[str, str] = {
    "shipped": N_("shipped with the program"), "canary": N_("canary began"), "released": N_("released to every robot"),
    "rolled_back": N_("rolled back"), "withdrawn": N_("canary withdrawn"),
}  # fmt: skip
TONES = {"rolled_back": "bad", "canary": "warn", "released": "good"}
WIDTH, HEIGHT = 920.0, 64.0


@dataclass(frozen=True)
class Span:
    """A stretch of the timeline: from one move to the next, or to now."""

    revision: int
    tone: str
    title: str
    x: float
    width: float


@dataclass(frozen=True)
class VersionRow:
    """One version, the candidate that proposed it if any, and the unfinished missions pinned to it."""

    configuration: str
    state: str
    review: Review | None
    quarantined: str
    missions: Sequence[str]


@dataclass(frozen=True)
class At:
    """What was current at an instant; `found` is empty before the pointer was first written."""

    asked: str
    instant_s: float
    found: str
    robots: tuple[tuple[str, str], ...]
    wrong: str


@dataclass(frozen=True)
class PolicyForm:
    """Who must agree before a release, as it stands or as somebody left it."""

    kind: str
    quorum: str
    cooling_off_h: str
    sentence: str
    may: bool
    reviewers: tuple[str, ...]
    releasers: tuple[str, ...]
    typed: str
    refused: str


@dataclass(frozen=True)
class Around:
    """What the console found beside the pointer: candidates, pins, states of versions, who holds which role."""

    reviews: Sequence[Review]
    pins: Mapping[Digest, Sequence[str]]
    versions: Mapping[Digest, str]
    robots: Sequence[str]
    reviewers: Sequence[str]
    releasers: Sequence[str]


@dataclass(frozen=True)
class ReleasesPage:
    """Where the pointer stands, what runs under what, and who must agree. `current`: the candidate that is current."""

    shell: Shell
    pointer: Pointer
    current: Review | None
    canary: CanaryPanel | None
    plots: tuple[ReleasePlot, ...]
    spans: tuple[Span, ...]
    width: float
    height: float
    at: At | None
    versions: tuple[VersionRow, ...]
    policy: PolicyForm
    key: str


def releases_page(
    shell: Shell, pointer: Pointer, around: Around, actor: Actor, *, key: str, at: At | None, policy: PolicyForm
) -> ReleasesPage:
    by_configuration: dict[str, Review] = {one.configuration: one for one in reversed(around.reviews)}
    trial = next((one for one in around.reviews if one.candidate == pointer.trial), None)
    return ReleasesPage(
        shell=shell,
        pointer=pointer,
        current=by_configuration.get(pointer.configuration) if pointer.released else None,
        canary=canary_panel(trial, pointer, actor) if trial else None,
        plots=release_plots(around.reviews),
        spans=_spans(pointer, now_s=shell.now_s),
        width=WIDTH,
        height=HEIGHT,
        at=at,
        versions=tuple(
            VersionRow(
                configuration=name,
                state=state,
                review=by_configuration.get(name),
                quarantined=reasoned(pointer.quarantined[name].reason) if name in pointer.quarantined else "",
                missions=around.pins.get(name, ()),
            )
            for name, state in around.versions.items()
            if name
        ),
        policy=policy,
        key=key,
    )


def cause_tone(cause: str) -> str:
    return TONES.get(cause, "plain")


def policy_form(
    pointer: Pointer, around: Around, *, may: bool, typed: Mapping[str, str] | None = None, refused: str = ""
) -> PolicyForm:
    """The policy as it stands, or as the form was left."""
    left = typed or {}
    return PolicyForm(
        kind=left.get("kind", pointer.policy.kind),
        quorum=left.get("quorum", str(pointer.policy.quorum)),
        cooling_off_h=left.get("cooling_off_h", f"{pointer.policy.cooling_off_s / 3600.0:g}"),
        sentence=policy_sentence(pointer),
        may=may,
        reviewers=tuple(around.reviewers),
        releasers=tuple(around.releasers),
        typed=left.get("reason", ""),
        refused=refused,
    )


def at_instant(pointer: Pointer, text: str, instant_s: float | None, robots: Sequence[str]) -> At:
    """What a mission begun then was pinned to, on every robot. Without an instant it says how to write one."""
    if instant_s is None:
        wrong = N_("Write an instant as 2026-11-20T09:30:00Z.")
        return At(asked=text, instant_s=0.0, found="", robots=(), wrong=wrong)
    by_robot = [(robot, current_at(pointer, instant_s, robot_id=RobotId(robot)) or "") for robot in robots]
    found = current_at(pointer, instant_s) or ""
    others = tuple((robot, name) for robot, name in by_robot if name != found)
    return At(asked=text, instant_s=instant_s, found=found, robots=others, wrong="")


def _spans(pointer: Pointer, *, now_s: float) -> tuple[Span, ...]:
    """Equal stretches would hide time, true ones would hide short canaries: each gets at least a visible width."""
    moves = pointer.history
    if not moves:
        return ()
    ends = [*(one.at_s for one in moves[1:]), max(now_s, moves[-1].at_s)]
    lasted = [max(end - one.at_s, 0.0) for one, end in zip(moves, ends, strict=True)]
    least = WIDTH / (4.0 * len(moves))
    free, total = WIDTH - least * len(moves), sum(lasted) or 1.0
    spans, x = [], 0.0
    for move, seconds in zip(moves, lasted, strict=True):
        width = least + free * seconds / total
        title = lazy_gettext(
            "revision {revision}, {cause}: {configuration}",
            revision=move.revision,
            cause=CAUSES[move.cause],
            configuration=(move.canary or move.configuration)[:8],
        )
        spans.append(Span(move.revision, cause_tone(move.cause), title, round(x, 1), round(width - 2.0, 1)))
        x += width
    return tuple(spans)
