"""Acts on admissions: record what the conformance kit found at a robot's address."""

from typing import Annotated, Any

import msgspec
from pydantic import Field

from app.acts import base
from harness.conformance.findings import ConformanceResult
from harness.contracts.admissions import MOST_PROVIDERS, CheckedProvider, RecordCheck
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import sha256
from harness.contracts.reasons import because
from harness.contracts.values import digest, encode


class RecordCheckAct(base.Act):
    """The kit's findings as `regen provider check --site` sends them; `stands_clear`: a person said that it does."""

    becomes = RecordCheck
    address: Annotated[str, Field(min_length=1, max_length=300)]
    findings: Annotated[list[dict[str, Any]], Field(min_length=1, max_length=MOST_PROVIDERS)]
    stands_clear: bool = False
    reason: base.Reason

    def result(self) -> bytes:
        """Every row and what was observed, as it is kept. Raises ContractInvalid for what is no finding."""
        return encode(self._checked())

    def fields(self) -> dict[str, Any]:
        """Raises ContractInvalid for what is no finding."""
        return {
            "address": self.address,
            "checked": tuple(_summary(one) for one in self._checked()),
            "result": sha256(self.result()),
            "stands_clear": self.stands_clear,
            "reason": self.reason,
        }

    def _checked(self) -> tuple[ConformanceResult, ...]:
        try:
            return msgspec.convert(self.findings, tuple[ConformanceResult, ...])
        except msgspec.ValidationError as error:
            raise ContractInvalid(because("findings_unreadable", error=str(error)[:200]), where="findings") from error


def _summary(checked: ConformanceResult) -> CheckedProvider:
    return CheckedProvider(
        provider_id=checked.provider_id,
        version=checked.version,
        capability=checked.card.capability,
        card=digest(checked.card),
        moves=checked.card.moves,
        met=checked.rows("met"),
        not_met=checked.rows("not met"),
        exempt=checked.rows("exempt"),
    )
