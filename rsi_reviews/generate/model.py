"""Generates candidates by a language model, which reads counts of what missions recorded and answers with one change as
JSON.

Any endpoint of the chat-completions protocol works. Its answer is data from outside: one JSON object of one shape, or a
typed refusal. No text that a mission, a provider or a person wrote is sent to it. Needs the extra `models`.
"""

import asyncio
from pathlib import Path
from typing import Annotated

import msgspec
from openai import AsyncOpenAI
from pydantic import Field, SecretStr
from pydantic_ai import Agent
from pydantic_ai.exceptions import AgentRunError, UserError
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.providers.openai import OpenAIProvider
from pydantic_settings import BaseSettings, SettingsConfigDict

from harness.contracts.configuration import Configuration
from harness.contracts.errors import ContractInvalid, StoreUnavailable
from harness.contracts.reasons import because
from harness.contracts.values import Value, encode
from harness.recovery.policy import check_policy
from rsi_reviews.contracts import Author, Candidate
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.generate.answer import ANSWER_SHAPE, read_answer
from rsi_reviews.generate.changes import candidate
from rsi_reviews.generate.errors import ModelSilent
from rsi_reviews.generate.interface import GenerationBudget
from rsi_reviews.generate.summary import TraceSummary, summary
from rsi_reviews.generate.trace import Trace
from rsi_reviews.static_check import objections

NO_KEY = "none"
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
        """The key; a placeholder where none is needed. Raises StoreUnavailable if its file cannot be read."""
        if self.model_key_file is None:
            return self.model_key.get_secret_value() or NO_KEY
        try:
            return self.model_key_file.read_text(encoding="utf-8").strip() or NO_KEY
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
        change = read_answer(self._ask(encode(prompt_of(trace, current)).decode()), current, trace)
        found = candidate(change, current, author=Author(name=self.name, kind="optimiser"))
        refused = objections(found, current)
        if refused:
            raise CandidateInvalid(refused[0].reason, rule=refused[0].rule, where=refused[0].path, do="ask again")
        _check(found.configuration)
        return () if found.configuration.configuration_id in budget.seen else (found,)

    def _ask(self, question: str) -> str:
        client = AsyncOpenAI(
            base_url=self._settings.model_url,
            api_key=self._settings.key(),
            timeout=self._settings.model_timeout_s,
            max_retries=0,
        )
        model = OpenAIChatModel(self._settings.model, provider=OpenAIProvider(openai_client=client))
        agent: Agent[None, str] = Agent(
            model, output_type=str, instructions=INSTRUCTIONS, retries=0, deps_type=type(None)
        )
        try:
            return asyncio.run(agent.run(question)).output
        except (AgentRunError, UserError) as error:
            raise ModelSilent(
                f"The model gave no answer: {type(error).__name__}: {str(error)[:200]}",
                where=self._settings.model_url,
                do="look at the endpoint, then ask again",
            ) from error


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
