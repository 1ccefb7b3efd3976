"""Renders a mission's report as PDF: the content of the printable page with its pictures, in the reader's language.

A sign that no font here has is drawn as an empty box, and the document says so.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any

from fpdf import FPDF
from fpdf.enums import XPos, YPos
from fpdf.fonts import FontFace, TTFFont
from fpdf.image_parsing import preload_image

from app.i18n.catalogues import ENGLISH
from app.i18n.languages import localise
from app.i18n.messages import lazy_gettext, word
from app.i18n.visible_text import visible
from app.views.missions import sentence
from app.views.readings import clause_verdicts, goal_words, source_words
from app.views.report import DeclaredResult, ReportPage, ReportPicture
from app.views.unverified import UNVERIFIED
from app.web.filters import clock, duration, instant, words
from harness.contracts.errors import HarnessError
from harness.contracts.observations import SINGLE_SOURCE
from harness.contracts.reasons import because

FONT, CHINESE = "DejaVu", "Droid"
LETTERS, HANZI = "dejavu-2.37", "droid-fallback-6.0.1/DroidSansFallback.ttf"
MISSING = "\u25a1"
PICTURE_MM = 88.0
MARGIN_MM = 14.0
CAPTION_MM = 6.0
LABELS = lazy_gettext(
    "Declared: stated by a provider or a service. Measured: measured by the harness itself. Accepted: passed the "
    "gate's configured checks, which is no proof of the truth."
)
BOX_RGB = (255, 170, 0)
GREY = FontFace(fill_color=(236, 238, 240), emphasis="BOLD")


class PictureUnreadable(HarnessError):
    """A picture of the report cannot be drawn."""

    code = "picture_unreadable"


class _ReportDocument(FPDF):
    """Pages with a foot, in one language; `lacking` counts the signs that no font has."""

    def __init__(self, page: ReportPage, fonts: Path, language: str) -> None:
        super().__init__(format="A4")
        self.lacking = 0
        self._page, self._fonts, self.language = page, fonts, language
        self.add_font(FONT, "", fonts / LETTERS / "DejaVuSans.ttf")
        self.add_font(FONT, "B", fonts / LETTERS / "DejaVuSans-Bold.ttf")
        self._known = self._signs(FONT)
        self.set_margin(MARGIN_MM)
        self.set_auto_page_break(True, margin=MARGIN_MM + 4)
        self.set_font(FONT, size=9)

    def header(self) -> None:
        """Nothing is shown: see `set_font`."""
        self.text(0.0, 0.0, "")

    def set_font(self, family: str | None = None, style: Any = "", size: float = 0) -> None:
        """Selects it in the page's own stream at once.

        fpdf2 2.8.9 selects a font inside the first line that needs it; where that line begins with the other font, the
        selection ends with the line, and the next line is drawn without any.
        """
        super().set_font(family, style, size)
        if self.page and not self.current_font_is_set_on_page:
            self.text(0.0, 0.0, "")

    def footer(self) -> None:
        """The mission, where its log stood, and the page."""
        self.set_y(-MARGIN_MM)
        self.set_font(FONT, size=7)
        page, place = self._page, lazy_gettext("page {number} of {count}", number=self.page_no(), count="{nb}")
        foot = lazy_gettext("event {position}", position=page.position)
        stands = f"{page.mission_id}, {self.spoken(foot)}, sha256 {page.digest[:16]}"
        self.cell(0, 4, f"{stands}    {self.spoken(place)}")

    def spoken(self, text: str) -> str:
        """The text in the reader's language, as these fonts can draw it."""
        text = visible(str(localise(text, self.language)))
        if CHINESE.lower() not in self.fonts and any(ord(sign) not in self._known for sign in text if sign != "\n"):
            self.add_font(CHINESE, "", self._fonts / HANZI)
            self.set_fallback_fonts([CHINESE], exact_match=False)
            self._known |= self._signs(CHINESE)
        drawn = "".join(sign if ord(sign) in self._known or sign == "\n" else MISSING for sign in text)
        self.lacking += drawn.count(MISSING) - text.count(MISSING)
        return drawn

    def _signs(self, name: str) -> frozenset[int]:
        font = self.fonts[name.lower()]
        return frozenset(font.cmap if isinstance(font, TTFFont) else ())

    def close_fonts(self) -> None:
        """The files behind the fonts; nothing can be drawn afterwards."""
        for font in self.fonts.values():
            if isinstance(font, TTFFont):
                font.ttfont.close()

    def title_line(self, text: str, *, size: int = 12, before_mm: float = 22.0) -> None:
        """A title on the page of what follows it: `before_mm` is the room that needs."""
        if self.will_page_break(before_mm):
            self.add_page()
        self.ln(2)
        self.set_font(FONT, "B", size)
        self.multi_cell(0, size * 0.5, self.spoken(text), align="L", new_x=XPos.LMARGIN, new_y=YPos.NEXT)
        self.set_font(FONT, size=9)

    def paragraph(self, text: str) -> None:
        self.multi_cell(0, 4.6, self.spoken(text), align="L", new_x=XPos.LMARGIN, new_y=YPos.NEXT)

    def rows(self, head: Sequence[str], body: Iterable[Sequence[str]], widths: Sequence[int]) -> None:
        """A table whose cells wrap."""
        self.set_font(FONT, size=8)
        with self.table(headings_style=GREY, col_widths=tuple(widths), line_height=4.2, text_align="LEFT") as table:
            for cells in (head, *body):
                row = table.row()
                for cell in cells:
                    row.cell(self.spoken(cell))
        self.set_font(FONT, size=9)


