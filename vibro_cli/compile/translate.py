"""Translate kernels to C++: one readable source file per program, with the kernels' line numbers.

A kernel becomes one C++ function of the same name, in a namespace for its module, for each
combination of argument types; overloading tells these apart. Locals are declared at the top, with
the type of their first assignment. Anything outside the subset is an error with its file and line.
"""

from __future__ import annotations

import ast
import builtins
import itertools
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from textwrap import indent
from typing import Any, NamedTuple, NoReturn

from vibro_cli.compile import kernel as k
from vibro_cli.compile.kernel import (
    LANES,
    NO_OVERRIDES,
    Kernel,
    Kind,
    Overrides,
    TranslationError,
    is_kernel,
    shown,
    signature,
)

_WORDS = """alignas asm auto bool case catch char class const default delete do double else enum
    explicit export extern false float friend goto inline int int64_t long mutable namespace new
    operator private protected public register short signed sizeof static struct switch template
    this throw true typedef typename union unsigned using virtual void volatile xor"""
_RESERVED = set(_WORDS.split())
_OPERATORS = {
    ast.Add: "({} + {})",
    ast.Sub: "({} - {})",
    ast.Mult: "({} * {})",
    ast.Div: "({} / {})",
    ast.Mod: "py::mod({}, {})",
    ast.FloorDiv: "py::floordiv({}, {})",
}
_ORDER = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
_COMPARISONS = {**_ORDER, ast.Eq: "==", ast.NotEq: "!="}
_NUMBERS: dict[Any, Kind] = {float: k.FLOAT, int: k.INT, bool: k.BOOL}
_PLAIN = {ast.Pass: ";", ast.Break: "break;", ast.Continue: "continue;"}


class Value(NamedTuple):
    """A C++ expression and its type."""

    code: str
    kind: Kind


class Rule(NamedTuple):
    """The C++ form of a Python function that kernels may call."""

    text: str
    """Template: {0}, {1}, … are the arguments, {all} all of them, {kind} the type of the result."""
    result: Kind | Callable[..., Kind] | None
    """Type of the result, its function of the types of the arguments, or None: that of them all."""


_RULES: dict[Any, Rule] = {
    min: Rule("py::min<{kind}>({all})", None),
    max: Rule("py::max<{kind}>({all})", None),
    abs: Rule("py::abs({0})", lambda kind: kind),
    int: Rule("int64_t({0})", k.INT),
    float: Rule("double({0})", k.FLOAT),
    round: Rule("int64_t(std::nearbyint({0}))", k.INT),
    k.fused: Rule("std::fma({all})", k.FLOAT),
    k.any_lane: Rule("py::any_lane({0})", k.BOOL),
    k.has_bit: Rule("py::has_bit({all})", lambda kind, _: k.truth_of(kind)),
    k.extract: Rule("{0}[{1}]", k.FLOAT),
    k.insert: Rule("py::insert({all})", lambda kind, *_: kind),
    k.pack: Rule("py::pack({all})", k.lanes_of(2)),
    math.sqrt: Rule("py::sqrt({0})", lambda kind: kind if kind.size else k.FLOAT),
    math.floor: Rule("int64_t(std::floor({0}))", k.INT),
    math.ceil: Rule("int64_t(std::ceil({0}))", k.INT),
}
# Functions of Python's module math with the same bits as those of the C library.
_OF_C = """exp expm1 log log1p log2 copysign fabs pow sin cos tan asin acos atan atan2
    sinh cosh tanh asinh acosh atanh"""
_RULES |= {getattr(math, name): Rule(f"std::{name}({{all}})", k.FLOAT) for name in _OF_C.split()}


