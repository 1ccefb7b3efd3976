"""Reads the changes of a stack's goals to the last one, page by page."""

from msgspec.structs import replace

from harness.contracts.ports import DecidesItself
from harness.contracts.protocol import MOST_CHANGES, StackGoals

MOST_PAGES = 20


def all_changes(robot: DecidesItself, first: StackGoals) -> StackGoals:
    """The newest answer, with every change since the one before `first`; of another run where the stack restarts."""
    found, changes = first, first.changes
    for _ in range(MOST_PAGES):
        if len(found.changes) < MOST_CHANGES or found.run != first.run:
            break
        found = robot.stack_goals(changes[-1].seq, MOST_CHANGES)
        changes += found.changes
    return replace(found, changes=changes)
