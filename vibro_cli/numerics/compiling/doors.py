"""Doors: functions of plain integers, doubles and pointers by which machine code is called."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils
from numba.core import types as numba_types
from numba.extending import intrinsic

from vibro_cli.numerics import engine
from vibro_cli.numerics.compiling.lanes import record_of
from vibro_cli.numerics.compiling.references import SCALARS, Reference, Rows, rows_of


def door_of(compiled: Any, symbol: str) -> Any:
    """The function by which an entry is called from outside."""
    context, inside = compiled.target_context, compiled.fndesc
    word, pointer, real = ir.IntType(64), ir.IntType(8).as_pointer(), ir.DoubleType()
    kinds = {numba_types.int64: word, numba_types.boolean: word, numba_types.float64: real}
    outside = [kinds.get(kind, pointer) for kind in inside.argtypes]
    module = compiled.library.create_ir_module(symbol)
    door = ir.Function(module, ir.FunctionType(ir.VoidType(), [*outside, pointer]), symbol)
    builder = ir.IRBuilder(door.append_basic_block())
    values = [
        _taken(context, builder, kind, value)
        for kind, value in zip(inside.argtypes, door.args, strict=False)
    ]
    callee = context.declare_function(module, inside)
    _, result = context.call_conv.call_function(
        builder, callee, inside.restype, inside.argtypes, values
    )
    results = builder.bitcast(door.args[-1], word.as_pointer())
    for position, value in enumerate(_numbers(builder, inside.restype, result)):
        place = builder.gep(results, [ir.Constant(word, position)])
        if value.type == real:
            place = builder.bitcast(place, real.as_pointer())
        elif value.type != word:
            value = builder.zext(value, word)
        builder.store(value, place)
    builder.ret_void()
    return module


def _handed(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """A number as it is, and a pointer for what doors take pointers to."""
    word, pointer = ir.IntType(64), ir.IntType(8).as_pointer()
    if kind == numba_types.boolean:
        return builder.zext(value, word)
    if isinstance(kind, Rows):
        rows = cgutils.create_struct_proxy(kind)(context, builder, value=value)
        held = context.make_array(numba_types.Array(kind.row, 1, "C"))(context, builder)
        held.data = builder.bitcast(rows.first, held.data.type)
        held.nitems = rows.count
        value = held._getpointer()
    return (
        value
        if kind in (numba_types.int64, numba_types.float64)
        else builder.bitcast(value, pointer)
    )


def from_outside(kernel: Callable[..., Any]) -> Any:
    """What calls a kernel that is apart, through its door."""
    symbol, returned = engine.symbol_of(kernel), SCALARS.get(kernel.__annotations__["return"])
    word, pointer = ir.IntType(64), ir.IntType(8).as_pointer()

    def call(typing: Any, *kinds: Any) -> Any:
        kinds = tuple(numba_types.unliteral(kind) for kind in kinds)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            values = cgutils.unpack_tuple(builder, arguments[0], len(kinds))
            values = [
                _handed(context, builder, kind, value)
                for kind, value in zip(kinds, values, strict=True)
            ]
            found = cgutils.alloca_once(builder, word)
            values.append(builder.bitcast(found, pointer))
            form = ir.FunctionType(ir.VoidType(), [value.type for value in values])
            builder.call(cgutils.get_or_insert_function(builder.module, form, symbol), values)
            if returned is None:
                return context.get_dummy_value()
            if returned == numba_types.float64:
                found = builder.bitcast(found, ir.DoubleType().as_pointer())
            result = builder.load(found)
            boolean = returned == numba_types.boolean
            return builder.trunc(result, ir.IntType(1)) if boolean else result

        return (returned or numba_types.none)(numba_types.StarArgTuple.from_types(kinds)), generate

    return intrinsic(call)


def _numbers(builder: Any, kind: Any, result: Any) -> list[Any]:
    """The numbers of a result."""
    if isinstance(kind, numba_types.BaseTuple):
        return [builder.extract_value(result, n) for n in range(len(kind))]
    return [] if kind == numba_types.none else [result]


def _taken(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """A number as it is, and what a pointer means for the type of a parameter."""
    if kind == numba_types.boolean:
        return builder.trunc(value, ir.IntType(1))
    if isinstance(kind, Reference):
        return builder.bitcast(value, context.get_value_type(kind))
    if isinstance(kind, Rows):
        array = numba_types.Array(record_of(kind.row), 1, "C")
        held = builder.load(builder.bitcast(value, context.get_value_type(array).as_pointer()))
        return rows_of(context, builder, array, held)
    if isinstance(kind, numba_types.Array):
        return builder.load(builder.bitcast(value, context.get_value_type(kind).as_pointer()))
    return value