@dataclass
class Program:
    """A C++ source file of all the kernels that some entry points call."""

    name: str  # of the source file
    entries: Sequence[Kernel]  # called from Python
    overrides: Overrides = NO_OVERRIDES
    flags: Sequence[str] = ()  # further options of the compiler
    functions: dict[Any, Function | None] = field(default_factory=dict)
    declared: dict[Kind, None] = field(default_factory=dict)
    constants: dict[str, None] = field(default_factory=dict)

    def source(self) -> str:
        """Return the C++ source file.

        Raises
        ------
        TranslationError
            If a kernel is not in the compiled subset of Python.
        """
        doors = [self._entry(kernel) for kernel in self.entries]
        parts = [
            '#include "prelude.hpp"\n\nnamespace {\n\ntemplate <class... Items>\nstruct Tuple;\n',
            *map(k.declaration, self.declared),
            "\n".join(self.constants) + "\n",
            *(function.definition for function in self.functions.values() if function),
            "}  // namespace\n",
            *doors,
        ]
        return "\n".join(parts)

    def note(self, kind: Kind) -> Kind:
        """Register a type for declaration, after the types that it consists of; return it."""
        if kind not in self.declared:
            parts = [kind.item] if kind.form == "array" else kind.members.values()
            for part in parts:
                self.note(part)
            self.declared[kind] = None
        return kind

    def function(self, kernel: Kernel, kinds: tuple[Kind, ...]) -> Function | None:
        """Return the function of a kernel for given parameter types; None while it is translated.

        Callees come before their callers.
        """
        key = kernel, kinds
        if key not in self.functions:
            self.functions[key] = None
            function = Function(self, kernel, kinds)
            del self.functions[key]
            self.functions[key] = function
        return self.functions[key]

    def _entry(self, kernel: Kernel) -> str:
        """Return the exported function of a kernel."""
        kernel = self.overrides.resolved(kernel)
        kinds, _ = signature(kernel)
        function: Any = self.function(kernel, tuple(kinds.values()))
        given = {_local(name): kind for name, kind in kinds.items()}
        parameters = [
            f"const {kind.cpp}& {name}" if kind.form == "array" else f"{kind.cpp} {name}"
            for name, kind in given.items()
        ]
        symbol = self.overrides.symbol(kernel)
        head = f"{function.returns.cpp} {symbol}({', '.join(parameters)})"
        call = f"{function.name}({', '.join(given)})"
        return f'extern "C" EXPORTED {head} {{\n  return {call};\n}}\n'

    def constant(self, name: str, value: Any, module: str) -> Value | None:
        """Return a module's number or tuple of numbers as a named constant, else None."""
        shape, part = "", value
        while isinstance(part, tuple) and part:
            shape, part = f"{shape}[{len(part)}]", part[0]
        if type(part) not in _NUMBERS:
            return None
        kind, home = _NUMBERS[type(part)], _namespace(module)
        text = f"constexpr {kind.cpp} {name}{shape} = {literal(value)};"
        self.constants[f"namespace {home} {{ {text} }}"] = None
        for _ in range(shape.count("[")):
            kind = Kind("row", f"const {kind.cpp}*", kind)
        return Value(f"{home}::{name}", kind)


def _braced(head: str, lines: Sequence[str]) -> str:
    """Return lines in braces; directives are not indented."""
    text = indent("\n".join(lines), "  ", lambda line: not line.startswith("#"))
    return f"{head} {{\n{text}\n}}"


def _namespace(module: str) -> str:
    return module.rpartition(".")[2]


def _local(name: str) -> str:
    """Return the C++ name of a local variable: its own, unless that is a word of C++."""
    return f"{name}_" if name in _RESERVED else name


def literal(value: Any) -> str:
    """Return a number or a tuple of numbers as an exact C++ literal."""
    if isinstance(value, tuple):
        return "{" + ", ".join(map(literal, value)) + "}"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return f"INT64_C({value})"
    return repr(value).replace("inf", "INFINITY").replace("nan", "NAN")


@cache
def _definitions(path: str) -> dict[int, ast.FunctionDef]:
    """Return the decorated functions of a module by the line of their first decorator."""
    found: Any = ast.parse(Path(path).read_text(encoding="utf-8")).body
    decorators = [(getattr(node, "decorator_list", ()), node) for node in found]
    return {above[0].lineno: node for above, node in decorators if above}