@dataclass(frozen=True)
class Document:
    """A finished PDF. `lacking` signs of its text are in no font, and are drawn as empty boxes."""

    body: bytes
    lacking: int


def report_pdf(
    page: ReportPage, pictures: Mapping[str, bytes], *, fonts: Path, made_s: float, language: str = ENGLISH
) -> Document:
    """A4. `pictures`: bytes by digest of those that verify; the others are named as broken. `fonts`: static/vendor.

    Raises PictureUnreadable for bytes that are no picture.
    """
    paper = _ReportDocument(page, fonts, language)
    try:
        body = _drawn(paper, page, pictures, made_s=made_s)
    finally:
        paper.close_fonts()
    return Document(body=body, lacking=paper.lacking)


def _drawn(paper: _ReportDocument, page: ReportPage, pictures: Mapping[str, bytes], *, made_s: float) -> bytes:
    paper.set_creation_date(datetime.fromtimestamp(made_s, UTC))
    paper.set_title(f"Report {page.mission_id}")
    paper.set_lang(paper.language)
    paper.add_page()
    _summary(paper, page)
    _goal(paper, page)
    _stages(paper, page)
    _words(paper, lazy_gettext("Findings: declared by the analysis"), page.findings)
    _pictures(paper, page, pictures)
    _words(paper, lazy_gettext("Receipts: declared by a service, not measured"), page.receipts)
    _actions(paper, page)
    if paper.lacking:
        paper.title_line(lazy_gettext("What could not be printed"), size=10)
        paper.paragraph(
            lazy_gettext(
                "{count} characters are drawn as {box}: the fonts of this document lack them. The report in the "
                "console and its JSON hold them all.",
                count=paper.lacking,
                box=MISSING,
            )
        )
    return bytes(paper.output())


def _single_source(page: ReportPage) -> tuple[tuple[str, str], ...]:
    """A row for a mission whose position and motion come from one topic; none for any other."""
    topic = page.head.mission.labels.get(SINGLE_SOURCE)
    if not topic:
        return ()
    text = lazy_gettext("Position and motion come from {topic}; nothing else confirms them.", topic=topic)
    return ((lazy_gettext("single source"), text),)


def _summary(paper: _ReportDocument, page: ReportPage) -> None:
    say = paper.spoken
    paper.title_line(lazy_gettext("Report: {goal}", goal=goal_words(page.head.mission)), size=15)
    if source := source_words(page.head.mission):
        paper.paragraph(lazy_gettext("asked as “{text}”", text=source))
    paper.paragraph(f"{say(words(page.head.mission.status)).capitalize()}. {say(sentence(page.head.mission))}")
    starts = (
        lazy_gettext("the robot's journal cannot be read from here")
        if page.starts is None
        else lazy_gettext(
            "{starts} by the robot's own journal, {again} repeated", starts=page.starts, again=page.duplicates
        )
    )
    took = duration(page.head.elapsed_s)
    began = lazy_gettext("{instant}, {time} of mission time", instant=instant(page.head.began_s), time=took)
    kind = lazy_gettext("{template} on {robot}", template=page.head.mission.template, robot=page.head.mission.robot_id)
    disputed = "\n".join(f"{one.who}: {say(one.text)}" for one in page.disputes)
    facts = (
        (lazy_gettext("mission"), f"{page.mission_id}, {say(kind)}"),
        (lazy_gettext("configuration"), page.head.mission.configuration),
        (lazy_gettext("began"), began),
        (lazy_gettext("physical starts"), starts),
        *_single_source(page),
        (lazy_gettext("disputed acceptances"), disputed or lazy_gettext("none")),
        (lazy_gettext("stands at"), f"{say(lazy_gettext('event {position}', position=page.position))}, {page.digest}"),
    )
    paper.ln(2)
    paper.rows((lazy_gettext("fact"), lazy_gettext("value")), facts, (22, 78))
    paper.ln(1)
    paper.paragraph(LABELS)


