"""Acts on proposed goals: propose one, take one off the list."""

from typing import Annotated, Any

from pydantic import Field, StringConstraints

from app.acts import base
from app.views import forms
from harness.contracts import goal_proposals
from harness.contracts.ids import sha256

GoalWords = Annotated[str, StringConstraints(min_length=1, max_length=forms.GOAL_SIGNS)]


class ProposeGoalAct(base.Act):
    """A goal in words that a person may start. No robot named: the console's first."""

    becomes = goal_proposals.ProposeGoal
    goal: GoalWords
    robot_id: base.Text = ""
    reason: base.Reason = Field(default="proposed from outside")

    def fields(self) -> dict[str, Any]:
        return {"text": self.goal, "reason": self.reason}

    def name_of(self, actor: str, robot_id: str) -> str:
        """The same goal of the same sender for the same robot waits once."""
        return sha256(f"{actor}\n{robot_id}\n{self.goal}".encode())[:16]


class DismissGoalAct(base.Act):
    """Take a proposed goal off the list, with the reason."""

    becomes = goal_proposals.AnswerProposedGoal
    reason: base.Reason

    def fields(self) -> dict[str, Any]:
        return {"answer": "dismissed", "reason": self.reason}
