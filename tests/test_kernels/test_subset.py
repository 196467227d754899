"""Every kernel stays in the subset that Numba compiles, CPython runs and Pyccel turns into C.

The checker knows what is allowed; everything else is outside. Each rule is one that broke a
translation or would hide an error there: Pyccel 2.2 fails on ``a = b = 0.0`` and on returning
another kernel's tuple, and folds ``x == x`` to true.
"""

import ast
from functools import cache
from pathlib import Path
from textwrap import dedent

import pytest

import strapdown

KERNELS = Path(strapdown.__file__).parent / "kernels"
FILES = sorted(p for p in KERNELS.rglob("*.py") if p.name not in ("__init__.py", "_jit.py"))

MATH_CONSTANTS = {"e", "inf", "nan", "pi", "tau"}
MATH_FUNCTIONS = {
    "acos", "asin", "atan", "atan2", "ceil", "copysign", "cos", "cosh", "exp", "expm1", "fabs",
    "floor", "fmod", "hypot", "isfinite", "isinf", "isnan", "log", "log10", "log1p", "sin",
    "sinh", "sqrt", "tan", "tanh",
}  # fmt: skip
BUILTINS = {"abs", "bool", "float", "int", "max", "min"}
SCALARS = {"bool", "float", "int"}
ARRAYS = {"Vec": 1, "IntVec": 1, "Mat": 2}
DECORATORS = ("kernel", "inlined_kernel")
FROM_JIT = {*DECORATORS, *ARRAYS}
OPERATORS = (
    ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod, ast.Pow, ast.BitAnd, ast.BitOr,
    ast.BitXor, ast.LShift, ast.RShift, ast.USub, ast.UAdd, ast.Not, ast.Invert, ast.And, ast.Or,
    ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE,
)  # fmt: skip


def arity(function):
    """Number of values that a function returns by its annotation; None if outside the subset."""
    returns = function.returns
    if isinstance(returns, ast.Constant) and returns.value is None:
        return 0
    if isinstance(returns, ast.Name) and returns.id in SCALARS:
        return 1
    if isinstance(returns, ast.Subscript) and ast.unparse(returns.value) == "tuple":
        parts = returns.slice.elts if isinstance(returns.slice, ast.Tuple) else [returns.slice]
        if all(isinstance(p, ast.Name) and p.id in SCALARS for p in parts):
            return len(parts)
    return None


@cache
def signatures():
    """Return arities of all kernels by module and name."""
    found = {}
    for path in FILES:
        name = ".".join(path.relative_to(KERNELS.parent.parent).with_suffix("").parts)
        functions = [n for n in ast.parse(path.read_text()).body if isinstance(n, ast.FunctionDef)]
        found[name] = {f.name: arity(f) for f in functions}
    return found