def _goal(paper: _ReportDocument, page: ReportPage) -> None:
    say = paper.spoken
    paper.title_line(
        lazy_gettext("Goal: {verdict}", verdict=word(page.verdict) if page.verdict else lazy_gettext("not tested"))
    )
    paper.paragraph(page.reason)
    _clauses(paper, page)
    for one in page.conditions:
        measured = ", ".join(f"{say(m.name)} {say(m.value or lazy_gettext('not measured'))}" for m in one.measures)
        verdict = lazy_gettext("declared") if one.declared else word(one.result.verdict)
        found = f"{say(verdict)}: {say(one.result.text)}"
        level = lazy_gettext(
            "independence {level} of {required} required",
            level=one.result.independence,
            required=one.result.required_independence,
        )
        paper.paragraph(f"{found} ({', '.join(part for part in (measured, say(level)) if part)})")
    if page.unverified:
        paper.title_line(lazy_gettext("Unverified parts"))
        body = [(one.text, words(one.node_id or ""), UNVERIFIED[one.why]) for one in page.unverified]
        paper.rows((lazy_gettext("part"), lazy_gettext("stage"), lazy_gettext("why")), body, (56, 18, 26))


def _clauses(paper: _ReportDocument, page: ReportPage) -> None:
    """The goal verdict as a table by clause (D44)."""
    say = paper.spoken
    body = [
        (
            say(row.told),
            say(one.result.text),
            say(word(one.result.verdict)),
            lazy_gettext(
                "{level} of {required}", level=one.result.independence, required=one.result.required_independence
            ),
        )
        for row in clause_verdicts(page.head.mission)
        for one in row.tests
        if one.result
    ]
    if body:
        heads = (
            lazy_gettext("clause"),
            lazy_gettext("condition"),
            lazy_gettext("verdict"),
            lazy_gettext("independence"),
        )
        paper.rows(heads, body, (30, 42, 14, 14))
        paper.ln(1)


def _stages(paper: _ReportDocument, page: ReportPage) -> None:
    say, nothing = paper.spoken, lazy_gettext("nothing")
    paper.title_line(lazy_gettext("Stages"))
    body = [
        (
            f"{say(stage.title)}\n{say(stage.status)}",
            "\n".join(f"{say(one.name)} {say(one.value)}" for one in stage.declared) or nothing,
            "\n".join(f"{say(one.name)} {say(one.value)}" for one in stage.measured) or nothing,
            stage.accepted.text,
        )
        for stage in page.stages
    ]
    paper.rows(
        (lazy_gettext("stage"), lazy_gettext("declared"), lazy_gettext("measured"), lazy_gettext("accepted")),
        body,
        (24, 25, 28, 23),
    )
    paper.title_line(lazy_gettext("Timings, mission time (measured)"))
    took = [
        (
            words(one.node_id),
            clock(one.dispatched_s) if one.dispatched_s is not None else "",
            clock(one.accepted_s) if one.accepted_s is not None else lazy_gettext("never"),
            duration(one.took_s) if one.took_s is not None else "",
            str(one.attempts),
        )
        for one in page.timings
    ]
    head = (
        lazy_gettext("stage"),
        lazy_gettext("dispatched (UTC)"),
        lazy_gettext("accepted (UTC)"),
        lazy_gettext("took"),
        lazy_gettext("attempts"),
    )
    paper.rows(head, took, (32, 18, 18, 18, 14))


