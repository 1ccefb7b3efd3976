"""Runs a question that nobody answers, in a process that a fail-point kills, or in the one that continues after it.

python -m tests.builders.killed_retreat expire LOG FAILPOINT   ask, let the time run out, go on to the end
python -m tests.builders.killed_retreat resume LOG             go on from the log; print what was started and told
"""

import json
import sys
from pathlib import Path

from harness.contracts.control import CONTROL
from harness.contracts.handoff_events import NoAnswerTaken
from harness.contracts.ids import ResourceId, leased
from harness.projections.control import SiteControl
from tests.builders.missions_run import ROBOT
from tests.builders.retreating import LATE_S, retreating_site, sent, unanswered
from tests.builders.waiting import Waiting, waiting


def expire(log: Path, failpoint: str) -> None:
    with unanswered(log=log, failpoint=failpoint) as asked:
        asked.pass_s(LATE_S)
        asked.run()
        show(asked)


def resume(log: Path) -> None:
    with waiting(site=retreating_site(), log=log, journals=log.with_suffix(".robot")) as made:
        made.mission_id = made.runtime.missions()[0].mission_id
        made.handoff_id = made.runtime.handoffs()[0].handoff_id
        made.harness.clock.wait_until(made.harness.clock.now().mission_s + 15.0)
        made.supervisor.finish_unanswered(ROBOT)
        made.pass_s(LATE_S)
        made.run()
        show(made)


def show(asked: Waiting) -> None:
    control: SiteControl = asked.runtime.fold(CONTROL)
    retreat = control.retreats.get(ROBOT)
    told = [event for event in asked.told if isinstance(event, NoAnswerTaken)]
    shown = {
        "starts": len(sent(asked)),
        "outcome": retreat.status if retreat else "",
        "done": [one.done for one in told],
        "lease": asked.runtime.lease(leased(ROBOT, ResourceId("mobile_base"))).status,
        "mission": asked.mission.status,
    }
    print(json.dumps(shown))


if __name__ == "__main__":
    act, file, *point = sys.argv[1:]
    expire(Path(file), point[0]) if act == "expire" else resume(Path(file))
