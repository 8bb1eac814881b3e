#!/usr/bin/env python3
"""Interprets the Structured Text that to_structured_text writes (IEC 61131-3, only the subset of
it that is written, with strict types) and compares it with samples of the C++ object, bit for bit.

usage: structured_text.py BLOCK.st SAMPLES
SAMPLES: a line of input names, `:`, output names; then a line per call, numbers as hex floats, of
a struct the name of a function that fills it.
Prints the number of calls that were compared; the status is 1 at the first difference."""
import math
import re
import struct
import sys

TOKEN = re.compile(
    r"\s+|\(\*.*?\*\)|(?P<word>[A-Za-z_]\w*)|(?P<number>\d+(?:\.\d+(?:E[+-]?\d+)?)?(?!\.\w))"
    r"|(?P<sign>:=|<=|>=|<>|\.\.|[-+*/()<>=;:,\[\].])", re.S)
FLOATS = {"REAL", "LREAL", "a real number"}
COUNTS = {"UDINT", "UINT", "a whole number"}
STARTS = {"BOOL": False, "REAL": 0.0, "LREAL": 0.0, "UINT": 0, "UDINT": 0}
BITS = {"UINT": 16, "UDINT": 32}
MATH = {"ABS": "abs", "SQRT": "root", "EXP": "math.exp", "EXPT": "math.pow", "SIN": "sine",
        "ATAN": "math.atan"}
# Of all words of the language those that are likely in what is written.
KEYWORDS = set("""IF THEN ELSIF ELSE END_IF FOR TO BY DO END_FOR WHILE END_WHILE REPEAT UNTIL EXIT
    CASE OF END_CASE RETURN TRUE FALSE AND OR XOR NOT MOD SEL VAR VAR_INPUT VAR_OUTPUT VAR_IN_OUT
    END_VAR FUNCTION END_FUNCTION FUNCTION_BLOCK END_FUNCTION_BLOCK PROGRAM TYPE END_TYPE STRUCT
    END_STRUCT ARRAY AT STEP ACTION TASK WITH ON CONSTANT RETAIN LIMIT MIN MAX MUX SHL SHR ROL ROR
    LEFT RIGHT MID LEN CONCAT INSERT DELETE REPLACE FIND MOVE TRUNC LN LOG SIN COS TAN ADD SUB MUL
    DIV GT GE EQ LE LT NE TIME DATE TOD DT BYTE WORD DWORD SINT INT DINT STRING EN ENO""".split()
               ) | set(STARTS) | set(MATH)


def tokens(text):
    found, at = [], 0
    while at < len(text):
        match = TOKEN.match(text, at)
        if not match:
            sys.exit(f"no token of the subset: {text[at:at + 40]!r}")
        at = match.end()
        if match.lastgroup:
            token = match.group(match.lastgroup)
            upper = token.upper()  # names of any case are the same
            found.append(token.lower() if match.lastgroup == "word" and upper not in KEYWORDS
                         else upper)
    return found


# ---- What the compiled text calls.

def rounded(x):
    """x as REAL."""
    if math.isnan(x) or math.isinf(x):
        return x
    try:
        return struct.unpack("f", struct.pack("f", x))[0]
    except OverflowError:
        return math.copysign(math.inf, x)


def divided(a, b):
    if b == 0.0:
        if a == 0.0 or math.isnan(a):
            return math.nan
        return math.copysign(math.inf, a) * math.copysign(1.0, b)
    return a / b


def root(x):
    return math.sqrt(x) if x >= 0.0 else math.nan


def sine(x):
    return math.sin(x) if math.isfinite(x) else math.nan


def counted(x, bits):
    assert 0 <= x < 1 << bits, "a count out of its range"
    return x


class Values:
    """Variables of a block or a call, or a struct."""


class Array(dict):
    """Numbers by their places."""

    def __setitem__(self, place, number):
        assert place in self, f"place {place} is out of range"
        super().__setitem__(place, number)