class Checker:
    """Collects what lies outside the subset, as (line, what)."""

    def __init__(self, tree, known):
        self.known, self.found = known, []
        self.constants, self.functions, self.modules = set(), {}, {}
        self.functions.update(
            {f.name: arity(f) for f in tree.body if isinstance(f, ast.FunctionDef)}
        )
        for index, node in enumerate(tree.body):
            self.module_level(node, index)

    def outside(self, node, what):
        self.found.append((getattr(node, "lineno", 0), what))

    # --- module level -----------------------------------------------------------------

    def module_level(self, node, index):
        if index == 0 and isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return
        if isinstance(node, ast.ImportFrom):
            self.import_from(node)
        elif isinstance(node, ast.FunctionDef):
            self.function(node)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if (
                len(targets) == 1
                and isinstance(targets[0], ast.Name)
                and self.constant(node.value)
            ):
                self.constants.add(targets[0].id)
            else:
                self.outside(node, "a module holds numbers only")
        else:
            self.outside(node, f"{type(node).__name__} at module level")

    def constant(self, node):
        """Whether an expression is made of numbers and earlier constants."""
        if isinstance(node, ast.Constant):
            return type(node.value) in (int, float, bool)
        if isinstance(node, ast.Name):
            return node.id in self.constants
        if isinstance(node, ast.BinOp):
            return self.constant(node.left) and self.constant(node.right)
        return isinstance(node, ast.UnaryOp) and self.constant(node.operand)

    def import_from(self, node):
        for alias in node.names:
            here = alias.asname or alias.name
            if node.module == "math" and alias.name in MATH_CONSTANTS:
                self.constants.add(here)
            elif node.module == "math" and alias.name in MATH_FUNCTIONS:
                self.functions[here] = 1
            elif node.module == "strapdown.kernels._jit" and alias.name in FROM_JIT:
                pass
            elif f"{node.module}.{alias.name}" in self.known:
                self.modules[here] = f"{node.module}.{alias.name}"
            elif alias.name in self.known.get(node.module or "", {}):
                self.functions[here] = self.known[node.module][alias.name]
            elif node.module in self.known and alias.name.isupper():
                self.constants.add(here)
            else:
                self.outside(node, f"import of {node.module}.{alias.name}")

    # --- functions --------------------------------------------------------------------

    def function(self, node):
        decorators = [ast.unparse(d) for d in node.decorator_list]
        if len(decorators) != 1 or decorators[0] not in DECORATORS:
            self.outside(node, f"{node.name} is not decorated with @kernel alone")
        a = node.args
        if a.posonlyargs or a.kwonlyargs or a.vararg or a.kwarg or a.defaults:
            self.outside(node, "arguments are plain and have no defaults")
        self.arrays, self.scalars = {}, set()
        for arg in a.args:
            kind = ast.unparse(arg.annotation) if arg.annotation else None
            if kind in ARRAYS:
                self.arrays[arg.arg] = ARRAYS[kind]
            else:
                self.scalars.add(arg.arg)
                if kind not in SCALARS:
                    self.outside(arg, f"argument {arg.arg} is not typed as scalar or array")
        self.returns = arity(node)
        if self.returns is None:
            self.outside(node, "result is not typed as None, scalar or tuple of scalars")
        # names may be read before the line that sets them, in a loop
        for part in ast.walk(node):
            if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
                self.scalars.add(part.id)
                if part.id in self.arrays:
                    self.outside(part, f"array {part.id} is given another meaning")
        body = node.body
        if isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            body = body[1:]
        self.block(body)

    def block(self, body):
        for statement in body:
            self.statement(statement)

    def statement(self, node):
        if isinstance(node, ast.Assign):
            if len(node.targets) != 1:
                self.outside(node, "chained assignment")
            self.assign(node.targets[0], node.value)
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            self.assign(node.target, node.value)
        elif isinstance(node, ast.AugAssign):
            self.target(node.target)
            self.operator(node.op, node)
            self.scalar(node.value)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            self.call(node.value, None)
        elif isinstance(node, ast.If):
            self.scalar(node.test)
            self.block(node.body + node.orelse)
        elif isinstance(node, ast.For) and not node.orelse:
            self.loop(node)
        elif isinstance(node, ast.While) and not node.orelse:
            self.scalar(node.test)
            self.block(node.body)
        elif isinstance(node, ast.Return):
            self.result(node)
        elif not isinstance(node, ast.Break | ast.Continue | ast.Pass):
            self.outside(node, f"statement {type(node).__name__}")

    def assign(self, target, value):
        if isinstance(target, ast.Tuple):
            for part in target.elts:
                self.target(part)
            if isinstance(value, ast.Call):
                self.call(value, len(target.elts))
            elif isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts):
                for part in value.elts:
                    self.scalar(part)
            else:
                self.outside(value, "a tuple is unpacked from a call or as many values")
        else:
            self.target(target)
            self.scalar(value)

    def target(self, node):
        if isinstance(node, ast.Subscript):
            self.subscript(node)
        elif not isinstance(node, ast.Name):
            self.outside(node, f"target {type(node).__name__}")

    def loop(self, node):
        source = node.iter
        plain = isinstance(source, ast.Call) and ast.unparse(source.func) == "range"
        if not plain or not isinstance(node.target, ast.Name) or source.keywords:
            self.outside(node, "a loop runs over range")
        else:
            for part in source.args:
                self.scalar(part)
        self.block(node.body)

    def result(self, node):
        if node.value is None:
            got = 0
        elif isinstance(node.value, ast.Tuple):
            got = len(node.value.elts)
            for part in node.value.elts:
                self.scalar(part)
        elif isinstance(node.value, ast.Call) and self.returns not in (0, 1):
            return self.outside(node, "a tuple is returned element by element")
        else:
            got = 1
            self.scalar(node.value)
        if got != self.returns:
            self.outside(node, f"{got} values returned, {self.returns} annotated")
        return None

    # --- expressions ------------------------------------------------------------------

    def scalar(self, node):
        """Check an expression that must be one number."""
        if isinstance(node, ast.Constant):
            if type(node.value) not in (int, float, bool):
                self.outside(node, f"constant {node.value!r}")
        elif isinstance(node, ast.Name):
            if node.id in self.arrays:
                self.outside(node, f"array {node.id} as a whole")
            elif node.id not in self.scalars | self.constants:
                self.outside(node, f"name {node.id} is not an argument, a local or a constant")
        elif isinstance(node, ast.BinOp):
            self.operator(node.op, node)
            self.scalar(node.left)
            self.scalar(node.right)
        elif isinstance(node, ast.UnaryOp):
            self.operator(node.op, node)
            self.scalar(node.operand)
        elif isinstance(node, ast.BoolOp):
            for part in node.values:
                self.scalar(part)
        elif isinstance(node, ast.Compare):
            self.compare(node)
        elif isinstance(node, ast.IfExp):
            for part in (node.test, node.body, node.orelse):
                self.scalar(part)
        elif isinstance(node, ast.Call):
            self.call(node, 1)
        elif isinstance(node, ast.Subscript):
            self.subscript(node)
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) in self.modules:
            if not node.attr.isupper():
                self.outside(node, f"{ast.unparse(node)} is not a constant")
        else:
            self.outside(node, f"expression {type(node).__name__}")

    def operator(self, op, node):
        if not isinstance(op, OPERATORS):
            self.outside(node, f"operator {type(op).__name__}")

    def compare(self, node):
        sides = [node.left, *node.comparators]
        for op, left, right in zip(node.ops, sides, sides[1:], strict=False):
            self.operator(op, node)
            if ast.dump(left) == ast.dump(right):
                self.outside(node, "comparison of a value with itself; use isnan")
        for side in sides:
            self.scalar(side)

    def call(self, node, wanted):
        """Check a call whose result is unpacked into `wanted` names, or dropped (None)."""
        name = node.func.id if isinstance(node.func, ast.Name) else None
        if name not in BUILTINS and name not in self.functions:
            self.outside(node, f"call of {ast.unparse(node.func)}")
        elif wanted is not None:
            returned = 1 if name in BUILTINS else self.functions[name]
            if returned != wanted:
                self.outside(node, f"{name} returns {returned} values, {wanted} are taken")
        if node.keywords:
            self.outside(node, "keyword in a call")
        for part in node.args:
            if not (isinstance(part, ast.Name) and part.id in self.arrays):
                self.scalar(part)

    def subscript(self, node):
        base, index = node.value, node.slice
        if isinstance(base, ast.Attribute):
            known = isinstance(base.value, ast.Name) and base.value.id in self.arrays
            if not (known and base.attr == "shape" and isinstance(index, ast.Constant)):
                self.outside(node, f"attribute {ast.unparse(base)}")
            return
        if not (isinstance(base, ast.Name) and base.id in self.arrays):
            self.outside(node, f"index into {ast.unparse(base)}, which is not an array argument")
            return
        parts = index.elts if isinstance(index, ast.Tuple) else [index]
        if len(parts) != self.arrays[base.id]:
            self.outside(node, f"{len(parts)} indices into {base.id} make a slice")
        for part in parts:
            self.scalar(part)


