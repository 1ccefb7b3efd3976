"""A generator's process: reads its request, gives up every other file, proposes, and answers on standard output."""

import os
import sys
from pathlib import Path

from harness.contracts.errors import HarnessError, StoreUnavailable
from harness.contracts.reasons import because
from harness.contracts.values import decode, encode
from rsi_reviews.errors import CandidateInvalid
from rsi_reviews.generate.confinement import confine
from rsi_reviews.generate.interface import Generator
from rsi_reviews.generate.miner import TraceMiner
from rsi_reviews.generate.model import ModelGenerator, ModelSettings
from rsi_reviews.generate.process import GenerationAnswer, GenerationProblem, GenerationRequest, GeneratorName

SYSTEM = ("/usr", "/lib", "/lib64", "/etc", "/dev/urandom", "/dev/null")
"""What a Python program with a network client may need to read later: libraries, certificates, names of hosts."""


def main() -> int:
    """Answer one request."""
    request = decode(sys.stdin.buffer.read(), GenerationRequest)
    sys.stdout.buffer.write(encode(_answer(request)))
    return 0


def _answer(request: GenerationRequest) -> GenerationAnswer:
    try:
        generator = _generator(request.generator)
        confine(_program(), connects=request.generator == "model")
        _refuse_readable(request.unreadable)
        candidates = generator.propose(request.trace, request.current, request.budget)
    except HarnessError as error:
        rule = error.rule if isinstance(error, CandidateInvalid) else ""
        problem = GenerationProblem(code=error.code, what=error.what, where=error.where, do=error.do, rule=rule)
        return GenerationAnswer(problem=problem)
    names = tuple(sorted(os.environ))
    return GenerationAnswer(candidates=candidates, environment=names, unreadable=request.unreadable)


def _generator(name: GeneratorName) -> Generator:
    if name == "miner":
        return TraceMiner()
    settings = ModelSettings()
    return ModelGenerator(settings.model_copy(update={"model_key": settings.secret(), "model_key_file": None}))


def _program() -> tuple[Path, ...]:
    """The program's own folders: the interpreter, its libraries, and the two packages that a generator is made of."""
    root = Path(__file__).resolve().parents[2]
    own = (root / "harness", root / "rsi_reviews", Path(sys.prefix), Path(sys.base_prefix))
    return (*own, *map(Path, SYSTEM))


def _refuse_readable(paths: tuple[str, ...]) -> None:
    """Try what must fail. Raises StoreUnavailable where it does not."""
    for path in paths:
        try:
            os.listdir(path) if os.path.isdir(path) else Path(path).read_bytes()
        except OSError:
            continue
        raise StoreUnavailable(because("generator_not_blind"), where=path)


if __name__ == "__main__":
    sys.exit(main())
