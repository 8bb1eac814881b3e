"""Proves of C that to_fixed_c wrote that one step after another cannot overflow.

Its `observe` is a list of sums, products and shifts. Each line is, in exact rational numbers, a linear
form of the states, of y and u, and of what the shifts before it left over, 0 .. 1. So it is at most the
sum of the magnitudes of its impulse responses, from states anywhere where a measurement after a gap
leaves them: for all sequences of y and u within their ranges. Nothing of it is rounded down.
"""

import re
from fractions import Fraction

WHOLE = 1 << 31  # what an int32_t does not hold
BITS = 160  # of what is summed up; what they cut off is added


def listed(pattern, text):
    return [int(one) for one in re.search(pattern, text).group(1).split(",")]


class Step:
    """The lines of `observe`, each with its form: {column: share}."""

    def __init__(self, source):
        body = re.search(r"static void observe\(.*?\)\n\{\n(.*?)\n\}", source, re.S).group(1)
        self.lines, self.sizes, self.whole, self.floors = {"y": {"y": Fraction(1)}, "u": {"u": Fraction(1)}}, [], [], {}
        self.next, self.rest_bits, self.left = {}, {}, {}
        body = re.sub(r"/\*.*?\*/", "", body).replace("\n      ", " ")
        for line in body.splitlines():
            line = line.strip()
            made = re.fullmatch(r"const int32_t (\w+) = (.*);", line)
            kept = re.fullmatch(r"o->(\w+)(?:\[(\d+)\])? = (\w+);", line)
            if made:
                self.lines[made.group(1)] = self.form(*made.groups())
            elif kept:
                name = kept.group(1) + (kept.group(2) or "")
                self.next[name] = self.lines[kept.group(3)]
                if name.startswith("rest"):
                    self.rest_bits[name] = self.left[kept.group(3)]
            elif line != "(void)u;":
                raise ValueError("no such line is known: " + line)

    def floor(self, of, form, added, bits):
        """floor((form + added) / 2^bits), less than it by 0 .. 1; the same for the same."""
        name = f"e{bits} {of} {added}"
        by = Fraction(1, 1 << bits)
        result = {column: share * by for column, share in form.items()}
        result["one"] = result.get("one", 0) + added * by
        result[name] = Fraction(-1)
        return result

    def form(self, name, text):
        got = re.fullmatch(r"o->(\w+?)(?:\[(\d+)\])?", text)
        if got:
            return {got.group(1) + (got.group(2) or ""): Fraction(1)}
        got = re.fullmatch(r"(\w+) ([+-]) ([a-z]\w*)", text)
        if got:
            a, sign, b = got.groups()
            result = dict(self.lines[a])
            for column, share in self.lines[b].items():
                result[column] = result.get(column, 0) + (share if sign == "+" else -share)
            return result
        got = re.fullmatch(r"(\w+) \* (-?\d+)", text)
        if got:
            return {column: share * int(got.group(2)) for column, share in self.lines[got.group(1)].items()}
        got = re.fullmatch(r"(\w+) >> (\d+)", text)
        if got:
            return self.floor(got.group(1), self.lines[got.group(1)], 0, int(got.group(2)))
        got = re.fullmatch(r"\((\w+) \+ (\d+)\) >> (\d+)", text)
        if got:
            self.whole.append((got.group(1), int(got.group(2))))
            return self.floor(got.group(1), self.lines[got.group(1)], int(got.group(2)), int(got.group(3)))
        got = re.fullmatch(r"\(int32_t\)\(\(uint32_t\)(\w+) & (\d+)u\)", text)
        if got:
            mask = int(got.group(2))
            bits = mask.bit_length()
            if mask + 1 != 1 << bits:
                raise ValueError("no mask: " + text)
            self.left[name] = bits
            return {f"e{bits} {got.group(1)} 0": Fraction(1 << bits)}
        got = re.fullmatch(r"\(\(int32_t\)\(int16_t\)\((\w+) >> 16\) \* (\d+)\) \+ \(int32_t\)"
                           r"\((\()?\(\(uint32_t\)\(uint16_t\)(\w+) \* (\d+)u\)(?: \+ (32768)u\))? >> 16\)", text)
        if got:
            a, factor, _, same, again, half = got.groups()
            # The halves of a are multiplied, each within 32 bits, and added: floor(factor a / 2^16).
            if a != same or factor != again or int(factor) > 32767:
                raise ValueError("no product: " + text)
            product = {column: share * int(factor) for column, share in self.lines[a].items()}
            return self.floor(a + factor, product, int(half or 0), 16)
        raise ValueError("no such expression is known: " + text)


