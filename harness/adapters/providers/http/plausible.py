"""Checks what types cannot express of a robot's answer: how many items it lists, and whether its numbers are finite."""

import math
from collections.abc import Iterable

import msgspec
from msgspec.structs import replace

from harness.contracts.errors import ProviderFailed
from harness.contracts.protocol import InvocationReport, Observations, Receipt, StackGoals
from harness.contracts.reasons import because, plain
from harness.provider_protocol.wire import trusted

MOST_RECEIPTS = 256
MOST_FIGURES = 256
MOST_TEXT = 10_000
MOST_LISTED = 20_000
LARGEST = 1e12
"""No coordinate, time, speed or count is larger: seconds since 1970 are a few thousand million."""
LARGEST_SEQ = 1 << 53


def check_batch(batch: Observations, *, limit: int) -> None:
    """Raises ProviderFailed for more samples than were asked for, and for figures that no sensor has."""
    if len(batch.samples) > limit:
        raise ProviderFailed(because("too_many_of", what="samples", limit=limit), where="/observations")
    _figures((batch.at_s,), where="/observations")
    for sample in batch.samples:
        if sample.seq > LARGEST_SEQ:
            raise ProviderFailed(because("figure_out_of_range", figure=f"{sample.seq:.3g}"), where="/observations")
        _figures(
            (value for value in msgspec.structs.astuple(sample) if isinstance(value, float)), where="/observations"
        )


def check_stack_goals(goals: StackGoals, *, limit: int) -> StackGoals:
    """The changes. Raises ProviderFailed for more than were asked for, figures that cannot be, and another order."""
    where = "/stack/goals"
    if len(goals.changes) > limit:
        raise ProviderFailed(because("too_many_of", what="changes", limit=limit), where=where)
    _figures((goals.at_s, float(goals.next_seq)), where=where)
    for one in goals.changes:
        _figures((one.at_s, *(one.target_m or ())), where=where)
    numbers = [one.seq for one in goals.changes]
    if numbers != sorted(set(numbers)) or any(one > goals.next_seq for one in numbers):
        raise ProviderFailed(because("stack_changes_unordered"), where=where)
    return goals


def check_report(report: InvocationReport) -> InvocationReport:
    """The report, with a reason that nobody knows as text. Raises ProviderFailed for lists that are too long and for
    figures that cannot be."""
    where = "invocation"
    lengths = {
        "receipts": (len(report.receipts), MOST_RECEIPTS),
        "declared": (len(report.declared), MOST_FIGURES),
        "samples": (len(report.samples), MOST_LISTED),
        "blobs": (len(report.blobs), MOST_LISTED),
        "message": (len(plain(report.message)), MOST_TEXT),
        "failure": (len(report.failure), MOST_TEXT),
        "progress": (len(plain(report.progress.text)), MOST_TEXT),
    }
    for what, (length, limit) in lengths.items():
        if length > limit:
            raise ProviderFailed(because("too_many_of", what=what, limit=limit), where=where)
    _figures((report.at_s, report.progress.share, report.progress.remaining_m or 0.0), where=where)
    _figures(report.declared.values(), where=where)
    for receipt in report.receipts:
        _receipt(receipt, where=where)
    progress = replace(report.progress, text=trusted(report.progress.text))
    return replace(report, message=trusted(report.message), progress=progress)


def _receipt(receipt: Receipt, *, where: str) -> None:
    if len(receipt.values) > MOST_FIGURES or len(receipt.text) > MOST_TEXT:
        raise ProviderFailed(because("too_many_of", what="receipt", limit=MOST_FIGURES), where=where)
    _figures((receipt.at_s, *receipt.values.values()), where=where)


def _figures(values: Iterable[float], *, where: str) -> None:
    for value in values:
        if not math.isfinite(value) or abs(value) > LARGEST:
            raise ProviderFailed(because("figure_out_of_range", figure=f"{value:.3g}"), where=where)
