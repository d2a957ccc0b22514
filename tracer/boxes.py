"""One ray against the eight boxes of a tree's node, in one go.

A node is 128 bytes, two lines of cache: an origin of three doubles and a scale of three floats;
then the boxes, each side a byte that counts in units of that scale from there, those of the eight
boxes in a row (least x, y and z from LEAST on, most x, y and z from MOST on); and where the eight
children are, as integers in columns LINK and following of the same memory.

A processor tests eight boxes at once, but no loop in Python is compiled to that. So what it is to
do is spelt out here, in LLVM's language. `in_python` says the same in numpy, for readers, for runs
without a compiler, and for a test that compares both to the last bit.

H. Ylitie, T. Karras, S. Laine, Efficient incoherent ray traversal on GPUs through compressed wide
BVHs, 2017, for nodes of eight boxes in bytes.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.np import arrayobj
from numpy.typing import NDArray

from tracer.vector import Vec

_numba: Any = numba  # its own types cover little of it
types, intrinsic = _numba.types, _numba.extending.intrinsic
make_array: Any = arrayobj.make_array
function: Any = _numba.core.cgutils.get_or_insert_function
Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]

WIDTH = 8
NODE, SCALE, LEAST, MOST, LINK = 128, 24, 40, 64, 24  # LINK counts integers, the others bytes
STEPS = 255.0
# Four roundings to single precision stand between a side of a box and its distance: of where the
# origin is, of the scale, of its product with a byte, and of the sum.
ROUNDING = 2.0**-22


def in_python(
    nodes: Bytes, node: int, o: Vec, inverses: Vec, farthest: float, distances: Floats
) -> int:
    """Which boxes of a node the ray meets before `farthest`: bit k is set for box k.

    `distances` gets where it enters each, at most as far as it truly does. Rounding is allowed for,
    so that no box is missed that is met; a distance that overflows to NaN excludes nothing.
    """
    row = nodes[node]
    base = (row[:SCALE].view(np.float64) - o) * inverses
    scale = row[SCALE : SCALE + 12].view(np.float32) * np.array(inverses)
    slack = ROUNDING * (abs(base) + (STEPS + 1.0) * abs(scale))
    least, most = (row[at : at + 24].reshape(3, WIDTH) for at in (LEAST, MOST))
    forwards = np.array(inverses)[:, None] >= 0.0
    single = np.float32
    step = scale.astype(single)[:, None]
    first = np.where(forwards, least, most).astype(single) * step
    last = np.where(forwards, most, least).astype(single) * step
    first += (base - slack).astype(single)[:, None]
    last += (base + slack).astype(single)[:, None]
    enter = first.max(axis=0, where=first > 0.0, initial=0.0)
    beyond = single(farthest * (1.0 + ROUNDING))
    leave = last.min(axis=0, where=last < beyond, initial=beyond)
    distances[:WIDTH] = enter
    return int(np.packbits(enter <= leave, bitorder="little")[0])


FLOAT, DOUBLE, INT, BYTE = ir.FloatType(), ir.DoubleType(), ir.IntType(32), ir.IntType(8)
FABS, PREFETCH = "llvm.fabs.v4f64", "llvm.prefetch.p0"


@intrinsic
def in_machine_code(
    _: Any, nodes: Any, _node: Any, _o: Any, _inverses: Any, _farthest: Any, distances: Any
) -> Any:
    """As `in_python`: the three axes side by side in doubles, then the eight boxes in floats."""
    vec = types.UniTuple(types.float64, 3)
    signature = types.int64(nodes, types.intp, vec, vec, types.float64, distances)
    return signature, _generate


def _generate(context: Any, build: Any, signature: Any, arguments: Any) -> Any:
    nodes, node, o, inverses, farthest, distances = arguments
    row = _place(context, build, signature.args[0], nodes, build.mul(node, _index(NODE)))

    def load(at: Any, kind: Any, lanes: int) -> Any:
        place = build.bitcast(build.gep(row, [at]), ir.VectorType(kind, lanes).as_pointer())
        return build.load(place, align=8)

    def absolute(x: Any) -> Any:
        kind = ir.FunctionType(x.type, [x.type])
        return build.call(function(build.module, kind, FABS), [x])

    def single(x: Any) -> Any:
        return build.fptrunc(x, ir.VectorType(FLOAT, 4))

    def beside(lane: Any, x: Any) -> Any:
        """Eight times one lane of x."""
        return build.shuffle_vector(x, x, ir.Constant(ir.VectorType(INT, WIDTH), [lane] * WIDTH))

    rays, by = _vector(build, o), _vector(build, inverses)
    base = build.fmul(build.fsub(load(_index(0), DOUBLE, 4), rays), by)
    scale = build.fmul(build.fpext(load(_index(SCALE), FLOAT, 4), base.type), by)
    extent = build.fmul(_same(STEPS + 1.0, base.type), absolute(scale))
    slack = build.fmul(_same(ROUNDING, base.type), build.fadd(absolute(base), extent))
    step, near, far = (single(x) for x in (scale, build.fsub(base, slack), build.fadd(base, slack)))
    further = build.fmul(farthest, ir.Constant(DOUBLE, 1.0 + ROUNDING))
    leave = beside(0, build.insert_element(near, build.fptrunc(further, FLOAT), _index(0)))
    enter = _same(0.0, leave.type)
    for axis in range(3):
        forwards = build.fcmp_ordered(">=", build.extract_value(inverses, axis), _zero(DOUBLE))
        sides = [_index(start + WIDTH * axis) for start in (LEAST, MOST)]
        for shift, order in ((near, (0, 1)), (far, (1, 0))):
            at = build.select(forwards, sides[order[0]], sides[order[1]])
            steps = build.zext(load(at, BYTE, WIDTH), ir.VectorType(INT, WIDTH))
            steps = build.fmul(build.sitofp(steps, leave.type), beside(axis, step))
            side = build.fadd(steps, beside(axis, shift))
            if shift is near:
                enter = build.select(build.fcmp_ordered(">", side, enter), side, enter)
            else:
                leave = build.select(build.fcmp_ordered("<", side, leave), side, leave)
    wide = ir.VectorType(DOUBLE, WIDTH)
    into = _place(context, build, signature.args[5], distances, _index(0))
    build.store(build.fpext(enter, wide), build.bitcast(into, wide.as_pointer()), align=8)
    hit = build.bitcast(build.fcmp_ordered("<=", enter, leave), BYTE)
    return build.zext(hit, ir.IntType(64))


def _index(k: int) -> Any:
    return ir.Constant(ir.IntType(64), k)


def _zero(kind: Any) -> Any:
    return ir.Constant(kind, 0.0)


def _same(x: float, kind: Any) -> Any:
    return ir.Constant(kind, [x] * kind.count)


def _vector(build: Any, three: Any) -> Any:
    """A tuple of three as four lanes; what is in the fourth matters to nobody."""
    lanes = _same(0.0, ir.VectorType(DOUBLE, 4))
    for k in range(3):
        lanes = build.insert_element(lanes, build.extract_value(three, k), _index(k))
    return lanes


def _place(context: Any, build: Any, kind: Any, array: Any, at: Any) -> Any:
    """The address `at` bytes behind the start of an array."""
    data = make_array(kind)(context, build, value=array).data
    return build.gep(build.bitcast(data, BYTE.as_pointer()), [at])


@intrinsic
def _prefetched(_: Any, table: Any, _row: Any) -> Any:
    """Asks for the two lines of cache from where a row of `table` begins, without waiting."""

    def generate(context: Any, build: Any, _: Any, arguments: Any) -> Any:
        width = make_array(table)(context, build, value=arguments[0]).strides
        at = build.mul(arguments[1], build.extract_value(width, 0))
        kind = ir.FunctionType(ir.VoidType(), [BYTE.as_pointer(), INT, INT, INT])
        prefetch = function(build.module, kind, PREFETCH)
        for line in (0, 64):
            place = _place(context, build, table, arguments[0], build.add(at, _index(line)))
            build.call(prefetch, [place, *(ir.Constant(INT, k) for k in (0, 3, 1))])
        return context.get_dummy_value()

    return types.void(table, types.intp), generate


@intrinsic
def _counted_zeros(_: Any, _bits: Any) -> Any:
    def generate(_: Any, build: Any, __: Any, arguments: Any) -> Any:
        return build.cttz(arguments[0], ir.Constant(ir.IntType(1), True))

    return types.int64(types.int64), generate


def _first_bit(bits: int) -> int:
    """Of those that are set, of which there is one at least."""
    return (bits & -bits).bit_length() - 1


def _not_prefetched(table: Any, row: int) -> None:
    """There is no way to ask for it."""


_machine = not _numba.config.DISABLE_JIT
meets_boxes = in_machine_code if _machine else in_python
prefetch = _prefetched if _machine else _not_prefetched
first_bit = _counted_zeros if _machine else _first_bit
