"""Compiles a person's request to the task contract of a mission; equal requests are compiled once."""

from collections.abc import Callable, Mapping, Sequence
from threading import Lock

from cachetools import LRUCache

from harness.contracts import ports
from harness.contracts.capabilities import Vocabulary
from harness.contracts.configuration import Configuration
from harness.contracts.ids import RobotId
from harness.contracts.places import Site
from harness.contracts.rules import RulesVersion
from harness.contracts.tasks import TaskContract, TaskTemplate
from harness.contracts.values import encode
from harness.goals.predicates import with_pins
from harness.goals.reader import GoalReader
from harness.goals.satisfiable import check_sources
from harness.goals.sources import RobotSources
from harness.goals.understanding import GoalRequest, UnderstoodGoal, compiled, read_again, understand
from harness.goals.vocabulary import check_vocabulary

CACHED = 16
"""How many compiled contracts are cached: equal request, templates and site give an equal contract."""


class ContractCompiler:
    """`beside`: the templates that may be started now although no configuration holds them.

    `sources`: what each connected robot can be judged by; nothing is known of a robot without a connection.
    """

    def __init__(
        self,
        *,
        beside: Callable[[], Sequence[TaskTemplate]],
        reader: GoalReader,
        sources: Mapping[RobotId, RobotSources],
        rules: RulesVersion,
        vocabulary: Vocabulary,
        predicates: ports.Predicates,
    ) -> None:
        self._beside, self._reader, self._sources, self._rules = beside, reader, sources, rules
        self._vocabulary, self._predicates = vocabulary, predicates
        self._contracts: LRUCache[bytes, TaskContract] = LRUCache(CACHED)
        self._caching = Lock()

    def contract(
        self,
        request: GoalRequest,
        configuration: Configuration,
        *,
        robot_id: RobotId,
        site: Site,
        instead: TaskTemplate | None = None,
    ) -> TaskContract:
        """The contract that the request would start on this robot; `instead` replaces the template of its name.

        Raises UnknownName (template, place) and ContractInvalid, with GoalNotUnderstood, ReadingStale and Unsatisfiable
        among it.
        """
        contract = self._compiled(request, self._templates(configuration, instead), site)
        return self.checked(contract, robot_id=robot_id, site=site)

    def checked(self, contract: TaskContract, *, robot_id: RobotId, site: Site) -> TaskContract:
        """The contract, where its capabilities are declared and the sources of this robot can show its conditions to
        hold, pinned to the installed predicates that it names. Raises ContractInvalid, Unsatisfiable.
        """
        check_vocabulary(contract, self._vocabulary)
        contract = with_pins(contract, predicates=self._predicates, vouched=site.vouched)
        if robot_id in self._sources:
            check_sources(contract, robot=self._sources[robot_id], site=site, rules=self._rules)
        return contract

    def understood(self, request: GoalRequest, configuration: Configuration, *, site: Site) -> UnderstoodGoal:
        """What the goal of the request means now. Raises as `contract` does."""
        return understand(request, templates=self._templates(configuration, None), site=site, reader=self._reader)

    def again(
        self, contract: TaskContract, configuration: Configuration, *, robot_id: RobotId, site: Site
    ) -> TaskContract | None:
        """A contract's reading compiled under another configuration; None for a contract without a reading (D62).

        Raises as `contract` does.
        """
        templates = self._templates(configuration, None)
        again = read_again(contract, templates=templates, site=site, rules=self._rules)
        return self.checked(again, robot_id=robot_id, site=site) if again is not None else None

    def _templates(self, configuration: Configuration, instead: TaskTemplate | None) -> tuple[TaskTemplate, ...]:
        """What may be started: the configuration's own, then those beside it."""
        own = configuration.templates
        names = {one.name for one in own}
        every = (*own, *(one for one in self._beside() if one.name not in names))
        if instead is None:
            return every
        templates = tuple(instead if one.name == instead.name else one for one in every)
        return templates if instead in templates else (*templates, instead)

    def _compiled(self, request: GoalRequest, templates: tuple[TaskTemplate, ...], site: Site) -> TaskContract:
        arguments = request.arguments or {}
        key = encode((request.text, request.template, request.confirm, templates, arguments, site))
        with self._caching:
            known = self._contracts.get(key)
        if known is None:
            found = understand(request, templates=templates, site=site, reader=self._reader)
            known = compiled(found, templates=templates, site=site, arguments=arguments, rules=self._rules)
            with self._caching:
                self._contracts[key] = known
        return known