def clone(value):
    if isinstance(value, Array):
        return Array((place, clone(one)) for place, one in value.items())
    if isinstance(value, Values):
        new = Values()
        new.__dict__.update((name, clone(one)) for name, one in value.__dict__.items())
        return new
    return value


class Text:
    """Compiles the text to Python: a function each, with its variables in `v`."""

    def __init__(self, text):
        self.tokens, self.at = tokens(text), 0
        self.types, self.functions = {}, {}
        self.scope = {name: globals()[name] for name in (
            "math", "clone", "rounded", "divided", "root", "sine", "counted")}
        self.block = None
        while self.at < len(self.tokens):
            what = self.next()
            if what == "TYPE":
                self.type()
            elif what in ("FUNCTION", "FUNCTION_BLOCK"):
                self.unit(what)
            else:
                sys.exit(f"{what} where a type or a function is expected")

    # ---- Tokens.
    def peek(self):
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def next(self):
        self.at += 1
        return self.tokens[self.at - 1]

    def fail(self, what):
        sys.exit(f"{what}: {' '.join(self.tokens[max(self.at - 12, 0):self.at + 6])}")

    def expect(self, token):
        if self.next() != token:
            self.fail(f"{token} expected")

    def take(self, token):
        if self.peek() == token:
            self.at += 1
            return True
        return False

    def name(self):
        name = self.next()
        if name in KEYWORDS or not re.match(r"[a-z_]", name) or "__" in name or name[-1] == "_":
            self.fail(f"{name} can be no name")
        return name

    # ---- Declarations. A type: the name of a scalar, a dict of a struct, a tuple of an array.
    def type(self):
        name = self.name()
        self.expect(":")
        if self.take("STRUCT"):
            fields = {}
            while not self.take("END_STRUCT"):
                self.declaration(fields)
            self.types[name] = fields
        else:
            self.types[name] = self.kind()
        self.expect(";")
        self.expect("END_TYPE")

    def kind(self):
        name = self.next()
        if name != "ARRAY":
            return name if name in STARTS else self.types[name]
        ranges = []
        self.expect("[")
        while not ranges or self.take(","):
            low = int(self.next())
            self.expect("..")
            ranges.append(range(low, int(self.next()) + 1))
        self.expect("]")
        self.expect("OF")
        return (ranges, self.kind())

    def declaration(self, into):
        names = [self.name()]
        while self.take(","):
            names.append(self.name())
        self.expect(":")
        kind = self.kind()
        start = self.initial(kind) if self.take(":=") else self.start(kind)
        self.expect(";")
        for name in names:
            if name in into:
                self.fail(f"{name} is declared twice")
            into[name] = (kind, start)

    def start(self, kind):
        if isinstance(kind, tuple):
            places = [()]
            for one in kind[0]:
                places = [place + (i,) for place in places for i in one]
            return Array((place, self.start(kind[1])) for place in places)
        if isinstance(kind, dict):
            return self.filled(kind)
        return STARTS[kind]

    @staticmethod
    def filled(fields):
        new = Values()
        for name, (_, start) in fields.items():
            setattr(new, name, clone(start))
        return new

    def initial(self, kind):
        if isinstance(kind, tuple):
            all_of_it = self.start(kind)
            self.expect("[")
            for place in all_of_it:
                all_of_it[place] = self.initial(kind[1])
                if place != list(all_of_it)[-1]:
                    self.expect(",")
            self.expect("]")
            return all_of_it
        code, its = self.expression()
        return eval(self.given(code, its, kind), self.scope)  # a literal

    def unit(self, what):
        name = self.name()
        sections = {"VAR_INPUT": {}, "VAR_IN_OUT": {}, "VAR_OUTPUT": {}, "VAR": {}}
        self.result = None
        if what == "FUNCTION":
            self.expect(":")
            self.result = self.kind()
        while self.peek() in sections:
            section = sections[self.next()]
            while not self.take("END_VAR"):
                self.declaration(section)
        self.names, self.by_reference = {}, set(sections["VAR_IN_OUT"])
        for section in sections.values():
            for one, (kind, _) in section.items():
                if one in self.names or one in self.functions or one == name:
                    self.fail(f"{one} is something else, too")
                self.names[one] = kind
        if what == "FUNCTION":
            self.names[name] = self.result
        self.lines = [f"def {name}(v):"]
        self.statements(1, ("END_" + what,))
        self.next()
        self.lines.append("  return")
        exec("\n".join(self.lines), self.scope)
        body = self.scope[name]
        starts = {one: start for one, (_, start) in sections["VAR"].items()}
        whole = {one: start for one, start in starts.items() if clone(start) is not start}
        if what == "FUNCTION_BLOCK":
            self.block, self.kinds = body, self.names
            self.values = Values()
            for section in sections.values():
                for one, (_, start) in section.items():
                    setattr(self.values, one, clone(start))
            return
        result = self.start(self.result)

        def call(**given):
            v = Values()
            v.__dict__.update(starts, **given)
            for one, start in whole.items():
                setattr(v, one, clone(start))
            setattr(v, name, clone(result))
            body(v)
            return getattr(v, name)
        self.functions[name] = (self.result, {
            one: (kind, one in self.by_reference) for section in ("VAR_INPUT", "VAR_IN_OUT")
            for one, (kind, _) in sections[section].items()})
        self.scope["call_" + name] = call

    # ---- Statements.
    def line(self, depth, code):
        self.lines.append("  " * depth + code)

    def statements(self, depth, ends):
        before = len(self.lines)
        while self.peek() not in ends:
            if not self.take(";"):
                self.statement(depth)
        if len(self.lines) == before:
            self.line(depth, "pass")

    def condition(self):
        code, kind = self.expression()
        return self.given(code, kind, "BOOL")

    def statement(self, depth):
        word = self.next()
        if word == "IF":
            self.line(depth, f"if {self.condition()}:")
            self.expect("THEN")
            ends = ("ELSIF", "ELSE", "END_IF")
            self.statements(depth + 1, ends)
            while self.take("ELSIF"):
                self.line(depth, f"elif {self.condition()}:")
                self.expect("THEN")
                self.statements(depth + 1, ends)
            if self.take("ELSE"):
                self.line(depth, "else:")
                self.statements(depth + 1, ends)
            self.expect("END_IF")
        elif word == "WHILE":
            self.line(depth, f"while {self.condition()}:")
            self.expect("DO")
            self.statements(depth + 1, ("END_WHILE",))
            self.expect("END_WHILE")
        elif word == "FOR":
            name = self.name()
            self.expect(":=")
            low = self.given(*self.expression(), self.names[name])
            self.expect("TO")
            high = self.given(*self.expression(), self.names[name])
            self.expect("DO")
            self.line(depth, f"for v.{name} in range({low}, {high} + 1):")
            self.statements(depth + 1, ("END_FOR",))
            self.expect("END_FOR")
        elif word == "CASE":
            code, kind = self.expression()
            self.expect("OF")
            self.line(depth, f"case = {self.given(code, kind, 'UDINT')}")
            while not self.take("END_CASE"):
                self.line(depth, f"if case == {int(self.next())}:")
                self.expect(":")
                while self.peek() != "END_CASE" and not self.peek().isdigit():
                    self.statement(depth + 1)
        elif word == "RETURN":
            self.line(depth, "return")
        else:
            self.at -= 1
            obj, key, kind = self.place()
            self.expect(":=")
            value = self.given(*self.expression(), kind)
            whole = isinstance(kind, (dict, tuple))
            if whole:
                value = f"clone({value})"
            if not self.is_reference(obj, key):
                self.line(depth, f"{self.read(obj, key)} = {value}")
            elif whole:
                self.line(depth, f"v.{key}.__dict__.update({value}.__dict__)")
            else:
                self.line(depth, f"setattr(*v.{key}, {value})")
        self.expect(";")

    # ---- Expressions: Python and its type.
    def given(self, code, kind, wanted):
        """The value where one of a type is wanted."""
        if kind == "a real number" and wanted in ("REAL", "LREAL"):
            if wanted == "LREAL":
                return code
            return repr(rounded(float(code))) if "(" not in code else f"rounded({code})"
        if kind is wanted or kind == wanted or (kind == "a whole number" and wanted in COUNTS):
            return code
        return self.fail(f"{kind} given where {wanted} is wanted")

    def expression(self):
        return self.of_conditions(("OR",), lambda: self.of_conditions(("AND",), self.equality))

    def of_conditions(self, words, operand):
        code, kind = operand()
        while self.peek() in words:
            word = self.next()
            right = operand()
            if kind == "DWORD" and right[1] == kind:
                code = f"({code} {'|' if word == 'OR' else '&'} {right[0]})"
                continue
            # Both sides are computed: a language may or may not do so.
            code = (f"({self.given(code, kind, 'BOOL')} {'|' if word == 'OR' else '&'} "
                    f"{self.given(*right, 'BOOL')})")
        return code, kind

    def alike(self, left, right):
        kinds = [left[1], right[1]]
        literals = ("a whole number", "a real number")
        kind = kinds[0] if kinds[0] not in literals else kinds[1]
        return self.given(*left, kind), self.given(*right, kind), kind

    def equality(self):
        return self.compared({"=": "==", "<>": "!="}, lambda: self.compared(
            {one: one for one in ("<", ">", "<=", ">=")}, self.total))

    def compared(self, signs, operand):
        left = operand()
        while self.peek() in signs:
            sign = self.next()
            a, b, _ = self.alike(left, operand())
            left = (f"({a} {signs[sign]} {b})", "BOOL")
        return left

    def total(self):
        return self.computed(("+", "-"), self.product)

    def product(self):
        return self.computed(("*", "/", "MOD"), self.unary)

    def computed(self, signs, operand):
        left = operand()
        while self.peek() in signs:
            sign = self.next()
            a, b, kind = self.alike(left, operand())
            if kind in FLOATS:
                code = f"divided({a}, {b})" if sign == "/" else f"({a} {sign} {b})"
                left = (f"rounded({code})" if kind == "REAL" else code, kind)
            elif kind in BITS:
                sign = {"/": "//", "MOD": "%"}.get(sign, sign)
                left = (f"counted({a} {sign} {b}, {BITS[kind]})", kind)
            else:
                self.fail(f"{sign} of {kind}")
        return left

    def unary(self):
        if self.take("-"):
            code, kind = self.unary()
            if kind not in FLOATS:
                self.fail(f"- of {kind}")
            return (f"-{code}" if kind == "a real number" else f"(-{code})", kind)
        if self.take("NOT"):
            return f"(not {self.given(*self.unary(), 'BOOL')})", "BOOL"
        return self.primary()

    def primary(self):
        token = self.peek()
        if self.take("("):
            inner = self.expression()
            self.expect(")")
            return inner
        if token[0].isdigit():
            self.next()
            return (repr(float(token)), "a real number") if "." in token else (
                str(int(token)), "a whole number")
        if token in ("TRUE", "FALSE"):
            self.next()
            return token.capitalize(), "BOOL"
        if self.tokens[self.at + 1] == "(":
            return self.call()
        obj, key, kind = self.place()
        return self.read(obj, key), kind

    def place(self):
        """What holds a value, its key there, and its type."""
        name = self.name()
        if name not in self.names:
            self.fail(f"{name} is not declared")
        obj, key, kind = "v", name, self.names[name]
        while self.peek() in (".", "["):
            if self.take("."):
                obj, key = self.read(obj, key), self.name()
                kind = kind[key][0]
                continue
            self.next()
            places = []
            while not places or self.take(","):
                places.append(self.given(*self.expression(), "UDINT"))
            self.expect("]")
            if len(places) != len(kind[0]):
                self.fail("an index of other dimensions")
            obj, key, kind = self.read(obj, key), f"[({', '.join(places)},)]", kind[1]
        return obj, key, kind

    def is_reference(self, obj, key):
        return obj == "v" and key in self.by_reference

    def read(self, obj, key):
        if key[0] == "[":
            return f"{obj}{key}"
        if self.is_reference(obj, key) and not isinstance(self.names[key], (dict, tuple)):
            return f"getattr(*v.{key})"
        return f"{obj}.{key}"

    def call(self):
        name = self.next()
        self.expect("(")
        if name == "SEL":
            condition = self.condition()
            self.expect(",")
            no = self.expression()
            self.expect(",")
            no, yes, kind = self.alike(no, self.expression())
            self.expect(")")
            return f"(({no}, {yes})[{condition}])", kind  # both are computed
        if name in MATH:
            code, kind = self.expression()
            while self.take(","):
                a, b, kind = self.alike((code, kind), self.expression())
                code = f"{a}, {b}"
            self.expect(")")
            if kind not in FLOATS:
                self.fail(f"{name} of {kind}")
            code = f"{MATH[name]}({code})"
            return (f"rounded({code})" if kind == "REAL" and name != "ABS" else code), kind
        if "_to_" in name and name not in self.functions:
            of, to = name.upper().split("_TO_")
            code = self.given(*self.expression(), of)
            self.expect(")")
            if of in COUNTS and to in FLOATS:
                code = f"float({code})" if to == "LREAL" else f"rounded(float({code}))"
            elif of in FLOATS and to in COUNTS:
                code = f"counted(int({code}), {BITS[to]})"
            elif of in COUNTS and to in COUNTS:
                code = f"counted({code}, {BITS[to]})"
            elif {of, to} == {"REAL", "LREAL"}:
                code = f"rounded({code})" if to == "REAL" else code
            elif {of, to} != {"UDINT", "DWORD"}:
                self.fail(f"{name} is no function of the subset")
            return code, to
        if name not in self.functions:
            self.fail(f"{name} is no function of the subset, or used before it is declared")
        result, parameters = self.functions[name]
        given = []
        while not self.take(")"):
            if self.tokens[self.at + 1] == ":=":
                one = self.name()
                self.expect(":=")
            else:  # without names: one alone
                one, = parameters
            kind, by_reference = parameters[one]
            if by_reference:
                obj, key, its = self.place()
                self.given("", its, kind)
                if isinstance(kind, (dict, tuple)):
                    value = self.read(obj, key)
                elif self.is_reference(obj, key):
                    value = f"v.{key}"
                else:
                    value = f"({obj}, '{key}')"
            else:
                value = self.given(*self.expression(), kind)
                if isinstance(kind, (dict, tuple)):
                    value = f"clone({value})"
            given.append(f"{one}={value}")
            self.take(",")
        if len(given) != len(parameters):
            self.fail(f"a call of {name} with {len(given)} arguments")
        return f"call_{name}({', '.join(given)})", result

    # ---- The block.
    def run(self):
        self.block(self.values)


def bits(value):
    return struct.pack("d", value) if isinstance(value, float) else value


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        text = Text(file.read())
    with open(sys.argv[2], encoding="utf-8") as file:
        inputs, outputs = (part.split() for part in file.readline().split(":"))
        calls = 0
        for line in file:
            numbers = line.split()
            for name, number in zip(inputs, numbers):
                kind = text.kinds[name]
                if isinstance(kind, dict):
                    value = getattr(text.values, name)
                    text.scope["call_" + number](settings=value)
                elif kind in FLOATS:
                    value = float.fromhex(number)
                else:
                    value = number == "1" if kind == "BOOL" else int(number)
                setattr(text.values, name, value)
            text.run()
            for name, number in zip(outputs, numbers[len(inputs):]):
                mine = getattr(text.values, name)
                its = float.fromhex(number) if isinstance(mine, float) else int(number)
                if bits(mine) != bits(its):
                    sys.exit(f"call {calls}: {name} is {mine}, in C++ {its}: {line}")
            calls += 1
    print(calls)


if __name__ == "__main__":
    main()
