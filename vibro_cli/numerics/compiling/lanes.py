"""Lanes (``numerics.lanes``) for the compiler: vectors of doubles, and records of them."""

from __future__ import annotations

import math
import operator
import zlib
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.datamodel import models
from numba.core.extending import register_model
from numba.core.imputils import (
    lower_builtin,
    lower_cast,
    lower_getattr_generic,
    lower_setattr_generic,
)
from numba.core.typeconv import Conversion
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)

from vibro_cli.numerics import lanes as meaning
from vibro_cli.numerics.lanes import LANES

_REAL = ir.DoubleType()
_VECTOR = ir.VectorType(_REAL, LANES)
_MASK = ir.VectorType(ir.IntType(1), LANES)


class _Vector(types.Type):
    """A double in every lane."""

    def can_convert_from(self, typing: Any, other: Any) -> Any:
        """A number stands for lanes that all have it."""
        return Conversion.safe if other == types.float64 else None


class _Mask(types.Type):
    """A truth value in every lane."""


class LaneRecord(types.Type):
    """A pointer to a record some of whose fields are lanes."""

    def __init__(self, record: Any) -> None:
        self.record = record
        self.size = record.size
        # A short name, since those of all functions contain it.
        super().__init__(name=f"LaneRecord({zlib.crc32(str(record).encode()):x})")

    def kind_of(self, name: str) -> Any:
        """Type of a field, or nothing."""
        if name not in self.record.fields:
            return None
        kind = self.record.typeof(name)
        return vector if _is_register(kind) else kind


vector, mask = _Vector("Lanes"), _Mask("LaneMask")


def with_lanes(record: Any) -> Any:
    """Return the type of a record, which is another one if it has fields of lanes."""
    has_lanes = any(_is_register(record.typeof(name)) for name in record.fields)
    return LaneRecord(record) if has_lanes else record


def _is_register(kind: Any) -> bool:
    return isinstance(kind, types.NestedArray) and kind.shape == (1, LANES)


def record_of(row: Any) -> Any:
    """Return the record that a type of records with or without lanes is of."""
    return row.record if isinstance(row, LaneRecord) else row


@register_model(_Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, _VECTOR)


@register_model(_Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, _MASK)


@register_model(LaneRecord)
class _LaneRecordModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, ir.IntType(8).as_pointer())


@infer_getattr
class _Attribute(AttributeTemplate):
    key = LaneRecord

    def generic_resolve(self, of: LaneRecord, name: str) -> Any:
        return of.kind_of(name)


def _place(builder: Any, of: LaneRecord, record: Any, name: str) -> tuple[Any, Any, Any]:
    kind = of.kind_of(name)
    real = {vector: _VECTOR, types.float64: _REAL}.get(kind, ir.IntType(64))
    offset = ir.Constant(ir.IntType(64), of.record.offset(name))
    return kind, builder.bitcast(builder.gep(record, [offset]), real.as_pointer()), real


@lower_getattr_generic(LaneRecord)
def _lower_attribute(context: Any, builder: Any, of: LaneRecord, record: Any, name: str) -> Any:
    _, place, _ = _place(builder, of, record, name)
    return builder.load(place, align=8)


@lower_setattr_generic(LaneRecord)
def _lower_put(context: Any, builder: Any, signature: Any, values: Any, name: str) -> Any:
    record, value = values
    kind, place, _ = _place(builder, signature.args[0], record, name)
    builder.store(context.cast(builder, value, signature.args[1], kind), place, align=8)


@lower_cast(types.float64, _Vector)
def _splat(context: Any, builder: Any, given: Any, wanted: Any, value: Any) -> Any:
    one = builder.insert_element(
        ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(ir.IntType(32), 0)
    )
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), zeros)


def _of_lanes(name: Any, result: Any, kinds: tuple[Any, ...]) -> None:
    """Tell the compiler's type inference what an operation on lanes gives."""

    class Template(AbstractTemplate):
        def generic(self, arguments: Any, keywords: Any) -> Any:
            if len(arguments) != len(kinds) or not set(arguments) & {vector, mask}:
                return None
            if all(
                given == kind or (kind == vector and isinstance(given, types.Float))
                for given, kind in zip(arguments, kinds, strict=True)
            ):
                return signature(result, *kinds)
            return None

    Template.key = name
    infer_global(name)(Template)