def outside(source):
    """Return what lies outside the subset, one sentence each."""
    checker = Checker(ast.parse(source), signatures())
    return [f"line {line}: {what}" for line, what in sorted(checker.found)]


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.relative_to(KERNELS).as_posix())
def test_kernel_file_stays_in_the_subset(path):
    assert outside(path.read_text()) == []


def test_there_are_kernel_files_to_check():
    assert {"quat.py", "smallmat.py"} <= {path.name for path in FILES}


# --- the checker itself ---------------------------------------------------------------

HEAD = """
from math import isnan, sin
from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels import status
from strapdown.kernels.quat import mul

SIZE = 2 * 3
"""
GOOD = """
@kernel
def f(x: Vec, p: Mat, a: float, n: int, ok: bool) -> tuple[float, float]:
    '''Text.'''
    s, t = 0.0, 1.0
    for i in range(x.shape[0]):
        if isnan(x[i]) or not a > 0.0:
            continue
        s += x[i] * p[i, SIZE - 1] if ok else abs(-a)
        p[i, 0], t = t, s
    w, u, v, z = mul(s, t, a, a, s, t, a, a)
    while n > 0:
        n //= 2 + status.GAP
    g(x, a)
    return sin(w + u), v * z

@kernel
def g(x: Vec, a: float) -> None:
    x[0] = a
    return
"""
BAD = {
    "slice": ("x[1:2] = a", "expression Slice"),
    "row of a matrix": ("x[0] = p[0]", "indices into p make a slice"),
    "keyword": ("g(x, a=a)", "keyword in a call"),
    "star": ("g(*x)", "expression Starred"),
    "list": ("b = [a, a]", "expression List"),
    "dict": ("b = {1: a}", "expression Dict"),
    "set": ("b = {a}", "expression Set"),
    "tuple kept": ("b = (a, a)", "expression Tuple"),
    "comprehension": ("b = sum(i for i in range(3))", "call of sum"),
    "list comprehension": ("b = [i for i in range(3)]", "expression ListComp"),
    "allocation": ("b = np.zeros(3)", "call of np.zeros"),
    "method": ("b = x.sum()", "call of x.sum"),
    "attribute": ("b = x.size", "expression Attribute"),
    "function of a module": ("status.f(a)", "call of status.f"),
    "variable of a module": ("b = status.last", "status.last is not a constant"),
    "whole shape": ("b = x.shape", "expression Attribute"),
    "whole array": ("b = x", "array x as a whole"),
    "array rebound": ("x = a", "array x is given another meaning"),
    "lambda": ("b = lambda: a", "expression Lambda"),
    "closure": ("def h() -> None:\n        pass", "statement FunctionDef"),
    "raise": ("raise ValueError", "statement Raise"),
    "try": ("try:\n        pass\n    finally:\n        pass", "statement Try"),
    "with": ("with a:\n        pass", "statement With"),
    "assert": ("assert a > 0.0", "statement Assert"),
    "global": ("global SIZE", "statement Global"),
    "delete": ("del a", "statement Delete"),
    "import inside": ("import math", "statement Import"),
    "print": ("print(a)", "call of print"),
    "f-string": ("b = f'{a}'", "expression JoinedStr"),
    "string": ("b = 'text'", "constant 'text'"),
    "None": ("b = None", "constant None"),
    "NaN by comparison": ("x[0] = 1.0 if a == a else 0.0", "comparison of a value with itself"),
    "NaN by element": ("x[0] = 1.0 if x[1] != x[1] else 0.0", "comparison of a value with itself"),
    "is": ("b = a is x[0]", "operator Is"),
    "in": ("b = a in x", "operator In"),
    "matrix product": ("b = p @ p", "operator MatMult"),
    "chained assignment": ("b = c = 0.0", "chained assignment"),
    "walrus": ("b = (c := a)", "expression NamedExpr"),
    "loop over array": ("for b in x:\n        pass", "a loop runs over range"),
    "loop else": ("for b in range(3):\n        pass\n    else:\n        pass", "statement For"),
    "unknown name": ("b = unknown", "name unknown is not"),
    "unknown function": ("b = cos(a)", "call of cos"),
    "wrong unpacking": ("b, c = mul(a, a, a, a, a, a, a, a)", "mul returns 4 values, 2 are taken"),
    "value returned": ("return a", "1 values returned, 0 annotated"),
    "yield": ("yield a", "statement Expr"),
}