class Trajectories:
    """All of them: powers of the step, exact, until hardly anything of a state is left."""

    def __init__(self, step, start):
        self.step = step
        self.names = sorted(step.next)
        self.start = start  # the most of each state at first
        self.columns = sorted({c for form in [*step.lines.values()] for c in form} - set(self.names))
        weight = [start[name] + Fraction(1, 1 << 20) for name in self.names]
        a = [[step.next[i].get(j, Fraction(0)) for j in self.names] for i in self.names]
        self.b = [[step.next[i].get(c, Fraction(0)) for c in self.columns] for i in self.names]
        # Everything is a whole number of 2^-shift.
        shift = max(x.denominator.bit_length() - 1 for row in a + self.b for x in row)
        whole = [[int(x * (1 << shift)) for x in row] for row in a]
        now = [[int(i == j) for j in range(len(a))] for i in range(len(a))]
        self.rows, self.free, at = [], [], 0
        inputs = [[int(x * (1 << shift)) for x in row] for row in self.b]
        while True:
            # What is cut off is below 2^-BITS of each number.
            self.free.append([[self.cut(x, at) for x in row] for row in now])
            self.rows.append([[self.cut(sum(now[i][k] * inputs[k][c] for k in range(len(a))), at + shift)
                               for c in range(len(self.columns))] for i in range(len(a))])
            now = [[sum(now[i][k] * whole[k][j] for k in range(len(a))) for j in range(len(a))]
                   for i in range(len(a))]
            at += shift
            left = max(sum(Fraction(abs(self.cut(now[i][j], at)) + 1, 1 << BITS) * weight[j]
                           for j in range(len(a))) / weight[i] for i in range(len(a)))
            if left < Fraction(1, 1 << 24):
                break
            if len(self.rows) > 20000:
                raise ValueError("it does not decay")
        self.weight = weight
        self.tail = left / (1 - left)
        # The most that a state becomes in its weight before that.
        self.grows = max(sum(Fraction(abs(x) + 1, 1 << BITS) * w for x, w in zip(row, weight)) / weight[i]
                         for power in self.free for i, row in enumerate(power))
        # The most that an input does to a state in its weight, over all these samples.
        self.gain = [sum(max(Fraction(abs(row[i][c]) + 1, 1 << BITS) / weight[i] for i in range(len(a)))
                         for row in self.rows) for c in range(len(self.columns))]

    @staticmethod
    def cut(x, at):
        return x >> (at - BITS) if at > BITS else x << (BITS - at)

    def most(self, form, ranges):
        """Of a form, with y and u within their ranges, and what shifts leave over within 0 .. 1."""
        shares = [form.get(name, Fraction(0)) for name in self.names]
        bits = max([x.denominator.bit_length() - 1 for x in shares])
        c = [int(x * (1 << bits)) for x in shares]
        size = sum(abs(x) for x in c)
        up = down = Fraction(0)
        for k, column in enumerate(self.columns):
            positive = negative = 0
            for row in self.rows:
                value = sum(c[i] * row[i][k] for i in range(len(c)))
                if value > 0:
                    positive += value + size
                    negative += size if value < size else 0
                else:
                    negative += size - value
                    positive += size if -value < size else 0
            more = self.tail * sum(abs(x) * w for x, w in zip(shares, self.weight)) * self.gain[k]
            positive = Fraction(positive, 1 << (bits + BITS)) + more
            negative = Fraction(negative, 1 << (bits + BITS)) + more
            direct = form.get(column, Fraction(0))
            positive, negative = positive + max(direct, 0), negative + max(-direct, 0)
            low, high = ranges.get(column, (0, 1))
            up += high * positive - low * negative
            down += high * negative - low * positive
        # From the first states, within these samples or later.
        free = 0
        for row in self.free:
            value = [abs(sum(c[i] * row[i][j] for i in range(len(c)))) + size for j in range(len(c))]
            free = max(free, sum(v * self.start[name] for v, name in zip(value, self.names)))
        later = self.tail * self.grows * sum(abs(x) * w for x, w in zip(shares, self.weight))
        return max(up, down) + max(Fraction(free) / (1 << (bits + BITS)), later)


