"""Generates candidates by a language model, which reads counts of what missions recorded and answers with one change as
JSON.

It asks through the model port, like every other role. The answer is data from outside: one JSON object of one shape, or
a typed refusal. No text that a mission, a provider or a person wrote is sent to it.
"""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import msgspec
from pydantic import Field, SecretStr
from pydantic_settings import BaseSettings, SettingsConfigDict

from harness.contracts.configuration import Configuration
from harness.contracts.errors import ContractInvalid, ModelAnswerInvalid, ModelFailed, StoreUnavailable
from harness.contracts.models import MOST_TOKENS, ModelEndpoint, question
from harness.contracts.reasons import because
from harness.contracts.values import Value, encode
from harness.recovery.policy import check_policy
from harness.workspace.model_ports import open_model
from rsi_reviews.contracts import Author, Candidate
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.generate.answer import ANSWER_SHAPE, ModelAnswer, change_of
from rsi_reviews.generate.changes import candidate
from rsi_reviews.generate.errors import ModelSilent
from rsi_reviews.generate.interface import GenerationBudget
from rsi_reviews.generate.summary import TraceSummary, summary
from rsi_reviews.generate.trace import Trace
from rsi_reviews.static_check import objections

RULES = {
    "model_answer_not_json": "not_json",
    "model_answer_too_long": "too_large",
    "model_answer_nested": "too_large",
}
"""Which rule of candidates an unusable answer breaks; every other one is `wrong_type`."""
INSTRUCTIONS = f"""You tune the recovery of a robot's task harness. You are given counts of what missions recorded and
the tunable part of the present configuration. Propose exactly one change that should lower the recovery cost: spends
count 1, each question to a person counts 8. A ladder is climbed one rung per failure and must end in "human", once;
after switch_skill nothing may follow but human. Never touch unsafe_action, outcome_unknown or cancel_unacknowledged.
Answer with one JSON object and nothing else, of this shape: {ANSWER_SHAPE}"""


class ModelSettings(BaseSettings):
    """Which endpoint, from `REGEN_MODEL_URL`, `REGEN_MODEL` and, if it wants one, a key from `REGEN_MODEL_KEY` or
    from the file `REGEN_MODEL_KEY_FILE`."""

    model_config = SettingsConfigDict(env_prefix="REGEN_", frozen=True, extra="ignore", protected_namespaces=())

    model_url: str = ""
    model: str = ""
    model_key: SecretStr = SecretStr("")
    model_key_file: Path | None = None
    model_timeout_s: Annotated[float, Field(gt=0, le=600)] = 60.0

    def key(self) -> str:
        """The key; empty where none is needed. Raises StoreUnavailable if its file cannot be read."""
        if self.model_key_file is None:
            return self.model_key.get_secret_value()
        try:
            return self.model_key_file.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise StoreUnavailable(
                because("model_key_unreadable"),
                where=str(self.model_key_file),
            ) from error

    def secret(self) -> SecretStr:
        """The key, read now: the process that uses it cannot open the file any more."""
        return SecretStr(self.key())


class ModelPrompt(Value):
    """Everything the model is shown."""

    records: TraceSummary
    ladders: dict[str, tuple[str, ...]]
    wait_s: float
    weights: dict[str, float]
    timeouts_s: dict[str, dict[str, float]]


class ModelGenerator:
    """Implements `Generator` through one endpoint."""

    def __init__(self, settings: ModelSettings) -> None:
        """Raises ContractInvalid where no endpoint or no model is named."""
        if not settings.model_url or not settings.model:
            raise ContractInvalid(
                because("no_model_named"),
                where="settings",
            )
        self.name = f"model:{settings.model}"[:200]
        self._settings = settings

    def propose(self, trace: Trace, current: Configuration, budget: GenerationBudget) -> tuple[Candidate, ...]:
        """At most one candidate: one question, one answer, no second try.

        Raises ModelSilent if no answer came, CandidateInvalid with the rule for an answer that cannot be taken.
        """
        change = change_of(self._ask(encode(prompt_of(trace, current)).decode()), current, trace)
        found = candidate(change, current, author=Author(name=self.name, kind="optimiser"))
        refused = objections(found, current)
        if refused:
            raise CandidateInvalid(refused[0].reason, rule=refused[0].rule, where=refused[0].path)
        _check(found.configuration)
        return () if found.configuration.configuration_id in budget.seen else (found,)

    def _ask(self, text: str) -> ModelAnswer:
        endpoint = ModelEndpoint(
            name="generator",
            base_url=self._settings.model_url,
            model=self._settings.model,
            timeout_s=self._settings.model_timeout_s,
            max_tokens=MOST_TOKENS,
            retries=0,
            answers="json_object",
        )
        request = question("candidate_generator", instructions=INSTRUCTIONS, text=text)
        try:
            with ExitStack() as stack:
                return open_model(endpoint, self._settings.key(), stack=stack).ask(request, ModelAnswer).value
        except ModelAnswerInvalid as error:
            unknown = "unknown field" in str(error.reason.facts.get("error", ""))
            rule = "unknown_key" if unknown else RULES.get(error.reason.code, "wrong_type")
            raise CandidateInvalid(error.reason, rule=rule, where="model's answer") from error
        except ModelFailed as error:
            raise ModelSilent(error.reason, where=self._settings.model_url) from error


def prompt_of(trace: Trace, current: Configuration) -> ModelPrompt:
    """What a model may know: counts, and the tunable part of H. No text of a mission, no suite, no seed."""
    weights: dict[str, float] = msgspec.to_builtins(current.routing)
    return ModelPrompt(
        records=summary(trace),
        ladders={failure: tuple(ladder) for failure, ladder in current.recovery.ladders.items()},
        wait_s=current.recovery.wait_s,
        weights=weights,
        timeouts_s={
            template.name: {str(node["node_id"]): float(node["timeout_s"]) for node in template.nodes}
            for template in current.templates
        },
    )


def _check(configuration: Configuration) -> None:
    try:
        check_policy(configuration.recovery)
    except ContractInvalid as error:
        raise CandidateInvalid(error.what, rule="ladder_end", where=error.where, do=error.do) from error