def test_checker_accepts_the_subset():
    assert outside(HEAD + GOOD) == []


@pytest.mark.parametrize(("line", "message"), BAD.values(), ids=BAD.keys())
def test_checker_rejects(line, message):
    source = f"""
@kernel
def f(x: Vec, p: Mat, a: float) -> None:
    {line}

@kernel
def g(x: Vec, a: float) -> None:
    x[0] = a
"""
    assert any(message in found for found in outside(HEAD + source)), outside(HEAD + source)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("import numpy as np", "Import at module level"),
        ("from numpy import sin", "import of numpy.sin"),
        ("from math import gcd", "import of math.gcd"),
        ("from strapdown.units import DEG", "import of strapdown.units.DEG"),
        ("from strapdown.kernels.quat import missing", "import of strapdown.kernels.quat.missing"),
        ("TABLE = [1, 2]", "a module holds numbers only"),
        ("A = B = 1", "a module holds numbers only"),
        ("class State:\n    pass", "ClassDef at module level"),
        ("def f() -> None:\n    pass", "not decorated with @kernel alone"),
        ("@kernel\n@kernel\ndef f() -> None:\n    pass", "not decorated with @kernel alone"),
        ("@kernel\ndef f(a) -> None:\n    pass", "argument a is not typed"),
        ("@kernel\ndef f(a: list) -> None:\n    pass", "argument a is not typed"),
        ("@kernel\ndef f(a: float = 1.0) -> None:\n    pass", "have no defaults"),
        ("@kernel\ndef f(*a: float) -> None:\n    pass", "have no defaults"),
        ("@kernel\ndef f(a: float):\n    pass", "result is not typed"),
        ("@kernel\ndef f(x: Vec) -> Vec:\n    pass", "result is not typed"),
        (
            "@kernel\ndef f(a: float) -> tuple[float, float]:\n    return f(a)",
            "a tuple is returned element by element",
        ),
    ],
)
def test_checker_rejects_at_module_level(source, message):
    found = outside(dedent(HEAD) + source)
    assert any(message in line for line in found), found
