"""One ray against the eight boxes of a tree's node, in one go.

A node is 128 bytes, two lines of cache: in floats, the corner and the scale of a frame; the boxes
of eight children in that frame, each side a byte that counts in units of the scale from the corner,
those of all eight in a row (least x, y and z from LEAST on, most x, y and z from MOST on); and from
LINK on, in integers, where the children are. All is seen from a centre, which the first node of a
tree has, and how far from there its boxes reach.

What is met becomes a key: in its upper half the bits of where the ray enters, a float that is not
negative, and so in the order of its bits; in the lower half where the child is.

A processor tests eight boxes at once, but no loop in Python is compiled to that. So what it is to
do is spelt out here, in LLVM's language. `in_python` says the same in numpy, for readers, for runs
without a compiler, and for a test that compares both to the last bit.

H. Ylitie, T. Karras, S. Laine, Efficient incoherent ray traversal on GPUs through compressed wide
BVHs, 2017, for nodes of eight boxes in bytes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba.np import arrayobj
from numpy.typing import NDArray

from tracer.compiled import inlined
from tracer.vector import Vec

_numba: Any = numba  # its own types cover little of it
types, intrinsic = _numba.types, _numba.extending.intrinsic
make_array: Any = arrayobj.make_array
function: Any = _numba.core.cgutils.get_or_insert_function
SINGLE: Any = np.float32  # which mypy would not take for a number

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]

WIDTH, NODE, STEPS = 8, 128, 255.0
LEAST, MOST = 24, 48  # columns in bytes; the others are in floats and integers
CORNER, SCALE, CENTER, REACH, LINK = 0, 3, 18, 21, 24


class Sight(NamedTuple):
    """What boxes need to know of a ray, in single precision and from a tree's centre."""

    nearer: Vec  # its origin, moved so far that rounding makes no box's distance too large
    farther: Vec  # or none too small
    inverse: Vec  # of its direction


@inlined
def sight(o: Vec, d: Vec, nodes: Bytes, root: int) -> Sight:
    """A ray as seen from the centre of the tree whose first node is `root`.

    Distances are made of the ray's origin x and of places up to the tree's reach R with up to
    five roundings of |x|, and eleven of R, each by 2^-24 of it. A ray that has left a triangle may
    meet the next one 1e-15 |o| behind its origin.
    """
    singles = nodes.view(np.float32)
    reach = np.float64(singles[root, REACH])
    x, nx, fx = _axis(o[0], d[0], np.float64(singles[root, CENTER]), reach)
    y, ny, fy = _axis(o[1], d[1], np.float64(singles[root, CENTER + 1]), reach)
    z, nz, fz = _axis(o[2], d[2], np.float64(singles[root, CENTER + 2]), reach)
    return Sight((nx, ny, nz), (fx, fy, fz), (x, y, z))


@inlined
def _axis(o: float, d: float, center: float, reach: float) -> tuple[Any, Any, Any]:
    """(1 / d, but finite, so that what is in a box's plane counts as in the box; o moved)."""
    x = o - center
    slack = 2.0**-21 * (abs(x) + 2.0 * reach) + 2.0**-47 * abs(o)
    if d < 0.0:
        slack = -slack
    d = max(d, 1e-18) if d >= 0.0 else min(d, -1e-18)
    return SINGLE(1.0 / d), SINGLE(x + slack), SINGLE(x - slack)


def in_python(nodes: Bytes, node: int, ray: Sight, limit: int, keys: Ints) -> int:
    """Which boxes of a node the ray meets before `limit`: bit k is set for box k.

    `keys` gets the keys of all eight, those that are missed included.
    """
    row = nodes[node]
    frame, links = row.view(np.float32), row.view(np.int32)[LINK:]
    inverse = np.array(ray.inverse, np.float32)
    step = (frame[SCALE : SCALE + 3] * inverse)[:, None]
    corner = frame[CORNER : CORNER + 3]
    near = ((corner - np.array(ray.nearer, np.float32)) * inverse)[:, None]
    far = ((corner - np.array(ray.farther, np.float32)) * inverse)[:, None]
    sides = [row[at : at + 24].reshape(3, WIDTH).astype(np.float32) for at in (LEAST, MOST)]
    forwards = (inverse >= 0.0)[:, None]
    first = np.where(forwards, *sides) * step + near
    last = np.where(forwards, *reversed(sides)) * step + far
    enter = np.maximum(first.max(axis=0), SINGLE(0.0))
    leave = np.minimum(last.min(axis=0), np.int32(limit >> 32).view(np.float32))
    keys[:WIDTH] = enter.view(np.int32).astype(np.int64) << 32 | links.view(np.uint32)
    return int(np.packbits(enter <= leave, bitorder="little")[0])


def limit_in_python(t: float) -> int:
    return int(SINGLE(t * (1.0 + 2.0**-22)).view(np.int32)) << 32 | 0xFFFFFFFF


@inlined
def child_of(key: int) -> int:
    return (key << 32) >> 32