class Function:
    """A kernel as a C++ function, for given parameter types."""

    def __init__(self, program: Program, kernel: Kernel, kinds: tuple[Kind, ...]) -> None:
        self.program = program
        self.kernel = kernel
        self._file = shown(kernel.__code__.co_filename)
        node = _definitions(kernel.__code__.co_filename)[kernel.__code__.co_firstlineno]
        names, self._declared = signature(kernel)
        self.returns: Any = None
        self._kinds: dict[str, Kind] = dict(zip(names, kinds, strict=True))
        self._numbers = itertools.count(1)  # of temporaries
        home = _namespace(kernel.__module__)
        self.name = f"{home}::{kernel.__name__}"
        for kind in kinds:
            program.note(kind)
        lines = self._block(node.body)
        self.returns = program.note(self.returns or self._declared)
        declared = [f"{kind.cpp} {_local(name)}" for name, kind in self._kinds.items()]
        typed = f"{self.returns.cpp} {kernel.__name__}({', '.join(declared[: len(names)])})"
        head = f"{'IN_PLACE' if f'<{LANES}>' in typed else 'static'} {typed}"
        text = _braced(head, [*(f"{one}{{}};" for one in declared[len(names) :]), *lines])
        self.definition = f"namespace {home} {{\n{self._line_of(node)}\n{text}\n}}\n"

    def _line_of(self, node: Any) -> str:
        return f'#line {node.lineno} "{self._file}"'

    def _fail(self, node: Any, text: str) -> NoReturn:
        raise TranslationError(f"{self._file}:{node.lineno}: {self.kernel.__name__}: {text}")

    def _meaning(self, node: ast.expr) -> Any:
        """Return the value in the kernel's module of a name that is not a variable."""
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "math":
            return getattr(math, node.attr, None)
        if not isinstance(node, ast.Name):
            return None
        value = getattr(sys.modules[self.kernel.__module__], node.id, None)
        value = getattr(builtins, node.id, None) if value is None else value
        return self.program.overrides.resolved(value)

    # Statements

    def _block(self, body: Sequence[ast.stmt]) -> list[str]:
        """Return statements in C++, each after the directive that names its line."""
        lines = []
        for statement in body:
            if not (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)):
                write = self._method("_write", statement)
                lines += [self._line_of(statement), write(statement)]
        return lines

    def _method(self, task: str, node: ast.AST) -> Any:
        """Return the method that performs a task for this type of node."""
        name = type(node).__name__
        method = getattr(self, f"{task}_{name}", None)
        return method or self._fail(node, f"a kernel has no {name.lower()}")

    def _write_plain(self, statement: ast.stmt) -> str:
        return _PLAIN[type(statement)]

    _write_Pass = _write_Break = _write_Continue = _write_plain

    def _write_Expr(self, statement: ast.Expr) -> str:
        return f"{self._value(statement.value).code};"

    def _write_Return(self, statement: ast.Return) -> str:
        if statement.value is None:
            return "return;"
        value = self._value(statement.value)
        if self.returns is None and k.in_one_lane(value.kind) == k.in_one_lane(self._declared):
            self.returns = value.kind
        return f"return {self._exact(value, self.returns or self._declared, statement)};"

    def _write_If(self, statement: ast.If) -> str:
        test = self._truth(statement.test, is_one=True)
        text = _braced(f"if ({test.code})", self._block(statement.body))
        other = self._block(statement.orelse)
        return "\n".join([text, _braced("else", other)]) if other else text

    def _loop(self, head: str, statement: ast.For | ast.While, first: Sequence[str] = ()) -> str:
        if statement.orelse:
            self._fail(statement, "a kernel has no else of a loop")
        return _braced(head, [*first, *self._block(statement.body)])

    def _write_While(self, statement: ast.While) -> str:
        return self._loop(f"while ({self._truth(statement.test, is_one=True).code})", statement)

    def _write_For(self, statement: ast.For) -> str:
        steps: Any = statement.iter
        is_range = isinstance(steps, ast.Call) and ast.unparse(steps.func) == "range"
        is_range = is_range and len(steps.args) in (1, 2, 3)
        if not is_range or not isinstance(statement.target, ast.Name):
            self._fail(statement, "expected `for name in range(...)`")
        bounds = [self._exact(self._value(one), k.INT, one) for one in steps.args]
        low, high, step = (("0", *bounds, "1") if len(bounds) == 1 else (*bounds, "1"))[:3]
        name, number = self._declare(statement.target, k.INT), next(self._numbers)
        at, end, by = (f"{word}_{number}" for word in ("at", "end", "by"))
        going = f"{by} > 0 ? {at} < {end} : {at} > {end}"
        head = f"for (int64_t {at} = {low}, {end} = {high}, {by} = {step}; {going}; {at} += {by})"
        return self._loop(head, statement, [f"{name} = {at};"])

    def _write_AugAssign(self, statement: ast.AugAssign) -> str:
        read: Any = statement.target
        value = self._value(ast.copy_location(ast.BinOp(read, statement.op, statement.value), read))
        return self._assigned(statement.target, value, statement)

    def _write_AnnAssign(self, statement: ast.AnnAssign) -> str:
        if statement.value is None:
            self._fail(statement, "expected a value")
        return self._assigned(statement.target, self._value(statement.value), statement)

    def _write_Assign(self, statement: ast.Assign) -> str:
        if len(statement.targets) > 1:
            self._fail(statement, "expected one target, or a tuple of them")
        return self._assigned(statement.targets[0], self._value(statement.value), statement)

    def _assigned(self, target: ast.expr, value: Value, at: ast.stmt) -> str:
        if isinstance(target, ast.Tuple):
            return self._unpacked(target.elts, value, at)
        if isinstance(target, ast.Name):
            return f"{self._declare(target, value.kind)} = {value.code};"
        place = self._value(target)
        code = self._exact(value, place.kind, at)
        is_struct = place.kind.form == "struct"  # contents, not addresses
        return f"*{place.code} = *{code};" if is_struct else f"{place.code} = {code};"

    def _unpacked(self, targets: Sequence[ast.expr], value: Value, at: ast.stmt) -> str:
        if value.kind.form != "tuple" or len(value.kind.item) != len(targets):
            self._fail(at, f"expected a tuple of {len(targets)} values")
        name = f"value_{next(self._numbers)}"
        lines = [f"const auto {name} = {value.code};"]
        for target, (member, kind) in zip(targets, value.kind.members.items(), strict=True):
            if ast.unparse(target) != "_":
                lines.append(self._assigned(target, Value(f"{name}.{member}", kind), at))
        return "\n".join(lines)

    def _declare(self, node: ast.Name, kind: Kind) -> str:
        """Return the C++ name of a variable that is assigned a value of a type."""
        if kind == k.NOTHING:
            self._fail(node, f"{node.id} is given no value, expected a number or a struct")
        first = self._kinds.setdefault(node.id, kind)
        if kind != first:
            self._fail(node, f"{node.id} is given values of two types, {first.cpp} and {kind.cpp}")
        return _local(node.id)

    # Expressions

    def _value(self, node: ast.expr) -> Value:
        value: Value = self._method("_value", node)(node)
        return value

    def _exact(self, value: Value, kind: Kind, node: ast.AST) -> str:
        """Return the code of an expression that must have a type."""
        if value.kind != kind:
            self._fail(node, f"found a value of type {value.kind.cpp}, expected {kind.cpp}")
        return value.code

    def _truth(self, node: ast.expr, is_one: bool = False) -> Value:
        """Return a truth value, or one for each lane unless a branch is taken by it."""
        value, found = self._value(node), f"found {ast.unparse(node)}"
        if value.kind.form != "truth":
            self._fail(node, f"{found}, expected a truth value")
        if is_one and value.kind.size:
            self._fail(node, f"{found} in lanes (see any_lane), expected one truth value")
        return value

    def _alike(self, node: ast.expr, values: Sequence[Value]) -> tuple[Kind, list[str]]:
        """Return the type that values share in an expression, and their code converted to it."""
        kind = k.joined(*(value.kind for value in values))
        if kind is None:
            found = " and ".join(value.kind.cpp for value in values)
            expected = "numbers, or values of one type"
            self._fail(node, f"{ast.unparse(node)}: found {found}, expected {expected}")
        in_lanes = "py::in_all" if kind.form == "number" else "py::mask_in_all"
        cast = f"{in_lanes}<{kind.size}>" if kind.size else kind.cpp
        return kind, [code if one == kind else f"{cast}({code})" for code, one in values]

    def _value_Constant(self, node: ast.Constant) -> Value:
        if type(node.value) not in _NUMBERS:
            self._fail(node, f"found {node.value!r}, expected a number")
        return Value(literal(node.value), _NUMBERS[type(node.value)])

    def _value_Name(self, node: ast.Name) -> Value:
        if node.id in self._kinds:
            return Value(_local(node.id), self._kinds[node.id])
        value = self.program.constant(node.id, self._meaning(node), self.kernel.__module__)
        if value is None:
            self._fail(node, f"{node.id} is no variable, and no number of the module")
        return value

    def _value_Attribute(self, node: ast.Attribute) -> Value:
        number = self._meaning(node)
        if isinstance(number, float):
            return Value(literal(number), k.FLOAT)
        owner = self._value(node.value)
        kind = owner.kind.members.get(node.attr) if owner.kind.form != "tuple" else None
        if kind is None:
            self._fail(node, f"{ast.unparse(node.value)} has no field {node.attr}")
        is_element = owner.code.startswith("(&")
        before = f"{owner.code[2:-1]}." if is_element else f"{owner.code}->"
        return Value(f"{before}{node.attr}", kind)

    def _value_Subscript(self, node: ast.Subscript) -> Value:
        owner = self._value(node.value)
        places = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        for place in places:
            index = self._exact(self._value(place), k.INT, place)
            owner = self._element(owner, index, place, node)
        return owner

    def _element(self, owner: Value, index: str, place: ast.expr, node: ast.Subscript) -> Value:
        (code, kind), at = owner, f"{owner.code}[{index}]"
        number: Any = place.value if isinstance(place, ast.Constant) else None
        if kind.form == "tuple" and f"at{number}" in kind.members:
            return Value(f"{code}.at{number}", kind.item[number])
        if kind.form == "array" and kind.size > 1:
            return Value(at, k.array_of(kind.item, kind.size - 1))
        if kind.form not in ("array", "row"):
            items = "items by variable indices" if number is None else f"item {number!r}"
            elements = items if kind.form == "tuple" else "elements"
            self._fail(node, f"{ast.unparse(node.value)} has no {elements}")
        is_struct = kind.item.form == "struct"
        return Value(f"(&{at})" if is_struct else at, self.program.note(kind.item))

    def _value_BinOp(self, node: ast.BinOp) -> Value:
        kind, codes = self._alike(node, [self._value(node.left), self._value(node.right)])
        text = _OPERATORS.get(type(node.op))
        if isinstance(node.op, ast.Div) and kind == k.INT:
            kind, codes = k.FLOAT, [f"double({code})" for code in codes]
        is_whole = isinstance(node.op, ast.FloorDiv) and kind != k.INT
        is_in_lanes = isinstance(node.op, ast.Mod) and kind.size
        if text is None or kind.form != "number" or is_whole or is_in_lanes:
            self._fail(node, f"{ast.unparse(node)}: a kernel has no such operator of {kind.cpp}")
        return Value(text.format(*codes), kind)

    def _value_UnaryOp(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            code, kind = self._truth(node.operand)
            return Value(f"(!{code})", kind)
        code, kind = self._value(node.operand)
        if not isinstance(node.op, ast.USub) or kind.form != "number":
            self._fail(node, f"{ast.unparse(node)}: a kernel has no such operator of {kind.cpp}")
        return Value(f"(-{code})", kind)

    def _value_BoolOp(self, node: ast.BoolOp) -> Value:
        # Only truth values: of integers, Python would return one of the operands.
        kind, codes = self._alike(node, [self._truth(one) for one in node.values])
        return _chained("&" if isinstance(node.op, ast.And) else "|", codes, kind)

    def _value_Compare(self, node: ast.Compare) -> Value:
        values = [self._value(one) for one in (node.left, *node.comparators)]
        kind, codes = self._alike(node, values)
        signs = [_COMPARISONS.get(type(operator)) for operator in node.ops]
        if None in signs or kind.form not in ("number", "truth"):
            self._fail(node, f"{ast.unparse(node)}: a kernel has no such comparison")
        pairs = zip(codes, signs, codes[1:], strict=False)
        parts = [f"{one} {sign} {other}" for one, sign, other in pairs]
        return _chained("&", parts, k.truth_of(kind))

    def _value_IfExp(self, node: ast.IfExp) -> Value:
        code, truth = self._truth(node.test)
        values = [self._value(node.body), self._value(node.orelse)]
        if truth.size:
            kind = k.lanes_of(truth.size)
            one, other = (self._alike(node, [value, Value("", kind)])[1][0] for value in values)
            return Value(f"py::select({code}, {one}, {other})", kind)
        kind, (one, other) = self._alike(node, values)
        return Value(f"({code} ? {one} : {other})", kind)

    def _value_Tuple(self, node: ast.Tuple) -> Value:
        values = [self._value(one) for one in node.elts]
        kind = self.program.note(k.tuple_of(value.kind for value in values))
        return Value(f"{kind.cpp}{{{', '.join(value.code for value in values)}}}", kind)

    def _value_Call(self, node: ast.Call) -> Value:
        if node.keywords or any(isinstance(one, ast.Starred) for one in node.args):
            self._fail(node, "expected arguments by position only")
        values = [self._value(one) for one in node.args]
        meaning = self._meaning(node.func)
        if meaning is len and values[0].kind.form == "array":
            return Value(f"{values[0].code}.extents[0]", k.INT)
        if callable(meaning) and meaning in _RULES:
            return self._call_by_rule(node, _RULES[meaning], values)
        if not is_kernel(meaning):
            name = ast.unparse(node.func)
            self._fail(node, f"{name} is no kernel, and no function that kernels may call")
        return self._call_of_kernel(node, meaning, values)

    def _call_by_rule(self, node: ast.Call, rule: Rule, values: list[Value]) -> Value:
        kinds, codes = [value.kind for value in values], [value.code for value in values]
        if not all(one.form in ("number", "truth") for one in kinds):
            self._fail(node, f"{ast.unparse(node)}: expected numbers")
        if rule.result is None:
            kind, codes = self._alike(node, values)
        else:
            kind = rule.result if isinstance(rule.result, Kind) else rule.result(*kinds)
        return Value(rule.text.format(*codes, all=", ".join(codes), kind=kind.cpp), kind)

    def _call_of_kernel(self, node: ast.Call, kernel: Kernel, values: list[Value]) -> Value:
        count = len(signature(kernel)[0])
        if count != len(values):
            self._fail(node, f"{kernel.__name__} is given {len(values)} of {count} arguments")
        function = self.program.function(kernel, tuple(value.kind for value in values))
        if function is None:
            self._fail(node, f"{kernel.__name__} calls itself")
        given = ", ".join(value.code for value in values)
        return Value(f"{function.name}({given})", function.returns)


def _chained(sign: str, codes: Sequence[str], kind: Kind) -> Value:
    """Return truth values joined by "and" or "or"; in lanes all of them are evaluated."""
    return Value(f"({f' {sign if kind.size else 2 * sign} '.join(codes)})", kind)
