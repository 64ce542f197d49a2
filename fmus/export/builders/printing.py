"""CasADi functions as text of another language: the walk through their instructions, scalar by scalar.

Every function becomes one of an array x of its arguments, one after the other, and an array y of its results,
with the same operations in the same order as in CasADi's own code.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from itertools import accumulate
from types import MappingProxyType
from typing import ClassVar, NamedTuple, TypeAlias

import casadi as cs

OF_A_TABLE = 2  # arguments of a look-up: the table, the place


class Load(NamedTuple):
    """An instruction of a scalar function: an argument, by its place, is read."""

    to: str
    place: int


class Store(NamedTuple):
    """An instruction of a scalar function: a result, by its place, is given."""

    place: int
    of: str


class Line(NamedTuple):
    """An instruction of a scalar function that is one line, what it assigns and what it reads."""

    to: str
    text: str
    of: Sequence[str] = ()


class Call(NamedTuple):
    """An instruction of a scalar function: another one is called.

    places: of those of the given scalars that are the calling function's own arguments. stored: places of
    results that nothing else needs, by number.
    """

    function: cs.Function
    given: Sequence[str]
    wanted: Sequence[str | None]
    places: Sequence[int | None]
    stored: Mapping[int, int] = MappingProxyType({})


Step: TypeAlias = Load | Store | Line | Call


class Printer(ABC):
    """Functions of a language for CasADi's, each written once, after what it calls, named by what it says."""

    start: ClassVar[str]  # of the functions' names

    def __init__(self) -> None:
        self.functions: dict[str, list[str]] = {}
        self.shapes: dict[str, tuple[int, int]] = {}  # of each function, how many arguments and results
        self.tables: dict[str, str] = {}
        self._names: dict[int, str] = {}
        self._kept: list[cs.Function] = []  # so that no other function gets the identity of one that is gone

    @abstractmethod
    def element(self, array: str, i: int) -> str:
        """An element of an array."""

    @abstractmethod
    def array(self, name: str, n: int) -> list[str]:
        """Lines that declare an array."""

    @abstractmethod
    def assigned(self, to: str, value: str) -> str:
        """The line that assigns a value."""

    @abstractmethod
    def constant(self, value: float) -> str:
        """A number."""

    @abstractmethod
    def called(self, name: str, given: Sequence[str], wanted: Sequence[str | None]) -> list[str]:
        """Lines that call a function with given scalars and assign those of its results that are wanted."""

    @abstractmethod
    def switch(self, calls: Sequence[str], n_in: int, n_out: int) -> list[str]:
        """A choice of one of several functions by the first argument, the last one where it names none."""

    @abstractmethod
    def rows(self, values: Sequence[float], place: str, n: int, to: str) -> list[str]:
        """n elements of a table one after the other from a place on, NaN where it has not so many."""

    @abstractmethod
    def operation(self, code: int, to: str, of: Sequence[str]) -> str:
        """The line that assigns the result of an operation; NotImplementedError where there is none."""

    def body(self, function: cs.Function) -> list[str]:
        """The lines of a function of arrays x and y; NotImplementedError if an operation has no text."""
        given = (function.sparsity_in(i) for i in range(function.n_in()))
        results = (function.sparsity_out(i) for i in range(function.n_out()))
        if not all(pattern.is_dense() for pattern in (*given, *results)):
            raise NotImplementedError(f"{function.name()} has sparse arguments or results")
        kinds: dict[str, Callable[[cs.Function], list[str]]] = {
            "SXFunction": self._scalars,
            "MXFunction": self._matrices,
            "Switch": self._switch,
        }
        if function.class_name() not in kinds:
            raise NotImplementedError(f"{function.name()} is a {function.class_name()}")
        return self.whole(function, kinds[function.class_name()](function))

    def whole(self, function: cs.Function, lines: list[str]) -> list[str]:
        """The lines of a function with what the language wants before and after them."""
        return lines

    def sequence(self, steps: Sequence[Step]) -> list[str]:
        """The lines of the instructions of a scalar function."""
        lines: list[str] = []
        for step in steps:
            if isinstance(step, Load):
                lines.append(self.assigned(step.to, self.element("x", step.place)))
            elif isinstance(step, Store):
                lines.append(self.assigned(self.element("y", step.place), step.of))
            elif isinstance(step, Call):
                lines += self.called(self.name(step.function), step.given, step.wanted)
            else:
                lines.append(step.text)
        return lines

    def name(self, function: cs.Function) -> str:
        """The name of a function's text, which is written if it is not there yet."""
        key = hash(function)
        if key not in self._names:
            body = self.body(function)
            name = f"{self.start}_{function.name()}_{digest(body)}"
            self._names[key], self.functions[name] = name, body
            self.shapes[name] = function.nnz_in(), function.nnz_out()
            self._kept.append(function)
        return self._names[key]

    def _scalars(self, function: cs.Function) -> list[str]:
        """An SX function: its instructions, one after the other."""
        first_in, first_out = _first(function)
        steps: list[Step] = []
        places: dict[int, int] = {}  # of the elements of w that are arguments still
        instructions = function.instructions_sx()
        for k in range(function.n_instructions()):
            code = function.instruction_id(k)
            to, of = function.instruction_output(k), function.instruction_input(k)
            if code == cs.OP_INPUT:
                places[to[0]] = first_in[of[0]] + of[1]
                steps.append(Load(self.element("w", to[0]), places[to[0]]))
                continue
            elif code == cs.OP_OUTPUT:
                steps.append(Store(first_out[to[0]] + to[1], self.element("w", of[0])))
            elif code == cs.OP_CONST:
                into = self.element("w", to[0])
                value = self.constant(float(function.instruction_constant(k)))
                steps.append(Line(into, self.assigned(into, value)))
            elif code == cs.OP_CALL:
                given = [self.element("w", i) for i in of]
                wanted = [self.element("w", i) if i >= 0 else None for i in to]
                own = [places.get(i) for i in of]
                steps.append(Call(instructions[k].which_function(), given, wanted, own))
            else:
                given = [self.element("w", i) for i in of]
                into = self.element("w", to[0])
                steps.append(Line(into, self.operation(code, into, given), given))
            for i in to if code != cs.OP_OUTPUT else ():
                places.pop(i, None)
        return [*self.array("w", function.sz_w()), *self.sequence(steps)]

    def _switch(self, function: cs.Function) -> list[str]:
        calls = [self.name(case) for case in _cases(function)]
        return self.switch(calls, function.nnz_in(), function.nnz_out())

    def _matrices(self, function: cs.Function) -> list[str]:
        """An MX function of dense matrices: each instruction gives an array of its own."""
        first_in, first_out = _first(function)
        lines: list[str] = []
        held: dict[int, list[str] | cs.DM] = {}  # elements of each place as expressions, or a constant
        for k in range(function.n_instructions()):
            code, node = function.instruction_id(k), function.instruction_MX(k)
            to, of = function.instruction_output(k), function.instruction_input(k)
            if code != cs.OP_OUTPUT and not node.is_dense():
                raise NotImplementedError(f"{function.name()} computes with sparse matrices")
            if code == cs.OP_OUTPUT:
                first = first_out[node.info()["ind"]] + node.info()["offset"]
                for i, value in enumerate(self._elements(held[of[0]])):
                    lines.append(self.assigned(self.element("y", first + i), value))
            elif code == cs.OP_INPUT:
                first = first_in[node.info()["ind"]] + node.info()["offset"]
                held[to[0]] = [self.element("x", first + i) for i in range(node.nnz())]
            elif code == cs.OP_CONST:
                held[to[0]] = node.to_DM()
            elif code == cs.OP_CALL:
                called = node.which_function()
                results = [self.element(f"t{k}_", i) for i in range(called.nnz_out())]
                given = [value for place in of for value in self._elements(held[place])]
                lines += self.array(f"t{k}_", called.nnz_out())
                lines += self.called(self.name(called), given, results)
                held |= _shared(results, _offsets(called.nnz_out, called.n_out()), to)
            elif code == cs.OP_VERTSPLIT and node.dep(0).shape[1] == 1:
                held |= _shared(self._elements(held[of[0]]), node.info()["offset"], to)
            elif (moved := self._moved(code, node, [held[i] for i in of])) is not None:
                held[to[0]] = moved
            else:
                lines += self.array(f"t{k}_", node.nnz())
                lines += self._computed(code, node, [held[i] for i in of], f"t{k}_")
                held[to[0]] = [self.element(f"t{k}_", i) for i in range(node.nnz())]
        return lines

    def _computed(self, code: int, node: cs.MX, of: list[list[str] | cs.DM], to: str) -> list[str]:
        """Lines that compute each element of an instruction."""
        if code == cs.OP_GETNONZEROS_PARAM and isinstance(of[0], cs.DM) and len(of) == OF_A_TABLE:
            inner = node.info().get("inner", {"start": -1})
            if inner["start"] != 0 or inner["step"] != 1:
                raise NotImplementedError("elements of a table are read one after the other only")
            return self.rows(of[0].nonzeros(), self._elements(of[1])[0], inner["stop"], to)
        parts = [self._elements(part) for part in of]
        if not all(len(part) in (1, node.nnz()) for part in parts):
            raise NotImplementedError(f"operation {code} of matrices has no text")
        each = ([part[i if len(part) > 1 else 0] for part in parts] for i in range(node.nnz()))
        return [self.operation(code, self.element(to, i), values) for i, values in enumerate(each)]

    def _moved(self, code: int, node: cs.MX, of: list[list[str] | cs.DM]) -> list[str] | None:
        """The elements of an instruction that only moves some; None for others."""
        if code == cs.OP_GETNONZEROS:
            given = self._elements(of[0])
            return [given[int(i)] for i in node.mapping().nonzeros()]
        if code == cs.OP_TRANSPOSE:
            (rows, columns), given = node.dep(0).shape, self._elements(of[0])
            return [given[i + j * rows] for i in range(rows) for j in range(columns)]
        if code == cs.OP_HORZCAT or (code == cs.OP_VERTCAT and node.shape[1] == 1):
            return [value for part in of for value in self._elements(part)]
        return self._elements(of[0]) if code == cs.OP_RESHAPE else None

    def _elements(self, of: list[str] | cs.DM) -> list[str]:
        return of if isinstance(of, list) else [self.constant(float(v)) for v in of.nonzeros()]


