"""Compiles C3 for a packet and has it judged, also where its executions exceed the context's budget."""

from msgspec.structs import replace

from harness.contexts.verifier import verifier_context
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.contexts import Blobs, Context
from harness.contracts.errors import ContextOverflow
from harness.contracts.evidence import EvidencePacket
from harness.contracts.verdicts import NodeVerdict
from harness.projections.mission import Mission
from harness.supervisor.roles import RoleContexts
from harness.verification.verdict import Verifier, judged


def judgement(
    roles: RoleContexts, mission: Mission, packet: EvidencePacket, *, card: CapabilityCard
) -> tuple[Context, NodeVerdict]:
    """The packet's C3 and the verifier's verdict. `card` is of the provider that was asked, whoever replied.

    After many attempts at one stage the executions a packet cites can exceed C3's budget. Then the packet is shown
    alone and not judged: half of the evidence gives no verdict, so it is ambiguous and a person is asked. Raises
    ContextOverflow if not even the packet alone fits.
    """
    view = roles.view(mission)
    try:
        whole = verifier_context(view, packet, card)
    except ContextOverflow as error:
        alone = verifier_context(view, replace(packet, cites=()), card)
        return alone, judged(alone, roles.runtime.blob, verifier=_refusing(error))
    return whole, judged(whole, roles.runtime.blob, verifier=roles.connection.verifier)


def _refusing(error: ContextOverflow) -> Verifier:
    def refuse(context: Context, blobs: Blobs) -> NodeVerdict:
        raise error

    return refuse