def _words(paper: _ReportDocument, title: str, told_so: Sequence[DeclaredResult]) -> None:
    say = paper.spoken
    paper.title_line(title)
    if not told_so:
        paper.paragraph(lazy_gettext("None."))
        return
    body = [
        (
            f"{say(one.kind)}\n{say(words(one.node_id))}",
            one.text or lazy_gettext("no text"),
            f"{one.source}\n{one.receipt_id}",
            clock(one.at_s),
        )
        for one in told_so
    ]
    paper.rows(
        (lazy_gettext("what"), lazy_gettext("says"), lazy_gettext("by"), lazy_gettext("at (UTC), mission time")),
        body,
        (16, 40, 33, 11),
    )


def _pictures(paper: _ReportDocument, page: ReportPage, pictures: Mapping[str, bytes]) -> None:
    """Those that verify, two beside each other; then the ones that do not, by name."""
    paper.title_line(lazy_gettext("Pictures, mission time"), before_mm=78.0 if pictures else 22.0)
    if not page.pictures:
        paper.paragraph(lazy_gettext("No camera frame belongs to this mission's evidence."))
    top = paper.get_y()
    for index, one in enumerate(one for one in page.pictures if one.blob in pictures):
        left = index % 2 == 0
        height = _height(paper, pictures[one.blob], one.blob, page.mission_id)
        if left and paper.will_page_break(height + CAPTION_MM):
            paper.add_page()
        top = paper.get_y() if left else top
        side = MARGIN_MM if left else MARGIN_MM + 94
        paper.image(BytesIO(pictures[one.blob]), x=side, y=top, w=PICTURE_MM)
        _boxes(paper, one, side_mm=side, top_mm=top)
        paper.set_font(FONT, size=7)
        paper.set_xy(side, top + height + 0.5)
        paper.cell(PICTURE_MM, 3.5, f"{_caption(paper, one)}, {paper.spoken(lazy_gettext('verified'))}")
        paper.set_font(FONT, size=9)
        paper.set_xy(MARGIN_MM, top + height + CAPTION_MM)
    for one in page.pictures:
        if one.blob not in pictures:
            why = paper.spoken(one.broken.text if one.broken else lazy_gettext("its bytes are not here"))
            paper.paragraph(f"{_caption(paper, one)}: {paper.spoken(lazy_gettext('not shown'))}, {why}")


def _boxes(paper: _ReportDocument, one: ReportPicture, *, side_mm: float, top_mm: float) -> None:
    """What an analysis found, over the picture that begins there."""
    if one.marked is None or one.marked.width_px < 1:
        return
    scale = PICTURE_MM / one.marked.width_px
    with paper.local_context(draw_color=BOX_RGB, text_color=BOX_RGB, line_width=0.4):
        paper.set_font(FONT, "B", size=6)
        for box in one.marked.boxes:
            x, y = side_mm + box.x * scale, top_mm + box.y * scale
            paper.rect(x, y, box.width * scale, box.height * scale)
            score = "" if box.score is None else f" {box.score:.2f}"
            paper.text(x, max(y - 0.6, top_mm + 2.0), paper.spoken(f"{box.label}{score}"))
    paper.set_font(FONT, size=9)


def _height(paper: _ReportDocument, body: bytes, blob: str, mission_id: str) -> float:
    """Millimetres of a picture that is PICTURE_MM wide. Raises PictureUnreadable."""
    try:
        _, _, info = preload_image(paper.image_cache, BytesIO(body))
    except (OSError, ValueError) as error:
        raise PictureUnreadable(
            because("picture_unreadable", blob=blob[:12], error=str(error)), where=mission_id
        ) from error
    return PICTURE_MM * info.height / info.width


def _caption(paper: _ReportDocument, one: ReportPicture) -> str:
    return f"{paper.spoken(words(one.node_id))} {clock(one.at_s)} UTC, sha256 {one.blob[:16]}"


def _actions(paper: _ReportDocument, page: ReportPage) -> None:
    paper.title_line(lazy_gettext("What people decided and recovery spent"))
    if page.actions:
        rows = [(clock(one.at_s), one.who, one.text) for one in page.actions]
        paper.rows(
            (lazy_gettext("at (UTC), mission time"), lazy_gettext("who"), lazy_gettext("what")), rows, (14, 26, 60)
        )
    else:
        paper.paragraph(lazy_gettext("Nobody had to decide anything and recovery spent nothing."))
