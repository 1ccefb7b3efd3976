"""Writes a mission's signed dossier with its report as PDF beside the log, for people who have no console."""

from pathlib import Path

from app.background.mission_history import Histories
from app.i18n.languages import CHOICE
from app.settings import ConsoleSettings
from app.views import report
from app.views.evidence import checked
from app.views.marked_pictures import marked_pictures
from app.views.report import ReportSources
from app.views.shell import NOBODY
from app.web.report_pdf import report_pdf
from harness.adapters.clock import SystemClock
from harness.contracts.dossier import REPORT, DossierContents
from harness.contracts.ids import Digest, MissionId
from harness.dossiers import export_dossier
from harness.runtime import Runtime


def export_with_report(
    runtime: Runtime, mission_id: MissionId, file: Path, *, data: Path, exported_by: str
) -> DossierContents:
    """The report is in the language of whoever asks. Raises UnknownName, StoreUnavailable."""
    attached = {REPORT: _report(runtime, mission_id)}
    return export_dossier(runtime, mission_id, file, data=data, exported_by=exported_by, attached=attached)


def _report(runtime: Runtime, mission_id: MissionId) -> bytes:
    entries = Histories(runtime).of(mission_id)
    broken = {blob: checked(runtime.blob, Digest(blob)) for blob, _, _ in report.pictures(entries)}
    page = report.report_page(
        NOBODY,
        runtime.mission(mission_id),
        entries,
        ReportSources(starts=None, duplicates=None),
        broken,
        marked=marked_pictures(entries, runtime.blob),
    )
    pictures = {one.blob: runtime.blob(Digest(one.blob)) for one in page.pictures if not one.broken}
    fonts = ConsoleSettings.model_fields["static"].default / "vendor"
    return report_pdf(
        page, pictures, fonts=fonts, made_s=SystemClock().now().wall_s, language=CHOICE.get().language
    ).body
