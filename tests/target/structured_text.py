#!/usr/bin/env python3
"""Interprets the Structured Text that to_structured_text writes (IEC 61131-3, only the subset of
it that is written) and compares it with samples of the C++ object, bit for bit.

usage: structured_text.py BLOCK.st SAMPLES
SAMPLES: a line of input names, `:`, output names; then a line per call, numbers as hex floats.
Prints the number of calls that were compared; the status is 1 at the first difference."""
import math
import re
import struct
import sys

TOKEN = re.compile(
    r"\s+|\(\*.*?\*\)|(?P<word>[A-Za-z_]\w*)|(?P<number>\d+(?:\.\d+(?:E[+-]?\d+)?)?(?!\.\w))"
    r"|(?P<sign>:=|<=|>=|<>|\.\.|[-+*/()<>=;:,\[\]])", re.S)


def tokens(text):
    found, at = [], 0
    while at < len(text):
        match = TOKEN.match(text, at)
        if not match:
            sys.exit(f"no token of the subset: {text[at:at + 40]!r}")
        at = match.end()
        if match.lastgroup:
            found.append(match.group(match.lastgroup))
    return found


def rounded(x):
    """x as REAL."""
    if math.isnan(x) or math.isinf(x):
        return x
    try:
        return struct.unpack("f", struct.pack("f", x))[0]
    except OverflowError:
        return math.copysign(math.inf, x)


def divided(a, b):
    if isinstance(a, int) and isinstance(b, int):
        return a // b
    if b == 0.0:
        if a == 0.0 or math.isnan(a):
            return math.nan
        return math.copysign(math.inf, a) * math.copysign(1.0, b)
    return a / b


