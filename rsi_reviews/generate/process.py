"""Runs a generator in a process of its own, which can read its records and nothing that judges it (R168).

It gets the records, the current version and a budget on standard input, an environment without anything of the harness
but the model's endpoint, and the right to read the program's own files and no others.
"""

import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import msgspec

import rsi_reviews.generate
from harness.contracts.configuration import Configuration
from harness.contracts.errors import ContractInvalid, HarnessError, StoreUnavailable
from harness.contracts.reasons import Explanation, because
from harness.contracts.values import Value, decode, encode
from rsi_reviews.contracts import Candidate
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.generate.errors import ModelSilent
from rsi_reviews.generate.interface import GenerationBudget
from rsi_reviews.generate.trace import Trace

LONGEST_S = 900.0
NEEDED = ("PATH", "LANG", "LC_ALL", "SSL_CERT_FILE", "SSL_CERT_DIR", "HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY")
MODEL = "REGEN_MODEL"
GeneratorName = Literal["miner", "model"]


class GenerationRequest(Value):
    """What a generator's process is given. `unreadable` are paths that it must not be able to read, and tries to."""

    generator: GeneratorName
    trace: Trace
    current: Configuration
    budget: GenerationBudget
    unreadable: tuple[str, ...]


class GenerationProblem(Value):
    """A typed error of the generator, as it comes back."""

    code: str
    what: Explanation
    where: Explanation = ""
    do: Explanation = ""
    rule: str = ""


class GenerationAnswer(Value):
    """What comes back: candidates, or why there are none; and what the process saw of the world.

    `environment` are the names of its variables, `unreadable` the paths that it tried to read and could not.
    """

    candidates: tuple[Candidate, ...] = ()
    problem: GenerationProblem | None = None
    environment: tuple[str, ...] = ()
    unreadable: tuple[str, ...] = ()


_ERRORS: dict[str, type[HarnessError]] = {kind.code: kind for kind in (ContractInvalid, ModelSilent, StoreUnavailable)}


def generated_apart(
    generator: GeneratorName,
    trace: Trace,
    current: Configuration,
    budget: GenerationBudget,
    *,
    unreadable: Sequence[Path],
    given: Mapping[str, str],
) -> GenerationAnswer:
    """The candidates of a generator that ran confined. `unreadable`: the data folder, and the evaluator's;
    `given`: the environment of the person who asks, of which it gets a part.

    Raises what the generator raises, and StoreUnavailable where it cannot be confined or does not answer.
    """
    request = GenerationRequest(
        generator=generator,
        trace=trace,
        current=current,
        budget=budget,
        unreadable=tuple(str(path.absolute()) for path in unreadable),
    )
    answer = _answered(request, environment(given))
    if answer.problem is not None:
        raise _raised(answer.problem)
    return answer


def environment(whole: Mapping[str, str]) -> dict[str, str]:
    """The variables that a generator's process gets: of the harness's own only those that name the model."""
    return {name: value for name, value in whole.items() if name in NEEDED or name.startswith(MODEL)}


def _answered(request: GenerationRequest, given: Mapping[str, str]) -> GenerationAnswer:
    root = Path(next(iter(rsi_reviews.generate.__path__))).parents[1]
    command = [sys.executable, "-m", "rsi_reviews.generate"]
    try:
        done = subprocess.run(
            command,
            input=encode(request),
            capture_output=True,
            cwd=root,
            env=dict(given),
            timeout=LONGEST_S,
            check=False,
        )
        return decode(done.stdout, GenerationAnswer)
    except subprocess.TimeoutExpired as error:
        raise _silent(because("generator_late", within_s=LONGEST_S)) from error
    except msgspec.MsgspecError as error:
        errors = done.stderr.decode(errors="replace").strip().splitlines()
        raise _silent(errors[-1][:300] if errors else str(error)) from error


def _silent(why: Explanation) -> StoreUnavailable:
    return StoreUnavailable(
        because("generator_without_answer", why=why),
        where="regen rsi generate",
    )


def _raised(problem: GenerationProblem) -> HarnessError:
    if problem.code == CandidateInvalid.code:
        return CandidateInvalid(problem.what, rule=problem.rule, where=problem.where, do=problem.do)
    return _ERRORS.get(problem.code, ContractInvalid)(problem.what, where=problem.where, do=problem.do)
