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

_REAL, _WORD = ir.DoubleType(), ir.IntType(64)


class _Vector(types.Type):
    """A double in every lane."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.form = ir.VectorType(_REAL, count)
        super().__init__(name=f"Lanes({count})")

    def can_convert_from(self, typing: Any, other: Any) -> Any:
        """A number stands for lanes that all have it."""
        return Conversion.safe if other == types.float64 else None


class _Mask(types.Type):
    """A truth value in every lane."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.form = ir.VectorType(ir.IntType(1), count)
        super().__init__(name=f"LaneMask({count})")


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
        return _Vector(kind.shape[1]) if _is_register(kind) else kind


def with_lanes(record: Any) -> Any:
    """Return the type of a record, which is another one if it has fields of lanes."""
    has_lanes = any(_is_register(record.typeof(name)) for name in record.fields)
    return LaneRecord(record) if has_lanes else record


def _is_register(kind: Any) -> bool:
    """Tell lanes from other rows of numbers: they are rows of one row."""
    return isinstance(kind, types.NestedArray) and len(kind.shape) == 2


def record_of(row: Any) -> Any:
    """Return the record that a type of records with or without lanes is of."""
    return row.record if isinstance(row, LaneRecord) else row


@register_model(_Vector)
@register_model(_Mask)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, of.form)


@register_model(LaneRecord)
class _LaneRecordModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, ir.IntType(8).as_pointer())


@infer_getattr
class _Attribute(AttributeTemplate):
    key = LaneRecord

    def generic_resolve(self, of: LaneRecord, name: str) -> Any:
        return of.kind_of(name)


def _place(builder: Any, of: LaneRecord, record: Any, name: str) -> Any:
    kind = of.kind_of(name)
    form = kind.form if isinstance(kind, _Vector) else _WORD if kind == types.int64 else _REAL
    offset = ir.Constant(_WORD, of.record.offset(name))
    return builder.bitcast(builder.gep(record, [offset]), form.as_pointer())


@lower_getattr_generic(LaneRecord)
def _lower_attribute(context: Any, builder: Any, of: LaneRecord, record: Any, name: str) -> Any:
    return builder.load(_place(builder, of, record, name), align=8)


@lower_setattr_generic(LaneRecord)
def _lower_put(context: Any, builder: Any, signature: Any, values: Any, name: str) -> Any:
    of, given = signature.args
    value = context.cast(builder, values[1], given, of.kind_of(name))
    builder.store(value, _place(builder, of, values[0], name), align=8)


def _in_all(builder: Any, value: Any, count: int) -> Any:
    nothing = ir.Constant(ir.VectorType(value.type, count), ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), count), [0] * count)
    return builder.shuffle_vector(first, nothing, zeros)


@lower_cast(types.float64, _Vector)
def _splat(context: Any, builder: Any, given: Any, wanted: Any, value: Any) -> Any:
    return _in_all(builder, value, wanted.count)


def _operation(name: Any, result: Any, kinds: tuple[Any, ...], lower: Any) -> None:
    """Add an operation on lanes; numbers beside them stand for lanes that all have them.

    Parameters
    ----------
    name
        The function or operator.
    result, kinds
        Of the result and of each operand ``_Vector``, ``_Mask`` or another type.
    lower
        Makes the code, given the builder and the values.
    """

    class Template(AbstractTemplate):
        key = name

        def generic(self, arguments: Any, keywords: Any) -> Any:
            counts = {kind.count for kind in arguments if isinstance(kind, (_Vector, _Mask))}
            if len(arguments) != len(kinds) or len(counts) != 1:
                return None
            exact = [kind(*counts) if kind in (_Vector, _Mask) else kind for kind in kinds]
            for given, kind in zip(arguments, exact, strict=True):
                number = isinstance(kind, _Vector) and isinstance(given, types.Float)
                if not (number or given == kind):
                    return None
            return signature(result(*counts) if result in (_Vector, _Mask) else result, *exact)

    infer_global(name)(Template)
    lower_builtin(name, *kinds)(lambda context, builder, signature, values: lower(builder, *values))


