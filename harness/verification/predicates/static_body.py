"""temporal static_body (D15): at rest over an interval, by odometry or IMU, never by the localiser."""

from harness.contracts.effects import AnyEffect, Temporal
from harness.contracts.reasons import because
from harness.verification.body import static_body as at_rest
from harness.verification.finding import Finding, Undecidable
from harness.verification.reading import Evidence


def static_body(effect: AnyEffect, evidence: Evidence) -> Finding:
    """Displacement below `bound` metres over the last `interval_s` seconds of this execution."""
    if not isinstance(effect, Temporal):
        raise Undecidable(because("effect_not_testable", predicate="static_body"))
    return at_rest(evidence, window_s=effect.interval_s, limit_m=effect.bound)
