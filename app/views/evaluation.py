"""Shapes the published evaluation and the recursion experiment as tables and plots."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.i18n.catalogues import N_
from app.i18n.messages import word
from app.views.shell import Shell

MEASURES = (
    ("contract_false", N_("contract false completions")),
    ("epistemic_false", N_("epistemic false completions")),
    ("success", "success"),
    ("handoff", "handoffs"),
    ("false_rejection", N_("false rejections")),
    ("duplicate_starts", N_("duplicate physical starts")),
)
CURVES = (
    ("recovery_cost", N_("recovery cost per mission, lower is better")),
    ("verified_completion", N_("verified completion, higher is better")),
    ("false_completion", N_("contract false completions per mission")),
)
MARKS = ("circle", "square", "diamond", "up", "down", "cross")
BAR_WIDTH, BAR_ROW = 360.0, 16.0
CURVE_WIDTH, CURVE_HEIGHT, MARGIN = 560.0, 220.0, 34.0
Document = Mapping[str, Any]


@dataclass(frozen=True)
class ArmRow:
    """One arm under one condition: the chosen measure with its interval, as numbers and as places on the plot."""

    arm: str
    n: int
    value: float
    low: float
    high: float
    x: float
    low_x: float
    high_x: float
    y: float
    spent: float
    mission_s: float
    command: str
    seeds: str


@dataclass(frozen=True)
class EvaluationConditionRow:
    """One condition (a fault) with every arm."""

    name: str
    text: str
    rows: tuple[ArmRow, ...]
    height: float


@dataclass(frozen=True)
class MeasureTab:
    """One measure that the page can show."""

    title: str
    href: str
    chosen: bool


@dataclass(frozen=True)
class EvaluationView:
    """The evaluation protocol's figures for one measure."""

    command: str
    code: str
    missions: int
    measure: str
    tabs: tuple[MeasureTab, ...]
    arms: tuple[tuple[str, str], ...]
    conditions: tuple[EvaluationConditionRow, ...]
    checks: tuple[Document, ...]
    worst: tuple[str, ...]
    width: float


@dataclass(frozen=True)
class GenerationPoint:
    """One generation of one arm."""

    generation: int
    value: float
    low: float
    high: float
    x: float
    y: float
    low_y: float
    high_y: float


@dataclass(frozen=True)
class Curve:
    """One arm over the generations; `mark` tells arms apart without colour."""

    arm: str
    mark: str
    path: str
    points: tuple[GenerationPoint, ...]


@dataclass(frozen=True)
class Chart:
    """One measure of the recursion experiment, with the ends of its axis."""

    title: str
    curves: tuple[Curve, ...]
    least: float
    most: float
    width: float
    height: float


@dataclass(frozen=True)
class AnswerRow:
    """One thing that would refute the claim, and whether it did. `state` is refuted, not refuted or not answered."""

    refutes: str
    state: str
    sentence: str


@dataclass(frozen=True)
class RecursionView:
    """The recursion experiment. `complete` is false while fleets are missing."""

    command: str
    fleets: int
    asked: int
    complete: bool
    charts: tuple[Chart, ...]
    answers: tuple[AnswerRow, ...]


@dataclass(frozen=True)
class EvaluationPage:
    """The evaluation and the recursion experiment; None where nothing is published yet."""

    shell: Shell
    evaluation: EvaluationView | None
    recursion: RecursionView | None
    wrong: tuple[str, ...]


def evaluation_view(found: Document, measure: str) -> EvaluationView:
    """`measure` is one of MEASURES. Shares are drawn from 0 to 1."""
    return EvaluationView(
        command=str(found.get("command", "")),
        code=str(found.get("code", "")),
        missions=int(found.get("missions_per_cell", 0)),
        measure=dict(MEASURES)[measure],
        tabs=tuple(
            MeasureTab(title=title, href=f"/evaluation?measure={name}", chosen=name == measure)
            for name, title in MEASURES
        ),
        arms=tuple((word(one["name"].replace("-", "_")), one["text"]) for one in found.get("arms", ())),
        conditions=tuple(_condition(found, one, measure) for one in found.get("conditions", ())),
        checks=tuple(found.get("suites", ())),
        worst=tuple(str(one) for one in found.get("worst", ())[:10]),
        width=BAR_WIDTH,
    )


def recursion_view(found: Document) -> RecursionView:
    rows = found["rows"]
    return RecursionView(
        command=str(found.get("command", "")),
        fleets=int(found.get("fleets", 0)),
        asked=int(found.get("fleets_asked", 0)),
        complete=bool(found.get("complete", False)),
        charts=tuple(_chart(rows, key, title) for key, title in CURVES if any(key in row for row in rows)),
        answers=tuple(_answer(one) for one in found.get("answers", ())),
    )


def _condition(found: Document, condition: Document, measure: str) -> EvaluationConditionRow:
    cells = [one for one in found.get("cells", ()) if one["condition"] == condition["name"]]
    rows = tuple(
        ArmRow(
            arm=word(cell["arm"].replace("-", "_")),
            n=cell["n"],
            value=cell[measure]["value"],
            low=cell[measure]["low"],
            high=cell[measure]["high"],
            x=round(cell[measure]["value"] * BAR_WIDTH, 1),
            low_x=round(cell[measure]["low"] * BAR_WIDTH, 1),
            high_x=round(cell[measure]["high"] * BAR_WIDTH, 1),
            y=BAR_ROW * (index + 0.5),
            spent=cell["spent_mean"]["value"],
            mission_s=cell["mission_s_mean"]["value"],
            command=cell["command"],
            seeds=cell["seeds"],
        )
        for index, cell in enumerate(cells)
    )
    return EvaluationConditionRow(
        name=word(condition["name"].replace("-", "_")), text=condition["text"], rows=rows, height=BAR_ROW * len(rows)
    )


def _answer(answer: Document) -> AnswerRow:
    states = {True: "refuted", False: N_("not refuted")}
    return AnswerRow(
        refutes=str(answer["refutes"]), state=states.get(answer["refuted"], N_("not answered")),
        sentence=str(answer["sentence"]),
    )  # fmt: skip


def _chart(rows: Sequence[Document], key: str, title: str) -> Chart:
    known = [row for row in rows if row.get(key) is not None]
    ends = [value for row in known for value in row.get(f"{key}_ci", (row[key], row[key]))]
    least, most = float(min(ends)), float(max(ends))
    last = max((row["generation"] for row in known), default=0) or 1
    span = (most - least) or 1.0

    def place_y(value: float) -> float:
        return round(CURVE_HEIGHT - MARGIN - (value - least) / span * (CURVE_HEIGHT - 2 * MARGIN), 1)

    def point(row: Document) -> GenerationPoint:
        low, high = row.get(f"{key}_ci", (row[key], row[key]))
        x = round(MARGIN + row["generation"] / last * (CURVE_WIDTH - 2 * MARGIN), 1)
        return GenerationPoint(
            row["generation"], row[key], low, high, x, place_y(row[key]), place_y(low), place_y(high)
        )

    arms = dict.fromkeys(row["arm"] for row in known)
    curves = []
    for index, arm in enumerate(arms):
        points = tuple(point(row) for row in known if row["arm"] == arm)
        path = " ".join(f"{one.x},{one.y}" for one in points)
        curves.append(Curve(arm=arm, mark=MARKS[index % len(MARKS)], path=path, points=points))
    return Chart(title, tuple(curves), least, most, CURVE_WIDTH, CURVE_HEIGHT)
