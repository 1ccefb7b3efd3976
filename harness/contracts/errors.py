"""The tree of errors that the harness raises, each with what happened, where, and what to do.

HarnessError                 something went wrong that a person can act on
├── ContractInvalid          a task contract, template, place or parameter breaks a rule
│   ├── GoalNotUnderstood    words of a goal are unread; a person may confirm what was read (D41)
│   ├── ReadingStale         the reading that was confirmed is not the one that the goal has now
│   └── Unsatisfiable        a condition that no stage and no verifier could ever show to hold
├── UnknownName              no template, place, provider, mission or handoff of that name
├── OnlyObserved             a robot in shadow mode is not commanded by this harness
├── ConfigurationMissing     a configuration version is not stored here, or this release cannot read it
├── ConcurrencyConflict      somebody else appended to the stream first
├── StoreUnavailable         the data folder or database cannot be used as it is
│   ├── StoreOwned           another supervisor owns the data folder
│   └── StoreNewer           the database was written by a newer version
├── LogDamaged               the hash chain or a stored row does not verify
├── BlobDamaged              a blob's bytes do not match its digest, or it is missing
│   └── BlobGone             a blob was erased on request or by the retention rule
├── ContextOverflow          mandatory records exceed a role's budget
├── ProviderFailed           a provider refused or broke the protocol
│   ├── ProviderUnreachable  no answer: the request may or may not have arrived
│   └── FencingRefused       the provider saw a newer fencing token
├── ModelFailed              a model was not asked, or gave nothing that can be used
│   ├── ModelUnreachable     no whole answer came from its endpoint
│   └── ModelAnswerInvalid   its answer is too large, cut off, no JSON or of another shape
├── BackupInvalid            a backup is incomplete, or a file in it does not match its digest
├── CloudInvalid             a point cloud file is of another format, truncated or empty
├── DossierInvalid           a dossier's signature, a file in it or its chain does not verify
└── RecordingInvalid         a recording cannot be read: truncated, empty, of another encoding

A refusal is not an error: it is a value (`decisions.Refused`).

An error that a person may read carries a reason, a code with facts; its sentence and what to do about it stand in the
app's tables by that code. `str(error)` is for logs and exceptions: code and facts, in no language.
"""

from harness.contracts.ids import Digest
from harness.contracts.models import ModelUse
from harness.contracts.readings import ReadingQuestion
from harness.contracts.reasons import Explanation, Reason, because, plain, recorded


class HarnessError(Exception):
    """Something went wrong. `what` happened, and `where`: a path, a field or a name, or a reason that says so in words.

    `do` is what to do now, where it does not follow from the code of `what`. Text is shown unchanged: what another
    program said, or what only a developer reads.
    """

    code = "harness_error"

    def __init__(self, what: Explanation, *, where: Explanation = "", do: Explanation = "") -> None:
        parts = (plain(what), where and f"Where: {plain(where)}", plain(do))
        super().__init__(". ".join(part.rstrip(".") for part in parts if part) + ".")
        self.what, self.where, self.do = what, where, do

    @property
    def reason(self) -> Reason:
        """What happened, as events and refusals keep it."""
        return self.what if isinstance(self.what, Reason) else recorded(self.what)

    @property
    def located(self) -> Reason:
        """What happened and where, as reports and findings keep it."""
        return because("happened_at", reason=self.reason, where=self.where) if self.where else self.reason


class ContractInvalid(HarnessError):
    code = "contract_invalid"


class GoalNotUnderstood(ContractInvalid):
    """`question` is what the person is asked: the text, its nearest reading, and what is unread."""

    code = "goal_not_understood"

    def __init__(
        self, what: Explanation, *, question: ReadingQuestion, where: Explanation = "", do: Explanation = ""
    ) -> None:
        super().__init__(what, where=where, do=do)
        self.question = question


class ReadingStale(ContractInvalid):
    code = "reading_stale"


class RecordingUnusable(ContractInvalid):
    """A recording of a goal that is no sound, too long, or says nothing."""

    code = "recording_unusable"


class Unsatisfiable(ContractInvalid):
    code = "unsatisfiable"


class UnknownName(HarnessError):
    code = "unknown_name"


class OnlyObserved(HarnessError):
    code = "robot_only_observed"


class ConfigurationMissing(HarnessError):
    code = "configuration_missing"


class ConcurrencyConflict(HarnessError):
    code = "concurrency_conflict"


class StoreUnavailable(HarnessError):
    code = "store_unavailable"


class StoreBusy(StoreUnavailable):
    """Another process held the store for longer than a write waits: nothing of this write was stored."""


class StoreOwned(StoreUnavailable):
    code = "store_owned"


class StoreNewer(StoreUnavailable):
    code = "store_newer"


class LogDamaged(HarnessError):
    code = "log_damaged"


class BlobDamaged(HarnessError):
    code = "blob_damaged"


class BlobGone(BlobDamaged):
    code = "blob_erased"


class ContextOverflow(HarnessError):
    code = "context_overflow"


class ProviderFailed(HarnessError):
    code = "provider_failed"


class DeliveryUnknown(ProviderFailed):
    """A message that may have been sent, and that the channel cannot be asked for: it is never sent again by itself."""

    code = "delivery_unknown"


class ChannelRefused(ProviderFailed):
    """The channel's service would not take a message: nothing was sent."""

    code = "channel_refused"


class ChannelUnreachable(ProviderFailed):
    """The channel's service was not reached, or is busy: nothing was sent, and it can be tried again."""

    code = "channel_unreachable"


class ProviderUnreachable(ProviderFailed):
    code = "provider_unreachable"


class FencingRefused(ProviderFailed):
    code = "fencing_refused"


class ModelFailed(HarnessError):
    """`use` is what is kept of the exchange; None where nothing was asked."""

    code = "model_failed"

    def __init__(
        self,
        what: Explanation,
        *,
        where: Explanation = "",
        do: Explanation = "",
        use: ModelUse | None = None,
    ) -> None:
        super().__init__(what, where=where, do=do)
        self.use = use

    @property
    def exchange(self) -> Digest | None:
        """The digest of the exchange's record."""
        return self.use.exchange if self.use else None


class ModelUnreachable(ModelFailed):
    code = "model_unreachable"


class ModelAnswerInvalid(ModelFailed):
    code = "model_answer_invalid"


class BackupInvalid(HarnessError):
    code = "backup_invalid"


class CloudInvalid(HarnessError):
    code = "cloud_invalid"


class DossierInvalid(HarnessError):
    code = "dossier_invalid"


class RecordingInvalid(HarnessError):
    code = "recording_invalid"