class Proof:
    """`beyond`: which lines may be too large, [(line, its most, what it may be)]."""

    def __init__(self, source):
        self.source = source
        self.reach = listed(r"unsigned predict_slowly[\s\S]*?most\[STATES\] = \{(.*?)\}", source)
        self.box = listed(r"unsigned correct_slowly[\s\S]*?most\[STATES\] = \{(.*?)\}", source)
        y, u = (int(re.search(rf"#define {name}(?:_U)? (\d+)", source).group(1)) for name in ("Y_MOST", "U_MOST"))
        self.y, self.u = y, u
        step = Step(source)
        self.rest_bits = step.rest_bits
        start = {f"x{i}": most for i, most in enumerate(self.box)}
        start.update({name: 0 for name in step.rest_bits})
        all_of = Trajectories(step, start)
        ranges = {"y": (-y, y), "u": (-u, u), "one": (1, 1)}
        self.beyond = []
        for name, form in step.lines.items():
            self.judge(name, all_of.most(form, ranges),
                       min([WHOLE - 1] + [WHOLE - 1 - added for of, added in step.whole if of == name]))
        for i, within in enumerate(self.reach):
            self.judge(f"x{i}", all_of.most({f"x{i}": Fraction(1)}, ranges), within)

    def judge(self, name, most, within):
        if most > within:
            self.beyond.append((name, int(most), within))

    def for_eva(self):
        """The C with that step replaced by all that it can give, and what it begins with to be shown."""
        lines = [f"  /*@ assert finite_{name}: {-most} <= {name} <= {most}; */" for name, most in (("y", self.y), ("u", self.u))]
        lines += [f"  o->x[{i}] = any_within({-most}, {most});" for i, most in enumerate(self.reach)]
        lines += [f"  o->{name} = any_within(0, {(1 << bits) - 1});" for name, bits in self.rest_bits.items()]
        head, body, rest = re.match(r"(.*?static void observe\(.*?\)\n\{\n)(.*?)(\n\}\n.*)", self.source, re.S).groups()
        head = head.replace("static void observe(", "int32_t any_within(int32_t low, int32_t high);\nstatic void observe(")
        shown = "".join(f"    /*@ assert finite_x{i}: {-most} <= o->x[{i}] <= {most}; */\n"
                        for i, most in enumerate(self.box))
        shown += "".join(f"    /*@ assert finite_{name}: o->{name} == 0; */\n" for name in self.rest_bits)
        for end in ("  (void)y;\n  return status;\n", "    o->gap = 0u;\n  } else {\n"):
            if rest.count(end) != 1:
                raise ValueError("not there once: " + end)
            rest = rest.replace(end, shown + end)
        # One comparison as uint32_t, which wraps, says the same as two, which Eva follows.
        for name, most in (("Y", self.y), ("U", self.u)):
            rest = re.sub(rf"\(\(uint32_t\)(\w+) \+ {name}_MOST_U\) (<=|>) {name}_TWICE",
                          lambda m: (f"({m[1]} <= {most}) && ({m[1]} >= {-most})" if m[2] == "<=" else
                                     f"({m[1]} > {most}) || ({m[1]} < {-most})"), rest)
        return head + "\n".join(lines) + rest
