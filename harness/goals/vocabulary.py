"""Checks a contract against the capability types that are declared at its site (D54). Pure."""

from collections.abc import Iterator, Sequence

from harness.contracts.capabilities import RISKS, CapabilityType, Vocabulary
from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import Reason, because
from harness.contracts.tasks import Node, TaskContract
from harness.contracts.values import Value

LATER = "_from"
"""The end of a parameter's name whose value is bound at dispatch."""


class VocabularyProblem(Value):
    """One thing that a stage asks of a capability and its type does not declare. `path` is within the stage."""

    node_id: str
    path: tuple[str | int, ...]
    reason: Reason


def check_vocabulary(contract: TaskContract, vocabulary: Vocabulary) -> None:
    """Raise ContractInvalid for the first stage whose capabilities are not declared, or not for what it asks."""
    for one in problems(contract.nodes, vocabulary):
        raise ContractInvalid(one.reason, where=".".join(["nodes", one.node_id, *map(str, one.path)]))


def problems(nodes: Sequence[Node], vocabulary: Vocabulary) -> Iterator[VocabularyProblem]:
    """Everything that stages ask and the vocabulary does not declare."""
    for node in nodes:
        for place, name in enumerate(node.capabilities):
            declared = vocabulary.of(name)
            where: tuple[str | int, ...] = ("capabilities", place)
            if declared is None:
                unknown = because("capability_undeclared", capability=name, known=vocabulary.names)
                yield VocabularyProblem(node_id=node.node_id, path=where, reason=unknown)
            elif declared.estimates:
                yield VocabularyProblem(
                    node_id=node.node_id, path=where, reason=because("capability_only_estimates", capability=name)
                )
            else:
                yield from _problems(node, declared)


def _problems(node: Node, declared: CapabilityType) -> Iterator[VocabularyProblem]:
    name, parameters = declared.name, {one.name for one in declared.parameters}
    for key in node.parameters:
        if key.removesuffix(LATER) not in parameters and key not in parameters:
            reason = because("capability_without_parameter", capability=name, parameter=key, known=tuple(parameters))
            yield VocabularyProblem(node_id=node.node_id, path=("parameters", key), reason=reason)
    for place, condition in enumerate(node.success_conditions):
        if condition.effect.predicate not in declared.effects:
            reason = because(
                "capability_without_effect",
                capability=name,
                condition_id=condition.condition_id,
                predicate=condition.effect.predicate,
                known=declared.effects,
            )
            path = ("success_conditions", place, "effect", "predicate")
            yield VocabularyProblem(node_id=node.node_id, path=path, reason=reason)
    if RISKS.index(node.risk) < RISKS.index(declared.risk):
        reason = because("stage_risk_understated", capability=name, risk=node.risk, least=declared.risk)
        yield VocabularyProblem(node_id=node.node_id, path=("risk",), reason=reason)
