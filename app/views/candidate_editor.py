"""Shapes the editor of a candidate: the knobs of H, those that are turned, and what is wrong with each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import groupby
from typing import get_args

import msgspec

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, reasoned, word
from app.views.forms import SelectOption
from app.views.shell import Shell
from harness.contracts.configuration import Configuration
from harness.contracts.values import encode
from rsi_reviews.contracts import BETTER, Metric, RestrictionViolation
from rsi_reviews.difference import NAMES, CandidateDifference
from rsi_reviews.generate.trace import MissionTrace
from rsi_reviews.knobs import LADDERS, Knob, knobs, ladders_from, value_text
from rsi_reviews.refused_proposals import ProposalRefused

MOST_KNOBS = 12
TITLES: Mapping[str, str] = {
    "c1_items": N_("records for the planner"), "c2_items": N_("records for a skill"),
    "c2_examples": N_("examples for a skill"), "c4_items": N_("records for recovery"),
    "minimum_confidence": N_("least confidence"), "pose_age_s": N_("age of a pose"),
    "image_age_s": N_("age of an image"), "wait_s": N_("wait"), "approval_share": N_("share spent without asking"),
    "success": N_("weight of success"), "risk": N_("weight of risk"), "uncertainty": N_("weight of uncertainty"),
    "latency": N_("weight of latency"), "cost": N_("weight of cost"), "history": N_("weight of history"),
    "history_half_life": N_("half-life of history"),
}  # fmt: skip

UNNAMED = ("weight", "share", "steps")
"""Units that say nothing beside the value, or that the title says."""


@dataclass(frozen=True)
class KnobRow:
    """One knob of the list: what it is, what it is now and may become, and the address that turns it."""

    knob: Knob
    title: str
    now: str
    unit: str
    range: str
    href: str


@dataclass(frozen=True)
class KnobGroup:
    """The knobs of one component, or of one task template."""

    title: str
    of: str
    rows: tuple[KnobRow, ...]


@dataclass(frozen=True)
class TurnedKnob:
    """A knob in the form. `wrong` says what to correct; `choices` are the steps that a ladder may have."""

    row: KnobRow
    value: str
    wrong: str
    choices: tuple[SelectOption, ...]


@dataclass(frozen=True)
class ProposalOrigin:
    """The mission that a proposal answers: the knobs of the failures it had, and whether it is a regression case."""

    mission_id: str
    failures: tuple[str, ...]
    rows: tuple[KnobRow, ...]
    is_case: bool


@dataclass(frozen=True)
class EditResult:
    """The result of checking an edit: errors, broken rules and, for a valid edit, what it changes.

    `kept`: the refused proposal that was put on record, if one was.
    """

    errors: Sequence[str] = ()
    refusals: Sequence[RestrictionViolation] = ()
    difference: CandidateDifference | None = None
    kept: str = ""


@dataclass(frozen=True)
class EditorPage:
    """The form as the person left it. Without a knob it lists them; `by_text` shows the configuration as JSON."""

    shell: Shell
    baseline: str
    by_text: bool
    groups: tuple[KnobGroup, ...]
    turned: tuple[TurnedKnob, ...]
    more: tuple[KnobGroup, ...]
    origin: ProposalOrigin | None
    text: str
    metrics: tuple[SelectOption, ...]
    smallest_effect: str
    reason: str
    intended: str
    supersedes: str
    errors: tuple[str, ...]
    broken: tuple[RestrictionViolation, ...]
    changes: CandidateDifference | None
    kept: str

    @property
    def knobs(self) -> str:
        """The turned knobs as the form carries them."""
        return ",".join(one.row.knob.path for one in self.turned)


def editor_page(
    shell: Shell,
    current: Configuration,
    typed: Mapping[str, str],
    *,
    by_text: bool,
    found: EditResult,
    origin: tuple[MissionTrace, bool] | None = None,
) -> EditorPage:
    """`origin`: the mission that led to it, and whether the regression suite holds it."""
    chosen = typed.get("metric", "recovery_cost")
    known = {one.path: one for one in knobs(current)}
    paths = _paths(known, typed)
    wrong = {_field_path(one.path): reasoned(one.reason) for one in found.refusals}
    section = known[paths[0]].section if paths else None
    rest = [one for one in known.values() if one.section == section and one.path not in paths]
    mission = typed.get("mission", "")
    return EditorPage(
        shell=shell,
        baseline=current.configuration_id,
        by_text=by_text,
        groups=_groups(list(known.values()), mission) if not by_text and not paths else (),
        turned=() if by_text else tuple(_turned(current, known[path], typed, wrong) for path in paths),
        more=_groups(rest, mission),
        origin=_origin(known, *origin) if origin else None,
        text=typed.get("configuration", msgspec.json.format(encode(current), indent=2).decode()) if by_text else "",
        metrics=tuple(
            SelectOption(
                one,
                lazy_gettext("{metric}, {direction} is better", metric=word(one), direction=BETTER[one]),
                one == chosen,
            )
            for one in get_args(Metric)
        ),
        smallest_effect=typed.get("smallest_effect", "0.1"),
        reason=typed.get("reason", ""),
        intended=typed.get("intended_effect", ""),
        supersedes=typed.get("supersedes", ""),
        errors=tuple(found.errors),
        broken=tuple(found.refusals),
        changes=found.difference if not found.refusals else None,
        kept=found.kept,
    )


def draft_of(refused: ProposalRefused, was: Configuration, made: Configuration) -> dict[str, str]:
    """The form that makes a refused proposal again, from its configuration `made` and the one it was made from."""
    before = {one.path: one for one in knobs(was)}
    turned = {
        one.path: value_text(one.now) for one in knobs(made) if one.path in before and one.now != before[one.path].now
    }
    manifest = refused.manifest
    return {
        "knobs": ",".join(turned),
        "reason": manifest.reason,
        "intended_effect": manifest.intended_effect,
        "metric": manifest.metric,
        "smallest_effect": f"{manifest.smallest_effect:g}",
        "mission": manifest.motives[0].mission_id if manifest.motives else "",
        **turned,
    }


def knob_title(knob: Knob) -> str:
    """What a person calls it."""
    name = knob.path.rpartition(".")[2]
    if knob.is_ladder:
        return lazy_gettext("after: {failure}", failure=word(name))
    if knob.section != "templates":
        return TITLES.get(name) or word(knob.name)
    if name == "recovery_total":
        return N_("recovery steps of a mission")
    return lazy_gettext("timeout of {stage}", stage=word(knob.path.split(".")[-2]))


def knob_range(knob: Knob) -> str:
    """How far the rules let it go, in words."""
    if knob.is_ladder:
        return N_("one step more, one less, or two swapped")
    least, most = f"{knob.least:g}", "" if knob.most is None else f"{knob.most:g}"
    if knob.above:
        return lazy_gettext("above {least}, at most {most}", least=least, most=most)
    if knob.whole:
        return lazy_gettext("a whole number from {least} to {most}", least=least, most=most)
    return lazy_gettext("from {least} to {most}", least=least, most=most)


def steps_in_words(value: str) -> str:
    """A ladder as a person reads it."""
    steps = [word(one) for one in value.split(" > ")]
    return reduce(lambda before, step: lazy_gettext("{before} → {step}", before=before, step=step), steps)


def _paths(known: Mapping[str, Knob], typed: Mapping[str, str]) -> tuple[str, ...]:
    """The turned knobs, those that exist, each once; a field that was filled in counts without being named."""
    added = typed.get("another", "") if "add" in typed else ""
    named = [*typed.get("knobs", "").split(","), added, *(path for path in known if path in typed)]
    dropped = typed.get("drop", "")
    return tuple(dict.fromkeys(one for one in named if one in known and one != dropped))[:MOST_KNOBS]


def _groups(found: Sequence[Knob], mission: str) -> tuple[KnobGroup, ...]:
    return tuple(
        KnobGroup(title=NAMES[section], of=of, rows=tuple(_row(one, mission) for one in rows))
        for (section, of), rows in groupby(found, key=lambda one: (one.section, one.of))
    )


def _row(knob: Knob, mission: str) -> KnobRow:
    now = value_text(knob.now)
    return KnobRow(
        knob=knob,
        title=knob_title(knob),
        now=steps_in_words(now) if knob.is_ladder else now,
        unit="" if knob.unit in UNNAMED else knob.unit,
        range=knob_range(knob),
        href=f"/candidates/new?knobs={knob.path}{f'&mission={mission}' if mission else ''}",
    )


def _turned(current: Configuration, knob: Knob, typed: Mapping[str, str], wrong: Mapping[str, str]) -> TurnedKnob:
    row, value = _row(knob, ""), typed.get(knob.path, value_text(knob.now))
    return TurnedKnob(row=row, value=value, wrong=wrong.get(knob.path, ""), choices=_choices(current, knob, value))


def _choices(current: Configuration, knob: Knob, value: str) -> tuple[SelectOption, ...]:
    """What a ladder may become; what stands in the form stays in it, allowed or not."""
    if not knob.is_ladder:
        return ()
    failure = next(one for one in current.recovery.ladders if knob.path == f"{LADDERS}.{one}")
    ladders = (value_text(knob.now), *(value_text(one) for one in ladders_from(current, failure)), value)
    return tuple(SelectOption(one, steps_in_words(one), one == value) for one in dict.fromkeys(ladders))


def _origin(known: Mapping[str, Knob], trace: MissionTrace, is_case: bool) -> ProposalOrigin:
    failures = tuple(dict.fromkeys(one.failure for one in trace.failures))
    paths = [f"{LADDERS}.{one}" for one in failures]
    return ProposalOrigin(
        mission_id=trace.mission_id,
        failures=failures,
        rows=tuple(_row(known[path], trace.mission_id) for path in paths if path in known),
        is_case=is_case,
    )


def _field_path(path: str) -> str:
    """The name of the form field for a path in a refusal."""
    return path.removeprefix("$.").removeprefix("candidate, $.").replace("[...]", "")
