"""Shapes the list of all evidence, and one blob with every packet that refers to it."""

from collections.abc import Sequence
from dataclasses import dataclass

from app.views import list_params
from app.views.evidence import Unsound
from app.views.forms import Wrong
from app.views.marked_pictures import MarkedPicture
from app.views.measurement_drawing import MeasurementDrawing
from app.views.shell import Shell
from harness.contracts.read_models import EvidenceItem, FacetCount, ListQuery

PATH = "/evidence"
FILTERS: tuple[tuple[str, str], ...] = (
    ("kind", "kind"),
    ("source", "source"),
    ("node", "stage"),
    ("verdict", "verdict"),
    ("decision", "gate"),
)


@dataclass(frozen=True)
class EvidencePage:
    """One page of the list; search, filters, order and place stand in the address."""

    shell: Shell
    rows: tuple[EvidenceItem, ...]
    filters: tuple[list_params.Filter, ...]
    paging: list_params.Paging
    words: str
    mission: str
    everything: str
    total: int


@dataclass(frozen=True)
class BlobPage:
    """One blob: whether its bytes match its digest at this moment, who refers to it, and the form that erases it.

    `drawing` shows the samples it holds, if it holds any. `erasable`: it is a photograph or a voice, and whoever looks
    may have it erased. `marked`: what the newest analysis found in it, if it is a picture.
    """

    shell: Shell
    blob: str
    broken: Unsound | None
    size: int
    media_type: str
    rows: tuple[EvidenceItem, ...]
    erasable: bool
    drawing: MeasurementDrawing | None = None
    wrong: tuple[Wrong, ...] = ()
    marked: MarkedPicture | None = None


def evidence_page(
    shell: Shell,
    params: list_params.ListParams,
    rows: Sequence[EvidenceItem],
    following: ListQuery | None,
    *,
    found: int,
    tallies: Sequence[FacetCount],
) -> EvidencePage:
    """`found` counts the answer up to MANY + 1; `tallies` are those of the whole list."""
    filters = tuple(list_params.facet_filter(name, title, tallies, params) for name, title in FILTERS)
    return EvidencePage(
        shell=shell,
        rows=tuple(rows),
        filters=(*filters, list_params.order_filter(params, by_length=False)),
        paging=list_params.paging(PATH, params, following, count=len(rows), found=found),
        words=params.words,
        mission=params.given.get("mission", ""),
        everything=list_params.address(PATH, params.params, mission=""),
        total=next((one.count for one in tallies if not one.facet), 0),
    )
