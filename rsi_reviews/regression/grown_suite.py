"""Combines the shipped suite with the cases that people added to it on this site. Pure."""

from rsi_reviews.regression.cases import CaseGroup, Situation, Suite
from rsi_reviews.regression.suite import grown
from rsi_reviews.suite_growth import Growth


def with_growth(suite: Suite, growth: Growth) -> Suite:
    """The suite, one version higher for each added case, with every existing case. Raises SuiteShrunk otherwise."""
    for one in growth.added:
        case = one.case
        situation = Situation(family=case.family, template=case.template, faults=case.faults)
        suite = grown(suite, CaseGroup(situation=situation, first_seed=case.seed, seeds=1))
    return suite
