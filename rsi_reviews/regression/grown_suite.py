"""Pure: the shipped suite with the cases that persons added to it in this place."""

from rsi_reviews.regression.cases import CaseGroup, Situation, Suite
from rsi_reviews.regression.suite import grown
from rsi_reviews.suite_growth import Growth


def with_growth(suite: Suite, growth: Growth) -> Suite:
    """A version higher for each added case; every case there was is still there. Raises SuiteShrunk otherwise."""
    for one in growth.added:
        case = one.case
        situation = Situation(family=case.family, template=case.template, faults=case.faults)
        suite = grown(suite, CaseGroup(situation=situation, first_seed=case.seed, seeds=1))
    return suite