def digest(lines: Sequence[str]) -> str:
    """A short hash of lines."""
    return sha256("\n".join(lines).encode()).hexdigest()[:12]


def number(value: float, nan: str, infinite: str) -> str:
    """A number, read back to the last bit; `nan` and `infinite` are the words for what is not finite."""
    if math.isfinite(value):
        return repr(value)
    return nan if math.isnan(value) else infinite if value > 0 else f"-{infinite}"


def _cases(function: cs.Function) -> list[cs.Function]:
    """A switch's functions in the order of their cases, the default last."""
    about = function.info()
    if about["project_in"] or about["project_out"]:
        raise NotImplementedError(f"the cases of {function.name()} differ in their sparsity")
    return [*about["f"], about["f_def"]]


def _offsets(sizes: Callable[[int], int], n: int) -> list[int]:
    """Where each of n arguments or results begins if they stand one after the other, and the end."""
    return [0, *accumulate(sizes(i) for i in range(n))]


def _first(function: cs.Function) -> tuple[list[int], list[int]]:
    """Where each argument of a function begins, and each result."""
    return _offsets(function.nnz_in, function.n_in()), _offsets(function.nnz_out, function.n_out())


def _shared(elements: list[str], at: Sequence[int], to: Sequence[int]) -> dict[int, list[str] | cs.DM]:
    """Elements by the place of each part, which begins and ends at these numbers."""
    return {place: elements[at[i] : at[i + 1]] for i, place in enumerate(to) if place >= 0}