FLOAT, DOUBLE, LONG = ir.FloatType(), ir.DoubleType(), ir.IntType(64)
INT, BYTE = ir.IntType(32), ir.IntType(8)


@intrinsic
def _in_machine_code(_: Any, nodes: Any, _node: Any, ray: Any, _limit: Any, keys: Any) -> Any:
    return types.int64(nodes, types.int64, ray, types.int64, keys), _generate


def _generate(context: Any, build: Any, signature: Any, arguments: Any) -> Any:
    """As `in_python`, the eight boxes side by side."""
    nodes, node, ray, limit, keys = arguments
    row = _place(context, build, signature.args[0], nodes, build.mul(node, _long(NODE)))
    eight = ir.VectorType(FLOAT, WIDTH)

    def load(at: Any, kind: Any) -> Any:
        return build.load(build.bitcast(build.gep(row, [at]), kind.as_pointer()), align=4)

    def beside(x: Any) -> Any:
        """Eight times x."""
        one = build.insert_element(ir.Constant(eight, ir.Undefined), x, _long(0))
        return build.shuffle_vector(one, one, ir.Constant(ir.VectorType(INT, WIDTH), [0] * WIDTH))

    def sides(at: Any) -> Any:
        bytes_ = load(at, ir.VectorType(BYTE, WIDTH))
        return build.sitofp(build.zext(bytes_, ir.VectorType(INT, WIDTH)), eight)

    enter = ir.Constant(eight, [0.0] * WIDTH)
    leave = beside(build.bitcast(build.trunc(build.lshr(limit, _long(32)), INT), FLOAT))
    for axis in range(3):
        nearer, farther, inverse = (
            build.extract_value(build.extract_value(ray, k), axis) for k in range(3)
        )
        forwards = build.fcmp_ordered(">=", inverse, ir.Constant(FLOAT, 0.0))
        least, most = (_long(at + WIDTH * axis) for at in (LEAST, MOST))
        corner, scale = (load(_long(4 * (at + axis)), FLOAT) for at in (CORNER, SCALE))
        step = beside(build.fmul(scale, inverse))
        near = build.fmul(sides(build.select(forwards, least, most)), step)
        near = build.fadd(near, beside(build.fmul(build.fsub(corner, nearer), inverse)))
        far = build.fmul(sides(build.select(forwards, most, least)), step)
        far = build.fadd(far, beside(build.fmul(build.fsub(corner, farther), inverse)))
        enter = build.select(build.fcmp_ordered(">", near, enter), near, enter)
        leave = build.select(build.fcmp_ordered("<", far, leave), far, leave)
    wide = ir.VectorType(LONG, WIDTH)
    bits = build.zext(build.bitcast(enter, ir.VectorType(INT, WIDTH)), wide)
    links = build.zext(load(_long(4 * LINK), ir.VectorType(INT, WIDTH)), wide)
    both = build.or_(build.shl(bits, ir.Constant(wide, [32] * WIDTH)), links)
    into = _place(context, build, signature.args[4], keys, _long(0))
    build.store(both, build.bitcast(into, wide.as_pointer()), align=8)
    return build.zext(build.bitcast(build.fcmp_ordered("<=", enter, leave), BYTE), LONG)


def _long(k: int) -> Any:
    return ir.Constant(LONG, k)


def _place(context: Any, build: Any, kind: Any, array: Any, at: Any) -> Any:
    """The address `at` bytes behind the start of an array."""
    data = make_array(kind)(context, build, value=array).data
    return build.gep(build.bitcast(data, BYTE.as_pointer()), [at])


@intrinsic
def _limit_in_machine_code(_: Any, _t: Any) -> Any:
    def generate(_: Any, build: Any, __: Any, arguments: Any) -> Any:
        t = build.fptrunc(build.fmul(arguments[0], ir.Constant(DOUBLE, 1.0 + 2.0**-22)), FLOAT)
        bits = build.zext(build.bitcast(t, INT), LONG)
        return build.or_(build.shl(bits, _long(32)), _long(0xFFFFFFFF))

    return types.int64(types.float64), generate


@intrinsic
def _prefetched(_: Any, table: Any, _row: Any) -> Any:
    """Asks for the two lines of cache from where a row of `table` begins, without waiting."""

    def generate(context: Any, build: Any, _: Any, arguments: Any) -> Any:
        width = make_array(table)(context, build, value=arguments[0]).strides
        at = build.mul(arguments[1], build.extract_value(width, 0))
        kind = ir.FunctionType(ir.VoidType(), [BYTE.as_pointer(), INT, INT, INT])
        prefetch = function(build.module, kind, "llvm.prefetch.p0")
        for line in (0, 64):
            place = _place(context, build, table, arguments[0], build.add(at, _long(line)))
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
meets_boxes = _in_machine_code if _machine else in_python
limit_of = _limit_in_machine_code if _machine else limit_in_python  # no key beyond t is above it
prefetch = _prefetched if _machine else _not_prefetched
first_bit = _counted_zeros if _machine else _first_bit
