"""Eight numbers at a time: vector registers, arrays and places as values of traced functions; see `tracing`.

All operations are single ones of IEEE 754 and round alike on every machine: nothing is reordered or contracted. On
processors with narrower registers LLVM splits them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias, cast

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import config as _config

LANES: Final = 8  # numbers in the widest register
ROW_BYTES: Final = 32  # which a row begins at a multiple of

Lane: TypeAlias = np.uint64  # for places; what is narrower may wrap around, and what has a sign be negative

DOUBLE, INTEGER, _INDEX = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
FMA_APART: Final = "fma_of_eight"
_DOUBLES, _INTEGERS = ir.VectorType(DOUBLE, LANES), ir.VectorType(INTEGER, LANES)
_ROW = ir.VectorType(DOUBLE, 4)
# Which numbers of two registers make a new one; see `columns` and `across`.
_FIRSTS, _SECONDS = (0, 8, 2, 10, 4, 12, 6, 14), (1, 9, 3, 11, 5, 13, 7, 15)
_EVEN, _ODD = (0, 1, 4, 5, 8, 9, 12, 13), (2, 3, 6, 7, 10, 11, 14, 15)
_LOW, _HIGH = (0, 1, 8, 9, 2, 3, 10, 11), (4, 5, 12, 13, 6, 7, 14, 15)

config: Any = _config  # its attributes are made when it is imported


def has_fma() -> bool:
    """Whether the processor that is compiled for has an instruction for a·b + c, as all but old x86 have."""
    if not llvm.get_process_triple().startswith(("x86_64", "i686", "i386")):
        return True
    if config.CPU_FEATURES is None:
        return bool(llvm.get_host_cpu_features().get("fma"))
    return "+fma" in config.CPU_FEATURES.split(",")


@dataclass(frozen=True, slots=True)
class Place:
    """A place in an array, known when the code runs."""

    builder: Any
    value: Any

    def __add__(self, other: Place | int) -> Place:
        return Place(self.builder, self.builder.add(self.value, _integer(other)))

    def __sub__(self, other: Place | int) -> Place:
        return Place(self.builder, self.builder.sub(self.value, _integer(other)))

    def __or__(self, other: Place | int) -> Place:
        return Place(self.builder, self.builder.or_(self.value, _integer(other)))

    def __mul__(self, other: Place | int) -> Place:
        return Place(self.builder, self.builder.mul(self.value, _integer(other)))

    def divided_by(self, power_of_two: int) -> Place:
        """Return the whole part of the quotient."""
        shift = power_of_two.bit_length() - 1
        return Place(self.builder, self.builder.lshr(self.value, _integer(shift)))

    def wrapped(self, end: Place) -> Place:
        """Return 0 for ``end``, else the same."""
        at_end = self.builder.icmp_unsigned("==", self.value, end.value)
        return Place(self.builder, self.builder.select(at_end, _integer(0), self.value))

    def __gt__(self, other: Place | int) -> Truth:
        return Truth(self.builder, self.builder.icmp_unsigned(">", self.value, _integer(other)))

    def __lt__(self, other: Place | int) -> Truth:
        return Truth(self.builder, self.builder.icmp_unsigned("<", self.value, _integer(other)))


@dataclass(frozen=True, slots=True)
class Truth:
    """A condition, known when the code runs."""

    builder: Any
    value: Any


@dataclass(frozen=True, slots=True)
class Mask:
    """Eight conditions."""

    builder: Any
    value: Any

    def __and__(self, other: Mask) -> Mask:
        return Mask(self.builder, self.builder.and_(self.value, other.value))

    def __or__(self, other: Mask) -> Mask:
        return Mask(self.builder, self.builder.or_(self.value, other.value))

    def __invert__(self) -> Mask:
        return Mask(self.builder, self.builder.not_(self.value))

    def bits(self) -> Place:
        """One bit each, of lane 0 the lowest."""
        narrow = self.builder.bitcast(self.value, ir.IntType(LANES))
        return Place(self.builder, self.builder.zext(narrow, INTEGER))

    def any(self) -> Truth:
        """Whether one of them holds."""
        narrow = self.builder.bitcast(self.value, ir.IntType(LANES))
        return Truth(self.builder, self.builder.icmp_unsigned("!=", narrow, ir.Constant(narrow.type, 0)))


@dataclass(frozen=True, slots=True, eq=False)
class Wide:
    """Eight doubles."""

    builder: Any
    value: Any

    def __add__(self, other: Wide | float) -> Wide:
        return Wide(self.builder, self.builder.fadd(self.value, _doubles(other)))

    def __sub__(self, other: Wide | float) -> Wide:
        return Wide(self.builder, self.builder.fsub(self.value, _doubles(other)))

    def __rsub__(self, other: float) -> Wide:
        return Wide(self.builder, self.builder.fsub(_doubles(other), self.value))

    def __mul__(self, other: Wide | float) -> Wide:
        return Wide(self.builder, self.builder.fmul(self.value, _doubles(other)))

    def __rmul__(self, other: float) -> Wide:
        return Wide(self.builder, self.builder.fmul(_doubles(other), self.value))

    def __truediv__(self, other: Wide | float) -> Wide:
        return Wide(self.builder, self.builder.fdiv(self.value, _doubles(other)))

    def __rtruediv__(self, other: float) -> Wide:
        return Wide(self.builder, self.builder.fdiv(_doubles(other), self.value))

    def __neg__(self) -> Wide:
        return Wide(self.builder, self.builder.fneg(self.value))

    def __abs__(self) -> Wide:
        return self._of("llvm.fabs", self)

    def __lt__(self, other: Wide | float) -> Mask:
        return Mask(self.builder, self.builder.fcmp_ordered("<", self.value, _doubles(other)))

    def __gt__(self, other: Wide | float) -> Mask:
        return Mask(self.builder, self.builder.fcmp_ordered(">", self.value, _doubles(other)))

    def __le__(self, other: Wide | float) -> Mask:
        return Mask(self.builder, self.builder.fcmp_ordered("<=", self.value, _doubles(other)))

    def is_zero(self) -> Mask:
        """Where this is 0."""
        return Mask(self.builder, self.builder.fcmp_ordered("==", self.value, _doubles(0.0)))

    def fma(self, by: Wide | float, plus: Wide | float) -> Wide:
        """Return self·by + plus, rounded once."""
        if has_fma():
            return self._of("llvm.fma", self, by, plus)
        # Eight calls of the C library's, with all else in memory meanwhile: written out at each place they are most of
        # the machine code, which then takes four times as long to make.
        module = self.builder.module
        function = module.globals.get(FMA_APART)
        if function is None:
            function = ir.Function(module, ir.FunctionType(_DOUBLES, [_DOUBLES] * 3), FMA_APART)
            function.linkage = "internal"
            function.attributes.add("noinline")
            within = ir.IRBuilder(function.append_basic_block())
            a, b, c = (Wide(within, argument) for argument in function.args)
            within.ret(a._of("llvm.fma", a, b, c).value)
        return Wide(self.builder, self.builder.call(function, [_doubles(one) for one in (self, by, plus)]))

    def root(self) -> Wide:
        """√."""
        return self._of("llvm.sqrt", self)

    def signed_as(self, other: Wide) -> Wide:
        """Return the same with the sign of the other."""
        return self._of("llvm.copysign", self, other)

    def halved_exponent(self, of: int) -> Wide:
        """Return what the bits ``of`` less half of these bits, as integers, are as a double."""
        bits = self.builder.bitcast(self.value, _INTEGERS)
        half = self.builder.lshr(bits, ir.Constant(_INTEGERS, [1] * LANES))
        difference = self.builder.sub(ir.Constant(_INTEGERS, [of] * LANES), half)
        return Wide(self.builder, self.builder.bitcast(difference, _DOUBLES))

    def _of(self, name: str, *operands: Wide | float) -> Wide:
        name = f"{name}.v{LANES}f64"
        function = self.builder.module.globals.get(name)
        if function is None:
            kind = ir.FunctionType(_DOUBLES, [_DOUBLES] * len(operands))
            function = ir.Function(self.builder.module, kind, name)
        return Wide(self.builder, self.builder.call(function, [_doubles(one) for one in operands]))


@dataclass(frozen=True, slots=True)
class Row:
    """Four doubles that lie side by side: x, y, z and w of one vertex."""

    builder: Any
    value: Any

    def __add__(self, other: Row) -> Row:
        return Row(self.builder, self.builder.fadd(self.value, other.value))


Columns: TypeAlias = tuple[Wide, Wide, Wide, Wide]


@dataclass(frozen=True, slots=True)
class Array:
    """An array of one kind of number, C-contiguous, as long as it may be."""

    builder: Any
    data: Any

    def at(self, place: Place | int) -> Array:
        """Return the array from a place on."""
        return Array(self.builder, self.builder.gep(self.data, [_integer(place)]))

    def load(self, place: Place | int) -> Wide:
        """Read the eight numbers from a place on."""
        pointer = self.builder.bitcast(self.at(place).data, _DOUBLES.as_pointer())
        return Wide(self.builder, self.builder.load(pointer, align=8))

    def store(self, place: Place | int, value: Wide, count: Place | None = None) -> None:
        """Write eight numbers from a place on, or, with ``count``, the first of them."""
        if count is None:
            self.builder.store(
                value.value, self.builder.bitcast(self.at(place).data, _DOUBLES.as_pointer()), align=8
            )
            return
        for lane in range(LANES):
            with self.builder.if_then((count > lane).value):
                number = self.builder.extract_element(value.value, ir.Constant(_INDEX, lane))
                self.builder.store(number, self.at(place + lane).data)

    def fetch(self, place: Place) -> None:
        """Have what lies at a place brought near for writing, if that goes by the way: nothing waits, or fails."""
        byte = ir.IntType(8).as_pointer()
        pointer = self.builder.bitcast(self.at(place).data, byte)
        kind = ir.FunctionType(ir.VoidType(), [byte, _INDEX, _INDEX, _INDEX])
        fetch = self.builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        kinds = [ir.Constant(_INDEX, kind) for kind in (1, 2, 1)]  # to write, to the second-level cache, data
        self.builder.call(fetch, [pointer, *kinds])

    def store_number(self, place: Place, number: Place) -> None:
        """Write an integer of 64 bits."""
        self.builder.store(number.value, self.at(place).data)

    def rows(self, index: Array, place: Place) -> list[Row]:
        """Read the rows of four numbers that the eight indices from a place on name."""
        return [self.row(index.index(place + lane)) for lane in range(LANES)]

    def row(self, number: Place) -> Row:
        """Read the row of that number."""
        pointer = self.builder.bitcast(self.at(number * 4).data, _ROW.as_pointer())
        return Row(self.builder, self.builder.load(pointer, align=ROW_BYTES))

    def index(self, place: Place) -> Place:
        """Read an index of 32 bits."""
        return Place(self.builder, self.builder.zext(self.builder.load(self.at(place).data), INTEGER))

    def store_rows(self, first: Place, rows: Sequence[Row], count: Place | None = None) -> None:
        """Write rows of four numbers from the row of that number on, or the first ``count`` of them."""
        for lane, row in enumerate(rows):
            to = self.builder.bitcast(self.at((first + lane) * 4).data, _ROW.as_pointer())
            if count is None:
                self.builder.store(row.value, to, align=ROW_BYTES)
            else:
                with self.builder.if_then((count > lane).value):
                    self.builder.store(row.value, to, align=ROW_BYTES)


def columns(rows: Sequence[Row]) -> Columns:
    """Return the four columns of eight rows, which are put across each other twice, in pairs of two."""
    builder, values = rows[0].builder, [row.value for row in rows]
    pairs = [_shuffled(builder, (values[i], values[i + 2]), range(LANES)) for i in (0, 1, 4, 5)]
    first = [_shuffled(builder, pairs[i : i + 2], _FIRSTS) for i in (0, 2)]
    second = [_shuffled(builder, pairs[i : i + 2], _SECONDS) for i in (0, 2)]
    x, z = (Wide(builder, _shuffled(builder, first, mask)) for mask in (_EVEN, _ODD))
    y, w = (Wide(builder, _shuffled(builder, second, mask)) for mask in (_EVEN, _ODD))
    return x, y, z, w


def across(columns: Columns) -> list[Row]:
    """Return the eight rows of four columns."""
    builder = columns[0].builder
    x, y, z, w = (column.value for column in columns)
    even = [_shuffled(builder, two, _FIRSTS) for two in ((x, y), (z, w))]
    odd = [_shuffled(builder, two, _SECONDS) for two in ((x, y), (z, w))]
    pairs = [_shuffled(builder, half, mask) for mask in (_LOW, _HIGH) for half in (even, odd)]
    places = ((0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (3, 0), (2, 1), (3, 1))
    return [
        Row(builder, _shuffled(builder, (pairs[pair], pairs[pair]), range(4 * half, 4 * half + 4)))
        for pair, half in places
    ]


def _shuffled(builder: Any, two: Sequence[Any], mask: Sequence[int]) -> Any:  # noqa: ANN401 - LLVM's own types
    """Return numbers of two registers, those of the second counted on."""
    chosen = ir.Constant(ir.VectorType(_INDEX, len(mask)), list(mask))
    return builder.shuffle_vector(*two, chosen)


def where(mask: Mask, then: Wide | float, otherwise: Wide | float) -> Wide:
    """One or the other, lane by lane."""
    return Wide(mask.builder, mask.builder.select(mask.value, _doubles(then), _doubles(otherwise)))


def lesser(one: Wide, other: Wide) -> Wide:
    """Return the lesser of two, lane by lane; the other one where one of them is not a number."""
    return where(one < other, one, other)


def greater(one: Wide, other: Wide) -> Wide:
    """Return the greater of two, lane by lane; the other one where one of them is not a number."""
    return where(one > other, one, other)


def equal(like: Wide, value: float) -> Wide:
    """Return eight equal numbers, for the code that the other number belongs to."""
    return Wide(like.builder, _doubles(value))


def first_lanes(count: Place) -> Mask:
    """Return which lanes are among the first ``count``."""
    builder = count.builder
    counts = spread(builder, count.value, INTEGER)
    lanes = ir.Constant(_INTEGERS, list(range(LANES)))
    return Mask(builder, builder.icmp_unsigned("<", lanes, counts))


def polynomial(coefficients: Sequence[float], x: Wide) -> Wide:
    """Return the value at x, of coefficients from the highest power on."""
    value: Wide | float = coefficients[0]
    for coefficient in coefficients[1:]:
        value = x.fma(value, coefficient)
    return cast(Wide, value)


def spread(builder: Any, value: Any, kind: Any) -> Any:  # noqa: ANN401 - as above
    """Return a register of equal numbers."""
    nothing = ir.Constant(ir.VectorType(kind, LANES), ir.Undefined)
    one = builder.insert_element(nothing, value, ir.Constant(_INDEX, 0))
    return builder.shuffle_vector(one, nothing, ir.Constant(ir.VectorType(_INDEX, LANES), [0] * LANES))


def _doubles(value: Wide | float) -> Any:  # noqa: ANN401 - LLVM's own type
    return value.value if isinstance(value, Wide) else ir.Constant(_DOUBLES, [float(value)] * LANES)


def _integer(value: Place | int) -> Any:  # noqa: ANN401 - as above
    return value.value if isinstance(value, Place) else ir.Constant(INTEGER, value)
