"""Defines the errors of a regression run, as one branch of the harness's error tree.

HarnessError
├── SuiteInvalid        a suite file breaks a rule of its format
│   ├── SuiteShrunk     a newer version lacks a case that an older one has
│   └── SuiteEdited     a version that was registered has other contents now
├── ResultsDamaged      a kept result cannot be read, or belongs to another evaluation
├── WorkersLost         workers could not start, died, or fell silent
└── LookTaken           the candidate has had its one held-out look
"""

from harness.contracts.errors import HarnessError


class SuiteInvalid(HarnessError):
    """A suite file breaks a rule of its format."""

    code = "suite_invalid"


class SuiteShrunk(SuiteInvalid):
    """A newer version of a suite lacks a case that an older one has."""

    code = "suite_shrunk"


class SuiteEdited(SuiteInvalid):
    """A registered version of a suite has other contents now."""

    code = "suite_edited"


class ResultsDamaged(HarnessError):
    """Kept results cannot be read, or were made by another evaluator."""

    code = "results_damaged"


class WorkersLost(HarnessError):
    """Workers could not start, died, or stopped answering; finished cases are kept."""

    code = "workers_lost"


class LookTaken(HarnessError):
    """A candidate gets one held-out look (D32)."""

    code = "look_taken"
