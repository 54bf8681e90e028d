"""Where the threads of a team wait for each other within machine code.

Handing out each pass by itself costs two awakenings, some 50 µs each on a virtual machine: as much as the pass over
twenty thousand vertices.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from spherify.geometry.kernels.passes.jit import inner
from spherify.geometry.kernels.passes.tracing import traced
from spherify.geometry.kernels.passes.types import Buffers, Task
from spherify.geometry.kernels.passes.wide import INTEGER, Array, Place

ARRIVED, ROUND, SIZE = 0, 8, 16  # places of an array, a cache line apart
PATIENCE = 1024  # looks, some 20 µs, before the processor is offered to whoever else wants it


@traced
def wait_for_all(meeting: Array, parts: Place) -> None:
    """Return when so many threads have come here as there are parts; what they wrote before is seen by all then.

    Args:
        meeting: (SIZE,) integers, all 0 before the first time.
        parts: how many threads.

    """
    builder = meeting.builder
    arrived, round_ = meeting.at(ARRIVED).data, meeting.at(ROUND).data
    here = builder.load_atomic(round_, "acquire", 8)
    before = builder.atomic_rmw("add", arrived, ir.Constant(INTEGER, 1), "acq_rel")
    is_last = builder.icmp_unsigned("==", builder.add(before, ir.Constant(INTEGER, 1)), parts.value)
    with builder.if_else(is_last) as (last, others):
        with last:
            builder.store_atomic(ir.Constant(INTEGER, 0), arrived, "release", 8)
            builder.atomic_rmw("add", round_, ir.Constant(INTEGER, 1), "acq_rel")
        with others:
            _look(builder, round_, here)


@inner
def meet(use: Buffers, task: Task) -> None:
    """Wait until all threads have come here."""
    if task.parts > 1:
        wait_for_all(use.meeting, task.parts)


def _look(builder: Any, round_: Any, here: Any) -> None:  # noqa: ANN401 - LLVM's own types
    """Look again and again until it is another round."""
    begin = builder.block
    again, offer, behind = (builder.append_basic_block() for _ in range(3))
    builder.branch(again)
    builder.position_at_end(again)
    looks = builder.phi(INTEGER)
    looks.add_incoming(ir.Constant(INTEGER, 1), begin)
    now = builder.load_atomic(round_, "acquire", 8)
    further = builder.add(looks, ir.Constant(INTEGER, 1))
    patient = builder.icmp_unsigned(
        "!=", builder.urem(looks, ir.Constant(INTEGER, PATIENCE)), ir.Constant(INTEGER, 0)
    )
    wait = builder.append_basic_block()
    builder.cbranch(builder.icmp_unsigned("!=", now, here), behind, wait)
    builder.position_at_end(wait)
    builder.cbranch(patient, again, offer)
    looks.add_incoming(further, wait)
    builder.position_at_end(offer)
    module = builder.module
    yield_ = module.globals.get("sched_yield")
    if yield_ is None:
        yield_ = ir.Function(module, ir.FunctionType(ir.IntType(32), []), "sched_yield")
    builder.call(yield_, [])
    builder.branch(again)
    looks.add_incoming(further, offer)
    builder.position_at_end(behind)