def _operation(name: Any, method: str) -> None:
    _of_lanes(name, vector, (vector, vector))

    @lower_builtin(name, vector, vector)
    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return getattr(builder, method)(*values)


for _name, _method in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    _operation(getattr(operator, _name), _method)
    _operation(getattr(operator, f"i{_name}"), _method)


def _comparison(name: Any, sign: str) -> None:
    _of_lanes(name, mask, (vector, vector))

    @lower_builtin(name, vector, vector)
    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.fcmp_ordered(sign, *values)


for _name, _sign in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "==")):
    _comparison(getattr(operator, _name), _sign)


def _intrinsic(builder: Any, name: str, value: Any) -> Any:
    form = ir.FunctionType(_VECTOR, [_VECTOR])
    found = builder.module.globals.get(name) or ir.Function(builder.module, form, name)
    return builder.call(found, [value])


def _unary(name: Any, give: Any) -> None:
    _of_lanes(name, vector, (vector,))

    @lower_builtin(name, vector)
    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return give(builder, values[0])


def _llvm(name: str) -> Any:
    return lambda builder, value: _intrinsic(builder, f"llvm.{name}.v{LANES}f64", value)


_unary(operator.neg, lambda builder, value: builder.fneg(value))
_unary(abs, _llvm("fabs"))
_unary(math.sqrt, _llvm("sqrt"))


def _extreme(name: Any, sign: str) -> None:
    """``min`` and ``max`` as Python has them: the first one unless the second is beyond it."""
    _of_lanes(name, vector, (vector, vector))

    @lower_builtin(name, vector, vector)
    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        one, other = values
        return builder.select(builder.fcmp_ordered(sign, other, one), other, one)


_extreme(min, "<")
_extreme(max, ">")

_of_lanes(meaning.choose, vector, (mask, vector, vector))
_of_lanes(meaning.both, mask, (mask, mask))
_of_lanes(meaning.either, mask, (mask, mask))
_of_lanes(meaning.any_lane, types.boolean, (mask,))
_of_lanes(meaning.opposite, mask, (mask,))


@infer_global(meaning.choose)
class _ChooseNumber(AbstractTemplate):
    """A choice of numbers is one instruction, too, and no jump."""

    def generic(self, arguments: Any, keywords: Any) -> Any:
        if arguments[0] != types.boolean:
            return None
        return signature(types.float64, types.boolean, types.float64, types.float64)


@infer_global(meaning.has_bit)
class _HasBit(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        return signature(mask, vector, types.int64) if arguments[0] == vector else None


@lower_builtin(meaning.choose, types.boolean, types.float64, types.float64)
@lower_builtin(meaning.choose, mask, vector, vector)
def _choose(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.select(*values)


@lower_builtin(meaning.both, mask, mask)
def _both(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.and_(*values)


@lower_builtin(meaning.either, mask, mask)
def _either(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.or_(*values)


@lower_builtin(meaning.any_lane, mask)
def _any(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    bits = builder.bitcast(values[0], ir.IntType(LANES))
    return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))


@lower_builtin(meaning.opposite, mask)
def _opposite(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.xor(values[0], ir.Constant(_MASK, [1] * LANES))


@lower_builtin(meaning.has_bit, vector, types.int64)
def _has_bit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    whole = ir.VectorType(ir.IntType(64), LANES)
    nothing = ir.Constant(whole, ir.Undefined)
    one = builder.insert_element(nothing, values[1], ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    bits = builder.and_(
        builder.fptosi(values[0], whole), builder.shuffle_vector(one, nothing, zeros)
    )
    return builder.icmp_unsigned("!=", bits, ir.Constant(whole, [0] * LANES))


@infer_global(meaning.in_lane)
class _InLane(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        return signature(types.float64, vector, types.int64) if arguments[0] == vector else None


@lower_builtin(meaning.in_lane, vector, types.int64)
def _in_lane(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return builder.extract_element(*values)


@infer_global(meaning.with_lane)
class _WithLane(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        found = signature(vector, vector, types.int64, types.float64)
        return found if arguments[0] == vector else None


@lower_builtin(meaning.with_lane, vector, types.int64, types.float64)
def _with_lane(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    lanes, number, value = values
    return builder.insert_element(lanes, value, number)
