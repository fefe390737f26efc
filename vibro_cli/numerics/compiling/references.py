"""What kernels take: a pointer to their world, of which they see the records of its arrays."""

from __future__ import annotations

import operator
import zlib
from typing import Any

from numba.core import cgutils
from numba.core import types as numba_types
from numba.core.datamodel import models
from numba.core.extending import register_model
from numba.core.imputils import lower_builtin, lower_getattr_generic
from numba.core.typing.templates import (
    AbstractTemplate,
    AttributeTemplate,
    infer_getattr,
    infer_global,
    signature,
)
from numba.np.numpy_support import from_dtype

from vibro_cli.numerics.compiling.lanes import with_lanes

SCALARS = {
    "int": numba_types.int64,
    "bool": numba_types.boolean,
    "float": numba_types.float64,
}
"""Types of numbers, by the words for them in the annotations of kernels."""


class Reference(numba_types.Type):
    """A pointer to a named tuple of arrays that its owner keeps."""

    def __init__(self, value: Any) -> None:
        self.value = value
        # A short name, since those of all functions contain it.
        super().__init__(name=f"Reference({zlib.crc32(str(value).encode()):x})")


class Rows(numba_types.Type):
    """The records of an array: a pointer to the first one, and their number."""

    def __init__(self, row: Any) -> None:
        self.row = row
        super().__init__(name=f"Rows({row})")


@register_model(Reference)
class _ReferenceModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Reference) -> None:
        super().__init__(manager, of, manager.lookup(of.value).get_value_type().as_pointer())


@register_model(Rows)
class _RowsModel(models.StructModel):
    def __init__(self, manager: Any, of: Rows) -> None:
        members = [("first", numba_types.voidptr), ("count", numba_types.intp)]
        super().__init__(manager, of, members)


def _seen(array: Any) -> Any:
    """Type of a field seen through a reference."""
    if (
        isinstance(array, numba_types.Array)
        and array.ndim == 1
        and isinstance(array.dtype, numba_types.Record)
    ):
        return Rows(with_lanes(array.dtype))
    return array


@infer_getattr
class _ReferenceAttribute(AttributeTemplate):
    key = Reference

    def generic_resolve(self, of: Reference, name: str) -> Any:
        if name not in of.value.fields:
            return None
        return _seen(of.value[of.value.fields.index(name)])


@lower_getattr_generic(Reference)
def _lower_attribute(context: Any, builder: Any, of: Reference, value: Any, name: str) -> Any:
    index = of.value.fields.index(name)
    array = builder.load(cgutils.gep_inbounds(builder, value, 0, index))
    field = of.value[index]
    if not isinstance(_seen(field), Rows):
        return array
    return rows_of(context, builder, field, array)


def rows_of(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    """The records of an array."""
    whole = context.make_array(kind)(context, builder, array)
    rows = cgutils.create_struct_proxy(Rows(with_lanes(kind.dtype)))(context, builder)
    rows.first = builder.bitcast(whole.data, rows.first.type)
    rows.count = whole.nitems
    return rows._getvalue()


@infer_global(operator.getitem)
class _RowTemplate(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        if len(arguments) == 2 and isinstance(arguments[0], Rows):
            return signature(arguments[0].row, arguments[0], numba_types.intp)
        return None


@infer_global(operator.setitem)
class _PutTemplate(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        if len(arguments) == 3 and isinstance(arguments[0], Rows):
            row = arguments[0].row
            return signature(numba_types.none, arguments[0], numba_types.intp, row)
        return None


@infer_global(len)
class _CountTemplate(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        if len(arguments) == 1 and isinstance(arguments[0], Rows):
            return signature(numba_types.intp, arguments[0])
        return None


def _row_at(context: Any, builder: Any, of: Rows, rows: Any, index: Any) -> Any:
    first = cgutils.create_struct_proxy(of)(context, builder, value=rows).first
    size = context.get_constant(numba_types.intp, of.row.size)
    row = builder.gep(first, [builder.mul(index, size)])
    return builder.bitcast(row, context.get_value_type(of.row))


@lower_builtin(operator.getitem, Rows, numba_types.intp)
def _lower_row(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return _row_at(context, builder, signature.args[0], *values)


@lower_builtin(operator.setitem, Rows, numba_types.intp, numba_types.Record)
def _lower_put(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    rows, index, row = values
    of = signature.args[0]
    target = _row_at(context, builder, of, rows, index)
    size = context.get_constant(numba_types.intp, of.row.size)
    cgutils.raw_memcpy(builder, target, row, size, 1)
    return context.get_dummy_value()


@lower_builtin(len, Rows)
def _lower_count(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    return cgutils.create_struct_proxy(signature.args[0])(context, builder, value=values[0]).count


def type_of(form: Any) -> Any:
    """Return the type of a parameter: of a word for numbers, an array or a tuple of arrays."""
    if isinstance(form, str):
        return SCALARS[form]
    if isinstance(form, tuple):
        arrays = [_array_type(array) for array in form]
        return Reference(numba_types.NamedTuple(arrays, type(form)))
    return _seen(_array_type(form))


def _array_type(array: Any) -> Any:
    return numba_types.Array(from_dtype(array.dtype), array.ndim, "C")
