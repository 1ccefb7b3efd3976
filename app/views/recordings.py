"""Shapes the page of uploaded files: what is here, what is replayed, and what audits of recordings found."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.i18n.catalogues import N_
from app.i18n.messages import reasoned
from app.views.bag_audits import KINDS, VERDICTS, AuditShown
from app.views.shell import Shell
from app.views.uploaded_files import (
    BUNDLES,
    CHUNK_BYTES,
    CLOUDS,
    FLOOR_IMAGES,
    FLOORS,
    RECORDINGS,
    ReplayJob,
    Upload,
)
from harness.contracts.declared_successes import AuditedRecording, Lack, SuccessVerdict

STATES: Mapping[str, str] = {
    "waiting": N_("waits"),
    "reading": N_("is read and checked"),
    "running": N_("runs"),
    "ended": N_("ended"),
    "refused": N_("could not be replayed"),
    "cancelled": N_("cancelled"),
}
TONES: Mapping[str, str] = {"ended": "good", "refused": "bad", "running": "live", "reading": "live"}


@dataclass(frozen=True)
class ReplayRow:
    """One replay on the page."""

    job: ReplayJob

    @property
    def state(self) -> str:
        """In words."""
        return STATES[self.job.state]

    @property
    def tone(self) -> str:
        """Of its mark."""
        return TONES.get(self.job.state, "plain")

    @property
    def problem(self) -> str:
        """Why there is no mission; empty for none."""
        return reasoned(self.job.problem) if self.job.problem else ""


@dataclass(frozen=True)
class RecordingsPage:
    """`errors` belong to what was just asked; `imported` names the map version that has just got a cloud."""

    shell: Shell
    uploads: tuple[Upload, ...]
    replays: tuple[ReplayRow, ...]
    audits: tuple[AuditShown, ...]
    limit_bytes: int
    map_version: str
    imported: str
    errors: tuple[str, ...] = field(default=())

    @property
    def live(self) -> bool:
        """Whether something on the page moves by itself."""
        return any(row.job.open for row in self.replays)

    @property
    def accepts(self) -> str:
        """Endings of files, for the field that chooses one."""
        return ",".join((*RECORDINGS, *CLOUDS, *BUNDLES, *FLOORS, *FLOOR_IMAGES))

    @property
    def piece_bytes(self) -> int:
        """What one piece may hold."""
        return CHUNK_BYTES

    @property
    def kinds(self) -> Mapping[Lack, str]:
        """Every kind of evidence in words."""
        return KINDS

    @property
    def verdicts(self) -> Mapping[SuccessVerdict, str]:
        """Every verdict on a declared success in words."""
        return VERDICTS

    def problem_of(self, recording: AuditedRecording) -> str:
        """Why a recording could not be read; empty for one that was."""
        return reasoned(recording.problem) if recording.problem else ""
