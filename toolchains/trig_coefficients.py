#!/usr/bin/env python3
"""Prints the numbers in engine/geometry/trig.cpp: polynomial coefficients and the pieces of pi/2.

Each polynomial approximates a smooth function g of u = x^2 and is found by the Remez exchange algorithm in 60 digit
decimals, with the weight that makes the error of sin, cos or atan itself relative. Only Python's standard library.
"""
from decimal import Decimal as D, getcontext

getcontext().prec = 70


def series(term0, ratio, u):
    """Sum of a power series in u, given its first term and the ratio of successive terms."""
    total, term, n = D(0), D(term0), 0
    while abs(term) > D(10) ** -55:
        total += term
        n += 1
        term = term * ratio(n, u)
    return total


def sin_tail(u):  # (sin x / x - 1) / u
    return series(D(-1) / 6, lambda n, t: -t / ((2 * n + 2) * (2 * n + 3)), u)


def cos_tail(u):  # (cos x - 1 + u/2) / u^2
    return series(D(1) / 24, lambda n, t: -t / ((2 * n + 3) * (2 * n + 4)), u)


def atan_tail(u):  # (atan x / x - 1) / u
    total, power, n = D(0), D(-1), 0
    while abs(power) > D(10) ** -55:
        total += power / (2 * n + 3)
        power *= -u
        n += 1
    return total


def pi():
    def arctan_inverse(k):
        total, power, n = D(0), D(1) / k, 0
        while abs(power) > D(10) ** -69:
            total += power / (2 * n + 1) * (-1) ** n
            power /= k * k
            n += 1
        return total
    return 16 * arctan_inverse(5) - 4 * arctan_inverse(239)


def solve(matrix, right):
    n = len(right)
    rows = [list(row) + [value] for row, value in zip(matrix, right)]
    for i in range(n):
        pivot = max(range(i, n), key=lambda r: abs(rows[r][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        for r in range(n):
            if r != i:
                factor = rows[r][i] / rows[i][i]
                rows[r] = [a - factor * b for a, b in zip(rows[r], rows[i])]
    return [rows[i][n] / rows[i][i] for i in range(n)]


def cos_decimal(x):
    return 1 - x * x / 2 + x ** 4 * cos_tail(x * x)


def remez(g, weight, high, degree):
    """Coefficients of the polynomial p on [0, high] that minimises max |weight(u) (p(u) - g(u))|."""
    count = degree + 2
    points = [high / 2 * (1 - cos_decimal(PI * i / (count - 1))) for i in range(count)]
    points[-1] = high
    grid = [high * i / 800 for i in range(801)]
    grid_g = [g(u) for u in grid]
    grid_w = [weight(u) for u in grid]
    for _ in range(8):
        matrix = [[u ** k if k else D(1) for k in range(degree + 1)] + [D(-1) ** i / weight(u) if weight(u) else D(-1) ** i]
                  for i, u in enumerate(points)]
        solution = solve(matrix, [g(u) for u in points])
        coefficients, level = solution[:-1], abs(solution[-1])

        def p(u):
            value = D(0)
            for c in reversed(coefficients):
                value = value * u + c
            return value
        errors = [w * (p(u) - v) for u, v, w in zip(grid, grid_g, grid_w)]
        extrema, best = [], 0  # the largest error of each run of equal sign
        for i in range(1, len(grid) + 1):
            if i == len(grid) or (errors[i] > 0) != (errors[best] > 0):
                extrema.append(best)
                best = i
            elif abs(errors[i]) > abs(errors[best]):
                best = i
        while len(extrema) > count:
            extrema.pop(0 if abs(errors[extrema[0]]) < abs(errors[extrema[-1]]) else -1)
        if len(extrema) < count:
            break
        points = [grid[i] for i in extrema]
    worst = max(abs(e) for e in errors)
    return coefficients, worst


def show(name, result):
    coefficients, worst = result
    print(f"// {name}: weighted error {float(worst):.2e}")
    print(", ".join(float(c).hex() for c in coefficients))


PI = pi()
# A weight of u at u = 0 is 0: the polynomial is then free there; a small offset keeps it pinned.
EPS = D(10) ** -3
show("sin, |x| <= pi/4", remez(sin_tail, lambda u: u + EPS, (PI / 4) ** 2, 5))
show("cos, |x| <= pi/4", remez(cos_tail, lambda u: u * u + EPS, (PI / 4) ** 2, 5))
show("atan, |x| <= tan(pi/8)", remez(atan_tail, lambda u: u + EPS, (D(2).sqrt() - 1) ** 2, 10))

rest, pieces = PI / 2, []
for bits in (33, 33, 33, 53):
    exponent = 0
    while rest >= D(2) ** (exponent + 1):
        exponent += 1
    while rest < D(2) ** exponent:
        exponent -= 1
    unit = D(2) ** (exponent - bits + 1)
    piece = rest // unit * unit
    pieces.append(float(piece).hex())
    rest -= piece
print("// pi/2 in pieces of 33, 33, 33 and 53 bits:", ", ".join(pieces))
for text, value in (("2/pi", 2 / PI), ("pi", PI), ("pi/2", PI / 2), ("pi/4", PI / 4)):
    high = D(float(value))
    print(f"// {text}: {float(value).hex()} + {float(value - high).hex()}")
