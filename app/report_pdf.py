"""A mission's report as PDF: the same page as the printable one, with its pictures, for people without this console.

What the font lacks (Chinese, for one) is drawn as an empty box, and the document says so.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path

from fpdf import FPDF
from fpdf.enums import XPos, YPos
from fpdf.fonts import FontFace, TTFFont

from app.filters import clock, duration, instant, words
from app.views.report import ReportPage, Word
from harness.contracts.errors import HarnessError

FONT = "DejaVu"
MISSING = "\u25a1"
PICTURE_MM = 88.0
MARGIN_MM = 14.0
LABELS = (
    "Declared: the word of a provider or a service. Measured: what the harness measured itself. "
    "Accepted: what passed the gate's configured checks; that is not proof of the truth."
)
GREY = FontFace(fill_color=(236, 238, 240), emphasis="BOLD")


class PictureUnreadable(HarnessError):
    """A picture of the report cannot be drawn."""

    code = "picture_unreadable"


class _Paper(FPDF):
    """Pages with a head and a foot; `lacking` counts the signs that the font does not have."""

    def __init__(self, page: ReportPage, fonts: Path) -> None:
        super().__init__(format="A4")
        self.lacking = 0
        self._foot = f"{page.mission_id}, event {page.position}, sha256 {page.digest[:16]}"
        self.add_font(FONT, "", fonts / "DejaVuSans.ttf")
        self.add_font(FONT, "B", fonts / "DejaVuSans-Bold.ttf")
        font = self.fonts[FONT.lower()]
        self._known = frozenset(font.cmap if isinstance(font, TTFFont) else ())
        self.set_margin(MARGIN_MM)
        self.set_auto_page_break(True, margin=MARGIN_MM + 4)
        self.set_font(FONT, size=9)

    def footer(self) -> None:
        """The mission, where its log stood, and the page."""
        self.set_y(-MARGIN_MM)
        self.set_font(FONT, size=7)
        self.cell(0, 4, f"{self._foot}    page {self.page_no()} of {{nb}}")

    def spoken(self, text: str) -> str:
        """The text as this font can draw it."""
        drawn = "".join(sign if ord(sign) in self._known or sign == "\n" else MISSING for sign in text)
        self.lacking += drawn.count(MISSING) - text.count(MISSING)
        return drawn

    def close_fonts(self) -> None:
        """The files behind the fonts; nothing can be drawn afterwards."""
        for font in self.fonts.values():
            if isinstance(font, TTFFont):
                font.ttfont.close()

    def title_line(self, text: str, *, size: int = 12) -> None:
        self.ln(2)
        self.set_font(FONT, "B", size)
        self.multi_cell(0, size * 0.5, self.spoken(text), new_x=XPos.LMARGIN, new_y=YPos.NEXT)
        self.set_font(FONT, size=9)

    def paragraph(self, text: str) -> None:
        self.multi_cell(0, 4.6, self.spoken(text), new_x=XPos.LMARGIN, new_y=YPos.NEXT)

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
    """A finished PDF. `lacking` signs of its text are drawn as empty boxes."""

    body: bytes
    lacking: int


def report_pdf(page: ReportPage, pictures: Mapping[str, bytes], *, fonts: Path, made_s: float) -> Document:
    """A4. `pictures`: bytes by digest of those that verify; the others are named as broken.

    Raises PictureUnreadable for bytes that are no picture.
    """
    paper = _Paper(page, fonts)
    try:
        body = _drawn(paper, page, pictures, made_s=made_s)
    finally:
        paper.close_fonts()
    return Document(body=body, lacking=paper.lacking)


def _drawn(paper: _Paper, page: ReportPage, pictures: Mapping[str, bytes], *, made_s: float) -> bytes:
    paper.set_creation_date(datetime.fromtimestamp(made_s, UTC))
    paper.set_title(f"Report {page.mission_id}")
    paper.set_lang("en")
    paper.add_page()
    _summary(paper, page)
    _goal(paper, page)
    _stages(paper, page)
    _said(paper, "Findings: the analysis's word (declared)", page.findings)
    _pictures(paper, page, pictures)
    _said(paper, "Receipts: a service's word, not a measurement (declared)", page.receipts)
    _deeds(paper, page)
    if paper.lacking:
        paper.title_line("What could not be printed", size=10)
        paper.paragraph(
            f"{paper.lacking} signs are drawn as {MISSING}: this document's font has no Chinese and no symbols beyond "
            "European scripts. The report in the console and its JSON hold them all."
        )
    return bytes(paper.output())


def _summary(paper: _Paper, page: ReportPage) -> None:
    paper.title_line(f"Report: {page.head.goal}", size=15)
    paper.paragraph(f"{words(page.head.status)}. {page.head.sentence}")
    starts = (
        "the robot's journal cannot be read from here"
        if page.starts is None
        else f"{page.starts} by the robot's own journal, {page.duplicates} repeated"
    )
    facts = (
        ("mission", f"{page.mission_id}, {page.head.template} on {page.head.robot_id}"),
        ("configuration", page.head.configuration),
        ("began", f"{instant(page.head.began_s)}, {duration(page.head.elapsed_s)} of mission time"),
        ("physical starts", starts),
        ("disputed acceptances", "\n".join(f"{one.who}: {one.text}" for one in page.disputes) or "none"),
        ("stands at", f"event {page.position}, {page.digest}"),
    )
    paper.ln(2)
    paper.rows(("fact", "value"), facts, (22, 78))
    paper.ln(1)
    paper.paragraph(LABELS)


def _goal(paper: _Paper, page: ReportPage) -> None:
    paper.title_line(f"Goal: {page.verdict or 'not tested'}")
    paper.paragraph(page.reason)
    for one in page.conditions:
        measured = ", ".join(f"{m.name} {m.value or 'not measured'}" for m in one.measures)
        paper.paragraph(f"{one.verdict}: {one.text}{f' ({measured})' if measured else ''}")


def _stages(paper: _Paper, page: ReportPage) -> None:
    paper.title_line("Stages")
    body = [
        (
            f"{stage.title}\n{stage.status}",
            "\n".join(f"{one.name} {one.value}" for one in stage.declared) or "nothing",
            "\n".join(f"{one.name} {one.value}" for one in stage.measured) or "nothing",
            stage.accepted.text,
        )
        for stage in page.stages
    ]
    paper.rows(("stage", "declared", "measured", "accepted"), body, (20, 26, 30, 24))
    paper.title_line("Timings, mission time (measured)")
    took = [
        (
            words(one.node_id),
            clock(one.dispatched_s) if one.dispatched_s is not None else "",
            clock(one.accepted_s) if one.accepted_s is not None else "never",
            duration(one.took_s) if one.took_s is not None else "",
            str(one.attempts),
        )
        for one in page.timings
    ]
    paper.rows(("stage", "dispatched", "accepted", "took", "attempts"), took, (32, 18, 18, 18, 14))


def _said(paper: _Paper, title: str, said: Sequence[Word]) -> None:
    paper.title_line(title)
    if not said:
        paper.paragraph("None.")
        return
    body = [
        (f"{one.kind}\n{words(one.node_id)}", one.text or "no text", f"{one.source}\n{one.receipt_id}", clock(one.at_s))
        for one in said
    ]
    paper.rows(("what", "says", "by", "at"), body, (18, 44, 26, 12))


def _pictures(paper: _Paper, page: ReportPage, pictures: Mapping[str, bytes]) -> None:
    paper.title_line("Pictures")
    if not page.pictures:
        paper.paragraph("No camera frame belongs to this mission's evidence.")
    for index, one in enumerate(page.pictures):
        caption = f"{words(one.node_id)} {clock(one.at_s)} UTC, sha256 {one.blob[:16]}"
        if one.blob not in pictures:
            paper.paragraph(f"{caption}: not shown, {one.broken or 'its bytes are not here'}")
            continue
        left = index % 2 == 0
        if left and paper.will_page_break(62):
            paper.add_page()
        top = paper.get_y()
        try:
            info = paper.image(BytesIO(pictures[one.blob]), x=None if left else MARGIN_MM + 94, w=PICTURE_MM)
        except (OSError, ValueError) as error:
            raise PictureUnreadable(
                f"Picture {one.blob[:12]} cannot be drawn: {error}",
                where=page.mission_id,
                do="see the printable report",
            ) from error
        paper.set_font(FONT, size=7)
        paper.set_xy(MARGIN_MM if left else MARGIN_MM + 94, top + info.rendered_height + 0.5)
        paper.cell(PICTURE_MM, 3.5, paper.spoken(f"{caption}, verified"))
        paper.set_font(FONT, size=9)
        last = index == len(page.pictures) - 1
        paper.set_xy(MARGIN_MM, top if left and not last else top + info.rendered_height + 6)


def _deeds(paper: _Paper, page: ReportPage) -> None:
    paper.title_line("What people decided and recovery spent")
    if page.deeds:
        paper.rows(("at", "who", "what"), [(clock(one.at_s), one.who, one.text) for one in page.deeds], (14, 26, 60))
    else:
        paper.paragraph("Nobody had to decide anything and recovery spent nothing.")
