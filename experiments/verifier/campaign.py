"""Measures the verifier: `python -m experiments.campaigns verifier`. Each predicate against the truth."""

import argparse
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from random import Random

from experiments.campaigns.code import code_digest
from experiments.verifier import floors, messages, motion, outcomes, passages, pictures, speech, stages
from experiments.verifier.cases import VerifierCase
from experiments.verifier.matrix import PredicateCounts, VerifierReport, counted, matrix, offences
from experiments.verifier.page import publish, summary
from harness.contracts.rules import RETIRED
from harness.verification.predicates.registry import PREDICATES
from harness.verification.verdict import Verifier, verify

CASES, SEED = 2000, 1
WHOLE = 1000
"""From so many cases on, the pools are those of the published campaign."""
LEAST_FALSE_SHARE = 0.1
SPARE = 1.3
"""Cases that are epistemic or at a bound do not count: so many times more are drawn."""
MOST_DRAWS = 6


@dataclass(frozen=True)
class Pools:
    """What the simulator, the room and the analyser made once; cases draw from it and add faults."""

    seed: int
    whole: bool

    @cached_property
    def drives(self) -> motion.Drives:
        return motion.drives(self.seed, whole=self.whole)

    @cached_property
    def looks(self) -> pictures.SimulatedLooks:
        return pictures.looks(self.seed, whole=self.whole)

    @cached_property
    def scenes(self) -> tuple[passages.PassageScene, ...]:
        rendered, drawn = (24, 200) if self.whole else (2, 24)
        return passages.scenes(self.seed, rendered=rendered, drawn=drawn)

    @cached_property
    def recordings(self) -> tuple[speech.SpokenReport, ...]:
        return speech.recordings(self.seed, kinds=2 * speech.KINDS if self.whole else speech.FEW)

    @cached_property
    def journals(self) -> tuple[stages.Journal, ...]:
        return stages.journals(self.seed, count=60 if self.whole else 8)

    @cached_property
    def views(self) -> tuple[floors.VisibleCells, ...]:
        return floors.views(self.seed, count=len(floors.PLACES) * (2 if self.whole else 1))

    @cached_property
    def outcomes(self) -> tuple[outcomes.SpokenOutcome, ...]:
        return outcomes.recordings(self.seed, kinds=4 * outcomes.KINDS if self.whole else outcomes.FEW)

    @cached_property
    def files(self) -> list[bytes]:
        """The distinct picture files of the looks."""
        looks = (*self.looks.panoramas, *self.looks.pictures)
        return list({image.blob: run.blobs[image.blob] for run in looks for image in run.images}.values())

    def sizes(self) -> dict[str, int]:
        """How many distinct outputs there are of each expensive source."""
        return {
            "simulated drives": self.drives.distinct,
            "lidar sweeps for headings": self.looks.sweeps,
            "rendered pictures of panoramas and single looks": self.looks.images,
            "passages with things drawn into them": len(self.scenes),
            "of these, rendered and analysed by the shipped analyser": sum(one.rendered for one in self.scenes),
            "reports spoken, recorded and recognised": len(self.recordings) + len(self.outcomes),
            "start journals": len(self.journals),
            "stands with sweeps for maps": len(self.views),
        }