def _on_numbers(name: Any, result: Any, kinds: tuple[Any, ...], lower: Any) -> None:
    """Add an operation on numbers."""

    class Template(AbstractTemplate):
        key = name

        def generic(self, arguments: Any, keywords: Any) -> Any:
            fit = len(arguments) == len(kinds) and arguments[0] == kinds[0]
            return signature(result, *kinds) if fit else None

    infer_global(name)(Template)
    lower_builtin(name, *kinds)(lambda context, builder, signature, values: lower(builder, *values))


def _method(name: str) -> Any:
    return lambda builder, *values: getattr(builder, name)(*values)


def _intrinsic(name: str) -> Any:
    def lower(builder: Any, value: Any) -> Any:
        form = ir.FunctionType(value.type, [value.type])
        whole = f"llvm.{name}.v{value.type.count}f64"
        found = builder.module.globals.get(whole) or ir.Function(builder.module, form, whole)
        return builder.call(found, [value])

    return lower


def _comparison(sign: str) -> Any:
    return lambda builder, one, other: builder.fcmp_ordered(sign, one, other)


def _extreme(sign: str) -> Any:
    """``min`` and ``max`` as Python has them: the first one unless the second is beyond it."""
    return lambda builder, one, other: builder.select(
        builder.fcmp_ordered(sign, other, one), other, one
    )


def _opposite(builder: Any, mask: Any) -> Any:
    return builder.xor(mask, ir.Constant(mask.type, [1] * mask.type.count))


def _any_lane(builder: Any, mask: Any) -> Any:
    bits = builder.bitcast(mask, ir.IntType(mask.type.count))
    return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))


def _has_bit(builder: Any, lanes: Any, bit: Any) -> Any:
    whole = ir.VectorType(_WORD, lanes.type.count)
    bits = builder.and_(builder.fptosi(lanes, whole), _in_all(builder, bit, whole.count))
    return builder.icmp_unsigned("!=", bits, ir.Constant(whole, [0] * whole.count))


def _two_lanes(builder: Any, first: Any, second: Any) -> Any:
    lanes, places = ir.Constant(ir.VectorType(_REAL, 2), ir.Undefined), ir.IntType(32)
    for number, value in enumerate((first, second)):
        lanes = builder.insert_element(lanes, value, ir.Constant(places, number))
    return lanes


for _name, _code in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    _operation(getattr(operator, _name), _Vector, (_Vector, _Vector), _method(_code))
    _operation(getattr(operator, f"i{_name}"), _Vector, (_Vector, _Vector), _method(_code))
for _name, _sign in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "==")):
    _operation(getattr(operator, _name), _Mask, (_Vector, _Vector), _comparison(_sign))
_operation(operator.neg, _Vector, (_Vector,), _method("fneg"))
_operation(abs, _Vector, (_Vector,), _intrinsic("fabs"))
_operation(math.sqrt, _Vector, (_Vector,), _intrinsic("sqrt"))
_operation(min, _Vector, (_Vector, _Vector), _extreme("<"))
_operation(max, _Vector, (_Vector, _Vector), _extreme(">"))
_operation(meaning.choose, _Vector, (_Mask, _Vector, _Vector), _method("select"))
_operation(meaning.both, _Mask, (_Mask, _Mask), _method("and_"))
_operation(meaning.either, _Mask, (_Mask, _Mask), _method("or_"))
_operation(meaning.opposite, _Mask, (_Mask,), _opposite)
_operation(meaning.any_lane, types.boolean, (_Mask,), _any_lane)
_operation(meaning.has_bit, _Mask, (_Vector, types.int64), _has_bit)
_operation(meaning.in_lane, types.float64, (_Vector, types.int64), _method("extract_element"))
_operation(
    meaning.with_lane, _Vector, (_Vector, types.int64, types.float64),
    lambda builder, lanes, number, value: builder.insert_element(lanes, value, number),
)  # fmt: skip
# A choice of numbers is one instruction, too, and no jump.
_on_numbers(
    meaning.choose, types.float64, (types.boolean, types.float64, types.float64), _method("select")
)
_on_numbers(meaning.two_lanes, _Vector(2), (types.float64, types.float64), _two_lanes)
