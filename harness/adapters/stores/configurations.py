"""Finds configuration versions by digest: those this release ships, and every one recorded in the log (R155)."""

from collections.abc import Callable, Iterable

import msgspec

from harness.contracts.configuration import Configuration
from harness.contracts.configuration_record import configuration_record
from harness.contracts.errors import ConfigurationMissing, LogDamaged, UnknownName
from harness.contracts.ids import Digest, RobotId
from harness.contracts.ports import EventStore, Record
from harness.contracts.reasons import because
from harness.contracts.values import decode


def nothing_selected(robot_id: RobotId) -> Digest | None:
    """No release moved the pointer: every robot works under the configuration it was started with."""
    return None


def nothing_on_trial(configuration_id: Digest) -> bool:
    """No release is in canary."""
    return False


class StoredConfigurations:
    """Versions are immutable, so each is read and decoded once.

    `first` is what robots work under until `selected` names another version; `shipped` are known without the log;
    `on_trial` returns the version in canary.
    """

    def __init__(
        self,
        store: EventStore,
        *,
        first: Configuration,
        shipped: Iterable[Configuration] = (),
        selected: Callable[[RobotId], Digest | None] = nothing_selected,
        on_trial: Callable[[Digest], bool] = nothing_on_trial,
    ) -> None:
        self.on_trial = on_trial
        self._store = store
        self._first = first.configuration_id
        self._selected = selected
        self._shipped = {one.configuration_id: one for one in (first, *shipped)}
        self._read: dict[Digest, Configuration] = {}

    def current_id(self, robot_id: RobotId) -> Digest:
        """What a release pointed this robot at, else the first version."""
        return self._selected(robot_id) or self._first

    def current(self, robot_id: RobotId) -> Configuration:
        """Raises ConfigurationMissing as `get` does."""
        return self.get(self.current_id(robot_id))

    def get(self, configuration_id: Digest) -> Configuration:
        """The version as this release reads it. Fields that a newer release added have their defaults.

        Raises ConfigurationMissing if it is not stored, was changed, or cannot be read by this release.
        """
        found = self._shipped.get(configuration_id) or self._read.get(configuration_id)
        if found is None:
            found = self._read[configuration_id] = _readable(self._stored(configuration_id))
        return found

    def record(self, configuration_id: Digest) -> Record:
        """The bytes whose digest is the id. Raises ConfigurationMissing."""
        if configuration_id in self._shipped:
            return configuration_record(self._shipped[configuration_id])
        return self._stored(configuration_id)

    def _stored(self, configuration_id: Digest) -> Record:
        try:
            return self._store.record(configuration_id)
        except UnknownName as error:
            raise ConfigurationMissing(
                because("configuration_missing", configuration_id=configuration_id[:12]),
                where=because("at_record", digest=configuration_id),
            ) from error
        except LogDamaged as error:
            raise ConfigurationMissing(
                because("configuration_damaged", configuration_id=configuration_id[:12], error=error.reason),
                where=because("at_record", digest=configuration_id),
            ) from error


def _readable(record: Record) -> Configuration:
    try:
        return decode(record.body, Configuration)
    except msgspec.DecodeError as error:
        raise ConfigurationMissing(
            because("configuration_unreadable", digest=record.digest[:12], error=str(error)),
            where=because("at_record", digest=record.digest),
        ) from error