Make = Callable[[Random, int, Pools], Iterator[VerifierCase]]
FAMILIES: dict[str, tuple[tuple[str, ...], Make]] = {
    "standing": (("arrival", "static_body", "inside"), lambda c, n, p: motion.standing(c, n, p.drives)),
    "earlier jumps": ((), lambda c, n, p: motion.earlier_jumps(c, n // 4, p.drives)),
    "steady": (("stable",), lambda c, n, p: motion.steady(c, n, p.drives)),
    "rounds": (("circuit",), lambda c, n, p: motion.rounds(c, n, p.drives)),
    "kept out": (("stayed_out",), lambda c, n, p: motion.kept_out(c, n, p.drives)),
    "aimless": (("arrival_without_target",), lambda c, n, p: motion.aimless(c, n, p.drives)),
    "headings": (("facing",), lambda c, n, p: pictures.headings(c, n, p.looks)),
    "circles": (("panorama",), lambda c, n, p: pictures.circles(c, n, p.looks)),
    "stills": (("pictured",), lambda c, n, p: pictures.stills(c, n, p.looks)),
    "findings": (("sighted",), lambda c, n, p: pictures.findings(c, n, p.looks)),
    "signs": (("shows",), lambda c, n, p: pictures.signs(c, n, p.looks)),
    "passages": (("passage_checked",), lambda c, n, p: passages.passages(c, n, p.scenes)),
    "messages": (("message_stored",), lambda c, n, p: messages.stored_messages(c, n)),
    "requests": (("recorded_request",), lambda c, n, p: messages.requests(c, n)),
    "kept pictures": (("kept_picture",), lambda c, n, p: messages.kept_pictures(c, n, p.files)),
    "same images": (("same_image",), lambda c, n, p: messages.same_images(c, n, p.files)),
    "shared images": (("one_image",), lambda c, n, p: messages.shared_images(c, n, p.files)),
    "reports": (("heard",), lambda c, n, p: speech.reports(c, n, p.recordings)),
    "outcomes": (("outcome_heard",), lambda c, n, p: outcomes.outcomes(c, n, p.outcomes)),
    "orders": (("in_order",), lambda c, n, p: stages.orders(c, n, p.journals)),
    "chains": (("one_chain",), lambda c, n, p: stages.chains(c, n)),
    "subjects": (
        ("one_subject",),
        lambda c, n, p: stages.subjects(c, n, [one for one in p.drives.ways if not one.fault]),
    ),
    "floors": (("covered",), lambda c, n, p: floors.coverages(c, n, p.views)),
}
"""By family of cases: the predicates of which it makes as many cases as are asked, and how."""


def current_predicates() -> tuple[str, ...]:
    """The predicates that a new contract may name, by the registry and the rules."""
    return tuple(name for kind, name in PREDICATES if (kind, name) not in RETIRED)


def measured(
    cases: int,
    *,
    seed: int,
    verifier: Verifier = verify,
    only: Sequence[str] = tuple(FAMILIES),
    say: Callable[[str], None] = lambda line: None,
    pools: Pools | None = None,
) -> VerifierReport:
    """So many cases of each current predicate, judged and counted. `only`: some families of cases. `pools`: those of
    this seed that were made before.
    """
    pools = pools or Pools(seed, whole=cases >= WHOLE)
    counting = counted(_drawn(cases, seed, pools, only, say), verifier=verifier)
    return reported(cases, seed, counting, pools.sizes() if set(only) == set(FAMILIES) else {})


def reported(cases: int, seed: int, counting: Mapping[str, PredicateCounts], sizes: dict[str, int]) -> VerifierReport:
    """The matrices of what was counted, and what must not be in them."""
    found = tuple(matrix(name, counting[name]) for name in current_predicates() if name in counting)
    missing = [f"{name}: no family makes cases of it" for name in current_predicates() if name not in counting]
    wrong = [line for one in found for line in offences(one, cases=cases, false=round(LEAST_FALSE_SHARE * cases))]
    return VerifierReport(cases=cases, seed=seed, pools=sizes, predicates=found, offences=(*missing, *wrong))


def _drawn(
    cases: int, seed: int, pools: Pools, only: Sequence[str], say: Callable[[str], None]
) -> Iterator[VerifierCase]:
    """Of every family so many cases of each of its predicates that have a truth and are not epistemic."""
    for family in only:
        predicates, make = FAMILIES[family]
        say(family)
        left = dict.fromkeys(predicates, cases)
        for turn in range(MOST_DRAWS):
            count = max(left.values(), default=cases if turn == 0 else 0)
            if count <= 0:
                break
            for case in make(Random(f"{seed} {family} {turn}"), round(SPARE * count), pools):
                if case.predicate in left and not case.epistemic and case.true is not None:
                    left[case.predicate] -= 1
                yield case


def run(arguments: argparse.Namespace) -> None:
    """`python -m experiments.campaigns verifier`: print the matrix; publish it if asked. Exit 1 for an offence."""
    code = code_digest("experiments/verifier")
    report = measured(arguments.cases, seed=arguments.seed, say=print)
    print(summary(report))
    if arguments.publish:
        words = ["python", "-m", "experiments.campaigns", "verifier"]
        words += ["--cases", str(arguments.cases), "--seed", str(arguments.seed), "--publish"]
        publish(report, command=shlex.join(words), code=code)
    for line in report.offences:
        print(line)
    if report.offences:
        raise SystemExit(1)