class Block:
    def __init__(self, text):
        self.tokens, self.at = tokens(text), 0
        self.values, self.round = {}, (rounded if " REAL" in text else float)
        self.expect("FUNCTION_BLOCK")
        self.next()
        while self.peek() in ("VAR", "VAR_INPUT", "VAR_OUTPUT"):
            self.next()
            while self.peek() != "END_VAR":
                self.declaration()
            self.next()
        self.body = self.statements(("END_FUNCTION_BLOCK",))

    # ---- Tokens.
    def peek(self):
        return self.tokens[self.at]

    def next(self):
        self.at += 1
        return self.tokens[self.at - 1]

    def expect(self, token):
        found = self.next()
        if found != token:
            sys.exit(f"{token} expected, not {found}: {self.tokens[self.at - 6:self.at + 3]}")

    def take(self, token):
        if self.peek() == token:
            self.at += 1
            return True
        return False

    # ---- Declarations.
    def declaration(self):
        name = self.next()
        self.expect(":")
        kind = self.next()
        ranges = []
        if kind == "ARRAY":
            self.expect("[")
            while True:
                low = int(self.next())
                self.expect("..")
                ranges.append((low, int(self.next())))
                if not self.take(","):
                    break
            self.expect("]")
            self.expect("OF")
            kind = self.next()
        start = {"BOOL": False, "REAL": 0.0, "LREAL": 0.0, "UINT": 0, "UDINT": 0}[kind]
        given = []
        if self.take(":="):
            if self.take("["):
                while not self.take("]"):
                    given.append(self.expression()())
                    self.take(",")
            else:
                start = self.expression()()
        self.expect(";")
        if not ranges:
            self.values[name] = start
            return
        indices = [()]
        for low, high in ranges:
            indices = [i + (k,) for i in indices for k in range(low, high + 1)]
        assert len(indices) == len(given), name
        self.values[name] = dict(zip(indices, given))

    # ---- Statements: each a function without arguments.
    def statements(self, ends):
        todo = []
        while self.peek() not in ends:
            todo.append(self.statement())

        def run():
            for one in todo:
                one()
        return run

    def statement(self):
        word = self.next()
        if word == "IF":
            branches = []
            otherwise = lambda: None
            while True:
                condition = self.expression()
                self.expect("THEN")
                branches.append((condition, self.statements(("ELSIF", "ELSE", "END_IF"))))
                word = self.next()
                if word == "ELSE":
                    otherwise = self.statements(("END_IF",))
                    word = self.next()
                if word == "END_IF":
                    break
            self.expect(";")

            def choose():
                for condition, body in branches:
                    if condition():
                        return body()
                return otherwise()
            return choose
        if word == "REPEAT":
            body = self.statements(("UNTIL",))
            self.next()
            until = self.expression()
            self.expect("END_REPEAT")
            self.expect(";")

            def repeat():
                body()
                while not until():
                    body()
            return repeat
        index = self.index()
        self.expect(":=")
        value = self.expression()
        self.expect(";")
        if word not in self.values:
            sys.exit(f"{word} is not declared")

        def assign():
            if index:
                place = tuple(i() for i in index)
                assert place in self.values[word], (word, place)
                self.values[word][place] = value()
                return
            new = value()
            assert isinstance(new, bool) == isinstance(self.values[word], bool), word
            self.values[word] = new
        return assign

    # ---- Expressions, by precedence.
    def expression(self):
        return self.chain({"OR": lambda a, b: a or b}, lambda: self.chain(
            {"AND": lambda a, b: a and b}, self.comparison))

    def chain(self, operations, operand):
        left = operand()
        while self.peek() in operations:
            left = self.joined(operations[self.next()], left, operand())
        return left

    @staticmethod
    def joined(operation, left, right):
        return lambda: operation(left(), right())

    def comparison(self):
        return self.chain({"<": lambda a, b: a < b, ">": lambda a, b: a > b,
                           "<=": lambda a, b: a <= b, ">=": lambda a, b: a >= b,
                           "=": lambda a, b: a == b, "<>": lambda a, b: a != b}, self.total)

    def number(self, operation):
        def done(a, b):
            result = operation(a, b)
            return result if isinstance(result, int) else self.round(result)
        return done

    def total(self):
        return self.chain({"+": self.number(lambda a, b: a + b),
                           "-": self.number(lambda a, b: a - b)}, self.product)

    def product(self):
        return self.chain({"*": self.number(lambda a, b: a * b), "/": self.number(divided)},
                          self.unary)

    def unary(self):
        if self.take("-"):
            operand = self.unary()
            return lambda: -operand()
        if self.take("NOT"):
            operand = self.unary()
            return lambda: not operand()
        return self.primary()

    def index(self):
        places = []
        if self.take("["):
            while not self.take("]"):
                places.append(self.expression())
                self.take(",")
        return places

    def primary(self):
        token = self.next()
        if token == "(":
            inner = self.expression()
            self.expect(")")
            return inner
        if token[0].isdigit():
            number = self.round(float(token)) if "." in token else int(token)
            return lambda: number
        if token in ("TRUE", "FALSE"):
            return lambda: token == "TRUE"
        if self.take("("):
            arguments = []
            while not self.take(")"):
                arguments.append(self.expression())
                self.take(",")
            return self.function(token, arguments)
        if token not in self.values:
            sys.exit(f"{token} is not declared")
        index = self.index()
        if index:
            return lambda: self.values[token][tuple(i() for i in index)]
        return lambda: self.values[token]

    def function(self, name, arguments):
        if name == "SEL":
            condition, if_false, if_true = arguments
            return lambda: if_true() if condition() else if_false()
        known = {"ABS": abs, "SQRT": lambda x: math.sqrt(x) if x >= 0.0 else math.nan,
                 "EXP": math.exp, "EXPT": math.pow, "UINT_TO_REAL": float, "UINT_TO_LREAL": float}
        if name not in known:
            sys.exit(f"{name} is no function of the subset")

        def call():
            result = known[name](*(a() for a in arguments))
            return result if isinstance(result, int) else self.round(result)
        return call


def bits(value):
    return struct.pack("d", value) if isinstance(value, float) else value


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        block = Block(file.read())
    with open(sys.argv[2], encoding="utf-8") as file:
        inputs, outputs = (part.split() for part in file.readline().split(":"))
        calls = 0
        for line in file:
            numbers = line.split()
            for name, number in zip(inputs, numbers):
                old = block.values[name]
                block.values[name] = number == "1" if isinstance(old, bool) else float.fromhex(number)
            block.body()
            for name, number in zip(outputs, numbers[len(inputs):]):
                mine = block.values[name]
                its = float.fromhex(number) if isinstance(mine, float) else int(number)
                if bits(mine) != bits(its):
                    sys.exit(f"call {calls}: {name} is {mine}, in C++ {its}: {line}")
            calls += 1
    print(calls)


if __name__ == "__main__":
    main()
