"""What Eva is shown of a step: the same, with checks of single numbers where it checks a sum or a product.

Eva cannot look back from a number that is checked to those that it was made of. Four rules, each of
which refuses, or chooses, exactly what the C does:

- A step is refused unless a sum of |z| times positive factors is finite. It is not if one z is infinite
  or NaN, as no term is negative that could take that back. So each z is checked before the sum is made.
- A sum, difference or product is finite only if all that it is made of is: infinite minus infinite and
  zero times infinite are NaN. So the arguments of which such a z is made are checked, too.
- A choice by whether a * b is finite: it is only if a and b are. So they are checked, and what is chosen
  is computed behind that check.
- What `rest_at` has checked so is checked again behind its call in `start`: Eva forgets it on the way.

The check of the C stays, behind them.
"""

import ast
import re

CHECK = re.compile(r"^  const bool (t\d+) = is_finite\((.*)\);\n", re.M)
LINE = re.compile(r"^  const (?:float|double) (\w+) = (.*);\n", re.M)
CHOICE = re.compile(r"\(is_finite\(\((\w+) \* (\w+)\)\)\) \? (t\d+) :")


def parsed(text):
    return ast.parse(re.sub(r"\b(\d[\d.]*(?:e[+-]?\d+)?)f\b", r"\1", text).replace("->", "."),
                     mode="eval").body


def known(text):
    try:
        return parsed(text)
    except SyntaxError:  # a choice
        return None


def terms(node, made):
    """({names that are within magnitudes}, {made ones on the way}), or None if it is no such sum."""
    if isinstance(node, ast.Name):
        inside = terms(made.get(node.id), made)
        return inside and (inside[0], inside[1] | {node.id})
    if isinstance(node, ast.Constant):
        return (set(), set()) if node.value >= 0 else None
    if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("fabs", "fabsf"):
        inside = terms(node.args[0], made)
        name = isinstance(node.args[0], ast.Name)
        return inside or (({node.args[0].id}, set()) if name else None)
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Mult)):
        sides = terms(node.left, made), terms(node.right, made)
        if None in sides:
            return None
        factor = isinstance(node.right, ast.Constant) and node.right.value > 0
        if isinstance(node.op, ast.Add) or factor:
            return sides[0][0] | sides[1][0], sides[0][1] | sides[1][1]
    return None


def arguments(node, made):
    """The arguments of the function of which a number is made by sums and products."""
    if isinstance(node, ast.Name):
        return arguments(made[node.id], made) if node.id in made else {node.id}
    if isinstance(node, ast.UnaryOp):
        return arguments(node.operand, made)
    if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub, ast.Mult)):
        return arguments(node.left, made) | arguments(node.right, made)
    return set()


def one_by_one(function):
    made = {name: known(text) for name, text in LINE.findall(function)}
    for choice in CHOICE.finditer(function):
        first, second, chosen = choice.groups()
        line = re.search(rf"^  const \w+ {chosen} = (.*);\n", function, re.M)
        function = function.replace(
            choice[0], f"(is_finite({first}) && is_finite({second}) && "
            f"is_finite(({first} * {second}))) ? ({line[1]}) :")
    for check in CHECK.findall(function):
        if f"  if (!{check[0]}) {{\n    return false;\n" in function:
            function = before_check(function, *check, made)
    return function


def before_check(function, name, checked, made):
    found = terms(known(checked), made)
    if not found or not found[0]:
        return function
    at = function.index(f"  const bool {name} =")
    sum_of, before = "", function[:at]
    for line in LINE.finditer(before):
        if line[1] in found[1]:
            sum_of += line[0]
            before = before.replace(line[0], "")
    names = found[0].union(*(arguments(made.get(name), made) for name in found[0]))
    each = " && ".join(f"is_finite({name})" for name in sorted(names))
    return before + f"  if (!({each})) {{\n    return false;\n  }}\n" + sum_of + function[at:]


def for_eva(source):
    text = "".join(one_by_one(part) for part in re.split(r"(?<=^}\n)", source, flags=re.M))
    rest = re.search(r"^static bool rest_at\(.*?^}", text, re.S | re.M)
    if rest and "is_finite(u)" in rest[0]:
        text = text.replace("!rest_outside(o, y, u)", "!(rest_outside(o, y, u) && is_finite(u))")
    return text
