"""Sixteen pixels at a time: the inner loops of drawing and colouring, written as vector instructions.

Numba's compiler turns long simple loops into vector instructions by itself, but a span of a triangle is short, and
its loop is not. Each function here is a few operations on vectors of `LANES` pixels; how wide the processor's own
vectors are does not matter, as the compiler splits these. Every lane does what a scalar loop would do, in the same
order of operations: the same bits everywhere.

An index counts pixels from the start of an image, row by row. None is checked: the caller sees to it that all
lanes lie within the arrays, which have to be contiguous.

The small kernels at the end work on parts of rows, and the compiler does make vector instructions of them. That
takes loops from 0 over an array of their own: an index that might be negative is one that Numba checks.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from artiskill.geometry.kernel import Array, kernel

LANES = 16

_I1, _I8, _I16, _I32 = (ir.IntType(bits) for bits in (1, 8, 16, 32))
_F32, _F64 = ir.FloatType(), ir.DoubleType()


@intrinsic
def draw_simd(
    context: Any, inverse_depth: Any, triangle: Any, index: Any, column: Any, count: Any, line: Any, t: Any
) -> Any:
    """Draw triangle t into the first `count` of the pixels from `index` on, with depth test.

    Args, as the caller gives them:
        inverse_depth: float32.
        triangle: int32.
        index: of the first pixel in both.
        column: of the first pixel.
        count: of pixels; lanes beyond are left alone, also where it is negative or above `LANES`.
        line: two float64, w where `column` is 0 and its growth per column.
        t: the triangle's number.
    """
    scalars = types.intp, types.intp, types.intp, types.UniTuple(types.float64, 2), types.int32

    def generate(target: Any, b: ir.IRBuilder, signature: Any, args: Any) -> Any:
        first, number, plane, value = args[3:]
        w_row, growth = (_splat(b, b.extract_value(plane, k)) for k in range(2))
        near, who = _lanes_at(target, b, signature, args, 0, 2), _lanes_at(target, b, signature, args, 1, 2)
        columns = b.fadd(_splat(b, b.sitofp(first, _F64)), _numbers(_F64))
        w = b.fptrunc(b.fadd(w_row, b.fmul(columns, growth)), _vector(_F32))
        old, old_who = b.load(near, align=4), b.load(who, align=4)
        inside = b.icmp_signed("<", _numbers(_I32), _splat(b, b.trunc(number, _I32)))
        wins = b.and_(b.fcmp_ordered(">", w, old), inside)
        b.store(b.select(wins, w, old), near, align=4)
        b.store(b.select(wins, _splat(b, value), old_who), who, align=4)
        return target.get_dummy_value()

    return types.void(inverse_depth, triangle, *scalars), generate


@intrinsic
def count_equal_simd(context: Any, values: Any, index: Any) -> Any:
    """Count the entries from `index` on, at most `LANES`, that equal the first; `values` is int32."""

    def generate(target: Any, b: ir.IRBuilder, signature: Any, args: Any) -> Any:
        lanes = b.load(_lanes_at(target, b, signature, args, 0, 1), align=4)
        first = b.extract_element(lanes, _I32(0))
        differs = b.bitcast(b.icmp_signed("!=", lanes, _splat(b, first)), _I16)
        # a bit beyond the last, which is found where no lane differs
        bits = b.or_(b.zext(differs, _I32), _I32(1 << LANES))
        return b.zext(b.cttz(bits, _I1(1)), ir.IntType(64))

    return types.intp(values, types.intp), generate


@intrinsic
def copy_simd(context: Any, rgb: Any, index: Any, source: Any, source_index: Any) -> Any:
    """Copy `LANES` pixels, from pixel `source_index` on, to where pixel `index` begins; both uint8, (..., 3)."""

    def generate(target: Any, b: ir.IRBuilder, signature: Any, args: Any) -> Any:
        into, start = (_pixels_at(target, b, signature, args, array, array + 1) for array in (0, 2))
        b.store(b.load(start, align=1), into, align=1)
        return target.get_dummy_value()

    return types.void(rgb, types.intp, source, types.intp), generate


@intrinsic
def interleave_floats(context: Any, out: Any, index: Any, source: Any, first: Any, second: Any, third: Any) -> Any:
    """Interleave `LANES` numbers of `source` from each of three indices on, into `out` from `index` on.

    Both are float32.
    """

    def generate(target: Any, b: ir.IRBuilder, signature: Any, args: Any) -> Any:
        x, y, z = (b.load(_lanes_at(target, b, signature, args, 2, i), align=4) for i in (3, 4, 5))
        into = _lanes_at(target, b, signature, args, 0, 1)
        b.store(_interleaved(b, x, y, z), b.bitcast(into, ir.VectorType(_F32, 3 * LANES).as_pointer()), align=4)
        return target.get_dummy_value()

    return types.void(out, types.intp, source, types.intp, types.intp, types.intp), generate


@intrinsic
def interleave_pixels(context: Any, out: Any, index: Any, source: Any, first: Any, second: Any, third: Any) -> Any:
    """Interleave `LANES` pixels of `source` from each of three pixels on, into `out` from place `index` on.

    Both are uint8, three per pixel, nine per place of `out`. Shuffles of 16 bytes are what all processors have.
    """

    def generate(target: Any, b: ir.IRBuilder, signature: Any, args: Any) -> Any:
        into = _bytes_at(target, b, signature, args, 0, 1, 9)
        sources = [_bytes_at(target, b, signature, args, 2, i) for i in (3, 4, 5)]
        for j in range(9):
            # the nine bytes of a place are three of each source; those for one vector lie within 16 of a source
            start = min(LANES * j // 9 * 3, 2 * LANES)
            places = [divmod(LANES * j + lane, 9) for lane in range(LANES)]
            inside = [(byte // 3, 3 * pixel + byte % 3 - start) for pixel, byte in places]
            parts = [b.load(_block(b, source, start), align=1) for source in sources]
            two = [at + LANES * k if k < 2 else 0 for k, at in inside]
            three = [LANES + at if k == 2 else lane for lane, (k, at) in enumerate(inside)]
            interleaved = b.shuffle_vector(
                b.shuffle_vector(parts[0], parts[1], _places(two)), parts[2], _places(three)
            )
            b.store(interleaved, _block(b, into, LANES * j), align=1)
        return target.get_dummy_value()

    return types.void(out, types.intp, source, types.intp, types.intp, types.intp), generate


@intrinsic
def shade_simd(context: Any, rgb: Any, depth: Any, index: Any, column: Any, ray: Any, factors: Any) -> Any:
    """Write colours that over depth are linear over the screen to `LANES` pixels from `index` on.

    Args, as the caller gives them:
        rgb: uint8, three per pixel.
        depth: float32.
        index: of the first pixel.
        column: of the first pixel.
        ray: four float32: column of the optical axis, 1 / focal length, y of the row's ray, and 1, or 0 where the
            factors give the colour itself, not that over depth.
        factors: of red, green and blue, each three float32: of the ray's x, its y and 1.
    """

    def generate(target: Any, b: ir.IRBuilder, signature: Any, args: Any) -> Any:
        centre, scale, up, curved = (b.extract_value(args[4], k) for k in range(4))
        z = b.load(_lanes_at(target, b, signature, args, 1, 2), align=4)
        # without a jump, which would often go the other way: z * 1 + 0 and z * 0 + 1
        z = b.fadd(b.fmul(z, _splat(b, curved)), _splat(b, b.fsub(_F32(1.0), curved)))
        columns = b.fadd(_splat(b, b.sitofp(args[3], _F32)), _numbers(_F32))
        x = b.fmul(b.fsub(columns, _splat(b, centre)), _splat(b, scale))
        colours = []
        for channel in range(3):
            along, across, constant = (b.extract_value(args[5], (channel, k)) for k in range(3))
            value = b.fadd(b.fmul(_splat(b, along), x), _splat(b, b.fmul(across, up)))
            value = b.fmul(z, b.fadd(value, _splat(b, constant)))
            colours.append(_bytes_of(b, value))
        b.store(_interleaved(b, *colours), _pixels_at(target, b, signature, args, 0, 2), align=1)
        return target.get_dummy_value()

    single = types.float32
    tuples = types.UniTuple(single, 4), types.UniTuple(types.UniTuple(single, 3), 3)
    return types.void(rgb, depth, types.intp, types.intp, *tuples), generate


def _vector(kind: ir.Type) -> ir.VectorType:
    return ir.VectorType(kind, LANES)


def _numbers(kind: ir.Type) -> ir.Constant:
    """Return 0, 1, 2, ..."""
    return ir.Constant(_vector(kind), [float(i) if kind in (_F32, _F64) else i for i in range(LANES)])


def _splat(b: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """Return one value in all lanes."""
    nothing = ir.Constant(_vector(value.type), ir.Undefined)
    return b.shuffle_vector(b.insert_element(nothing, value, _I32(0)), nothing, ir.Constant(_vector(_I32), None))


def _lanes_at(target: Any, b: ir.IRBuilder, signature: Any, args: Any, array: int, index: int) -> ir.Value:
    """Return a pointer to the lanes of argument `array` from the argument `index` on."""
    data = target.make_array(signature.args[array])(target, b, args[array]).data
    return b.bitcast(b.gep(data, [args[index]]), _vector(data.type.pointee).as_pointer())


def _bytes_of(b: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """Turn colours into bytes, 0 .. 255."""
    low, high = (ir.Constant(_vector(_F32), [limit] * LANES) for limit in (0.0, 255.0))
    value = b.select(b.fcmp_unordered("<", value, low), low, value)
    value = b.select(b.fcmp_ordered(">", value, high), high, value)
    return b.trunc(b.fptosi(value, _vector(_I32)), _vector(_I8))


def _interleaved(b: ir.IRBuilder, x: ir.Value, y: ir.Value, z: ir.Value) -> ir.Value:
    """Interleave three vectors: the first lanes of each, the second ones, ..."""
    pairs = b.shuffle_vector(x, y, _places(list(range(2 * LANES))))
    nothing = ir.Constant(z.type, ir.Undefined)
    third = b.shuffle_vector(z, nothing, _places([min(i, LANES) for i in range(2 * LANES)]))
    return b.shuffle_vector(pairs, third, _places([LANES * k + i for i in range(LANES) for k in range(3)]))


def _places(lanes: list[int]) -> ir.Constant:
    """Return which lanes of two vectors a shuffle takes."""
    return ir.Constant(ir.VectorType(_I32, len(lanes)), lanes)


def _pixels_at(target: Any, b: ir.IRBuilder, signature: Any, args: Any, array: int, index: int) -> ir.Value:
    """Return a pointer to the bytes of `LANES` pixels of argument `array` from the argument `index` on."""
    start = _bytes_at(target, b, signature, args, array, index)
    return b.bitcast(start, ir.VectorType(_I8, 3 * LANES).as_pointer())


def _bytes_at(
    target: Any, b: ir.IRBuilder, signature: Any, args: Any, array: int, index: int, per_item: int = 3
) -> ir.Value:
    """Return a pointer to where the item `args[index]` of argument `array` begins."""
    data = target.make_array(signature.args[array])(target, b, args[array]).data
    return b.gep(data, [b.mul(args[index], args[index].type(per_item))])


def _block(b: ir.IRBuilder, start: ir.Value, offset: int) -> ir.Value:
    """Return a pointer to `LANES` bytes."""
    return b.bitcast(b.gep(start, [_I32(offset)]), _vector(_I8).as_pointer())


@kernel
def clamp_index(value: float, low: int, high: int) -> int:
    """Turn a float into an integer in [low, high]: compared as a float, for out of range, or NaN, it has none.

    Choices between numbers instead of jumps, as in `downwards`.
    """
    bounded = value if value > low else np.float64(low)
    return int(bounded if bounded < high else np.float64(high))


@kernel
def fill(target: Array, value: Any) -> None:
    """Write one value everywhere."""
    for i in range(target.shape[0]):
        target[i] = value


@kernel
def copy(source: Array, target: Array) -> None:
    """Copy all of a source to the start of a target."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@kernel
def fill_linear(target: Array, first: int, start: float, growth: float) -> None:
    """Write start + column * growth from column `first` on."""
    for i in range(target.shape[0]):
        target[i] = np.float32(start + (first + i) * growth)


@kernel
def invert(values: Array) -> None:
    """Replace values by 1 / value."""
    for i in range(values.shape[0]):
        values[i] = np.float32(1.0) / values[i]
