"""Who proposed: a mission's events by planner and by model, on the page as text and nothing else."""

from jinja2 import Environment, FileSystemLoader

from app.views.proposers import proposers, proposers_json
from app.views.timeline import TimelineEntry
from harness.contracts.events import MissionEvent, ModelAdvised
from harness.contracts.ids import Digest, NodeId
from harness.contracts.models import ModelAdvice, ModelUse
from harness.contracts.reasons import because

USE = ModelUse(
    model="local (small-1)", exchange=Digest("a" * 64), seconds=1.5, cost=0.25, currency="EUR", input_tokens=9,
    output_tokens=4,
)  # fmt: skip


def entry(event: MissionEvent) -> TimelineEntry:
    fields = {"event": event, "position": 1, "mission_s": 1.0, "digest": "d"}
    made = object.__new__(TimelineEntry)
    for name, value in fields.items():
        object.__setattr__(made, name, value)
    return made


def advised(text: str, *, refused: bool) -> TimelineEntry:
    why = because("advice_not_next_step", action="human", following="retry") if refused else ""
    advice = ModelAdvice(role="diagnosis", node_id=NodeId("go"), said=text, use=USE, refused=why)
    return entry(ModelAdvised(advice=advice))


def test_answers_are_added_up_by_model_and_refusals_named() -> None:
    found = proposers([advised("it slipped", refused=False), advised("ask", refused=True)])
    (total,) = found.models
    assert (total.asked, total.refused, total.seconds, total.cost) == (2, 1, 3.0, 0.5)
    facts = proposers_json([advised("ask", refused=True)])
    assert facts["advice"][0]["refused_code"] == "advice_not_next_step"
    assert facts["advice"][0]["exchange"] == "a" * 64


def test_what_a_model_says_is_escaped() -> None:
    jinja = Environment(loader=FileSystemLoader("templates"), autoescape=True, extensions=["jinja2.ext.i18n"])
    jinja.install_null_translations(newstyle=True)  # type: ignore[attr-defined]
    jinja.filters |= {"words": str, "localise": str, "short": lambda text: text[:8]}
    macro = jinja.get_template("components/proposers.html").module.proposed_by  # type: ignore[attr-defined]
    text = str(macro(proposers([advised("<script>commit()</script>", refused=False)])))
    assert "<script>" not in text and "&lt;script&gt;" in text and "local (small-1)" in text
