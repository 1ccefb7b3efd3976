"""Runs cases on a Ray cluster: the same jobs, with the same results for the same seeds. Needs the extra `ray`."""

import socket
from collections.abc import Sequence
from traceback import walk_tb

import msgspec
import ray
from ray._private.node import Node

from harness.contracts.reasons import because
from harness.contracts.simulation import Simulator
from harness.contracts.values import encode
from rsi_reviews.contracts import CaseResult
from rsi_reviews.regression import executors
from rsi_reviews.regression.errors import WorkersLost

LOCAL = "local"
STARTS = 3
"""How often an own node is started: Ray gives one up whose agents take more than 15 s to start, as they do at first on
a slow or busy machine, where their modules are not compiled yet (ray-project/ray#65983)."""
KNOCK_S = 5.0
HTTP2_HELLO = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
"""The client's preface and its empty SETTINGS frame (RFC 9113, section 3.4): a cluster's head node speaks gRPC."""
SETTINGS_FRAME = 4


def answered(body: bytes, simulator: Simulator) -> bytes:
    """One job as JSON in, its results as JSON out: what a remote worker runs."""
    return encode(executors.run_job(msgspec.json.decode(body, type=executors.Job), simulator))


class RayCluster:
    """`address`: `local` starts a cluster on `cpus` cores and ends it; any other address is an existing cluster
    to join.
    """

    def __init__(
        self, address: str, simulator: Simulator, *, cpus: int = 2, longest_s: float = executors.LONGEST_CASE_S
    ) -> None:
        self._simulator = simulator
        self._address, self._cpus, self._longest_s = address, cpus, longest_s

    def run(self, jobs: Sequence[executors.Job]) -> executors.Running:
        """Results as tasks finish, in no order. Raises WorkersLost if the cluster cannot be reached or loses tasks."""
        parts = [
            executors.Job(configuration=job.configuration, cases=job.cases[begin : begin + executors.CHUNK])
            for job in jobs
            for begin in range(0, len(job.cases), executors.CHUNK)
        ]
        self._join()
        try:
            task = ray.remote(answered).options(max_retries=2)
            running = [task.remote(encode(part), self._simulator) for part in parts]
            while running:
                done, running = ray.wait(running, num_returns=1, timeout=self._longest_s * executors.CHUNK)
                if not done:
                    raise WorkersLost(because("cluster_silent"), where=self._address)
                yield msgspec.json.decode(ray.get(done[0]), type=tuple[CaseResult, ...])
        except ray.exceptions.RayError as error:
            raise WorkersLost(because("cluster_lost_task", error=str(error)), where=self._address) from error
        finally:
            ray.shutdown()

    def _join(self) -> None:
        own = self._address == LOCAL
        for left in reversed(range(STARTS if own else 1)):
            try:
                self._knock()
                ray.init(
                    address=self._address,
                    num_cpus=self._cpus if own else None,
                    include_dashboard=False if own else None,
                    log_to_driver=False,
                    configure_logging=False,
                )
                return
            except Exception as error:  # Ray raises a bare Exception for a node that does not come up
                _end_given_up(error)
                if not left:
                    raise WorkersLost(because("cluster_unreachable", error=str(error)), where=self._address) from error

    def _knock(self) -> None:
        """Checks that something at the port speaks gRPC: Ray waits minutes for a cluster that is not there."""
        host, _, port = self._address.removeprefix("ray://").rpartition(":")
        if not (host and port.isdigit()):
            return
        with socket.create_connection((host, int(port)), timeout=KNOCK_S) as connection:
            connection.sendall(HTTP2_HELLO)
            frame = connection.recv(9, socket.MSG_WAITALL)
        if len(frame) < 9 or frame[3] != SETTINGS_FRAME:
            raise ConnectionError("what answers at this port is not a Ray cluster")


def _end_given_up(error: Exception) -> None:
    """End the processes of a node that Ray gave up: it leaves them running, and only the traceback knows the node."""
    for frame, _ in walk_tb(error.__traceback__):
        node = frame.f_locals.get("self")
        if isinstance(node, Node):
            node.kill_all_processes(check_alive=False, wait=True)
