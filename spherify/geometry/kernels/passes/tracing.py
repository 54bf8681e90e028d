"""Functions that are traced into machine code.

A compiler that is given loops over arrays decides by itself what stays in a register. Here the code says so: a traced
function is plain Python over the values of `wide`, run once while numba compiles what calls it; what it computes
becomes LLVM's vector instructions, in the order it was written down.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar, cast

from llvmlite import ir
from numba import types as _types
from numba.core import cgutils as _cgutils
from numba.extending import intrinsic

from spherify.geometry.kernels.passes.wide import DOUBLE, INTEGER, Array, Place, Row, Truth, Wide, spread

T = TypeVar("T")
types: Any = _types  # their attributes are made when they are imported
cgutils: Any = _cgutils


def either(condition: Truth, then: Callable[[], Wide], otherwise: Callable[[], Wide]) -> Wide:
    """Do one or the other, for all lanes."""
    builder = condition.builder
    results = []
    with builder.if_else(condition.value) as blocks:
        for block, work in zip(blocks, (then, otherwise), strict=True):
            with block:
                results.append((work().value, builder.block))
    joined = builder.phi(results[0][0].type)
    for result in results:
        joined.add_incoming(*result)
    return Wide(builder, joined)


def alternatively(condition: Truth, then: Callable[[], None], otherwise: Callable[[], None]) -> None:
    """Do one or the other."""
    with condition.builder.if_else(condition.value) as blocks:
        for block, work in zip(blocks, (then, otherwise), strict=True):
            with block:
                work()


def repeated(times: Place, begin: T, once: Callable[[Place, T], T]) -> T:
    """Return what comes of doing something to tuples (of tuples) of numbers, again and again.

    Args:
        times: how often; it is done once if that is 0.
        begin: what the first time is given.
        once: what is done, given how often it was done before, and what came of it.

    """
    builder = times.builder
    before, loop, behind = (builder.block, *(builder.append_basic_block() for _ in range(2)))
    builder.branch(loop)
    builder.position_at_end(loop)
    round_ = builder.phi(INTEGER)
    phis = [builder.phi(leaf.value.type) for leaf in _leaves(begin)]
    here = Place(builder, round_)
    end = once(here, _rebuilt(begin, iter(phis)))
    following = here + 1
    again = following < times
    for phi, first, next_ in zip(phis, _leaves(begin), _leaves(end), strict=True):
        phi.add_incoming(first.value, before)
        phi.add_incoming(next_.value, builder.block)
    round_.add_incoming(ir.Constant(INTEGER, 0), before)
    round_.add_incoming(following.value, builder.block)
    builder.cbranch(again.value, loop, behind)
    builder.position_at_end(behind)
    return end


def _leaves(tree: object) -> list[Wide | Row | Place]:
    """Return the numbers of tuples of tuples, one after another."""
    return (
        [leaf for branch in tree for leaf in _leaves(branch)]
        if isinstance(tree, tuple)
        else [cast(Wide | Row | Place, tree)]
    )


def _rebuilt(like: Any, leaves: Iterator[Any]) -> Any:  # noqa: ANN401 - whatever tuples
    """Return tuples of the same form of other numbers."""
    if not isinstance(like, tuple):
        return type(like)(like.builder, next(leaves))
    branches = [_rebuilt(branch, leaves) for branch in like]
    return type(like)(*branches) if hasattr(like, "_fields") else tuple(branches)


def traced(body: Callable[..., Place | None], *, apart: bool = False) -> Callable[..., Any]:
    """Make a function over arrays, numbers and places one that compiled passes can call; it is put where it is called.

    ``body`` is given an `Array` for each array, a `Wide` of eight equal numbers for each float, a `Place` for each
    integer, a tuple of such for each tuple; it may return a `Place`, which is an unsigned integer for the caller.

    Args:
        body: what is run once to say what the code does.
        apart: whether it is a function of its own, called. Many long ones within one are slower, and take longer to
            compile, for each has to find its registers among the others.

    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ANN401 - numba's own types
        values = _flattened(context, builder, signature.args[0], arguments[0])
        if not apart:
            return _result(body(*_operands(builder, signature.args[0], iter(values))))
        function = ir.Function(
            builder.module,
            ir.FunctionType(INTEGER, [value.type for value in values]),
            builder.module.get_unique_name(body.__qualname__),
        )
        function.linkage = "internal"
        function.attributes.add("noinline")
        within = ir.IRBuilder(function.append_basic_block())
        within.ret(_result(body(*_operands(within, signature.args[0], iter(function.args)))))
        return builder.call(function, values)

    def typed(_context: Any, *kinds: Any) -> Any:  # noqa: ANN401 - as above
        return types.uint64(types.StarArgTuple(kinds)), generate

    return cast(Callable[..., Any], intrinsic(typed))


def _result(result: Place | None) -> Any:  # noqa: ANN401 - LLVM's own type
    return ir.Constant(INTEGER, 0) if result is None else result.value


def _flattened(context: Any, builder: Any, kind: Any, argument: Any) -> list[Any]:  # noqa: ANN401 - as above
    """Return what is behind an argument of numba's: addresses, doubles, integers."""
    if isinstance(kind, types.BaseTuple):
        parts = zip(kind, cgutils.unpack_tuple(builder, argument), strict=True)
        return [value for part in parts for value in _flattened(context, builder, *part)]
    if isinstance(kind, types.Array):
        return [context.make_array(kind)(context, builder, argument).data]
    return [
        argument if isinstance(kind, types.Float) else context.cast(builder, argument, kind, types.uint64)
    ]


def _operands(builder: Any, kind: Any, values: Iterator[Any]) -> Any:  # noqa: ANN401 - as above
    """Return what a traced function is given for an argument of that kind."""
    if isinstance(kind, types.BaseTuple):
        parts = [_operands(builder, part, values) for part in kind]
        return kind.instance_class(*parts) if isinstance(kind, types.BaseNamedTuple) else tuple(parts)
    if isinstance(kind, types.Array):
        return Array(builder, next(values))
    if isinstance(kind, types.Float):
        return Wide(builder, spread(builder, next(values), DOUBLE))
    return Place(builder, next(values))
