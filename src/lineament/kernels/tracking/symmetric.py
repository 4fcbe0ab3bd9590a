"""Symmetric matrices of three lines: inverse, eigenvalues and eigenvectors."""

import math

from .. import helper

#: Sweeps of Jacobi's method, which converges quadratically.
_SWEEPS = 12
#: What is off the diagonal by less than this share of it is rounding.
_ROUNDING = 1e-17


@helper
def invert(matrix, inverse):
    """Invert a matrix by Cholesky; whether it is positive definite, else nothing is written."""
    a, p, q = matrix[0, 0], matrix[1, 0], matrix[2, 0]
    if not (a > 0.0 and math.isfinite(a)):
        return False
    # L, whose lower half is p, q, r, then its inverse.
    a = 1.0 / math.sqrt(a)
    p, q = p * a, q * a
    b = matrix[1, 1] - p * p
    if not (b > 0.0 and math.isfinite(b)):
        return False
    b = 1.0 / math.sqrt(b)
    r = (matrix[2, 1] - p * q) * b
    c = matrix[2, 2] - q * q - r * r
    if not (c > 0.0 and math.isfinite(c)):
        return False
    c = 1.0 / math.sqrt(c)
    q = (p * r * b - q) * a * c
    p, r = -p * a * b, -r * b * c
    inverse[0, 0], inverse[1, 1], inverse[2, 2] = a * a + p * p + q * q, b * b + r * r, c * c
    inverse[0, 1] = inverse[1, 0] = p * b + q * r
    inverse[0, 2] = inverse[2, 0] = q * c
    inverse[1, 2] = inverse[2, 1] = r * c
    return True


@helper
def diagonalise(matrix, vectors):
    """Turn a matrix until it is diagonal, by Jacobi's method; its eigenvectors are columns."""
    for k in range(3):
        for m in range(3):
            vectors[k, m] = 1.0 if k == m else 0.0
    for _ in range(_SWEEPS):
        turns = 0
        for p in range(2):
            for q in range(p + 1, 3):
                off, low, high = matrix[p, q], matrix[p, p], matrix[q, q]
                if off == 0.0 or not abs(off) > _ROUNDING * math.sqrt(abs(low * high)):
                    continue
                turns += 1
                ratio = 0.5 * (high - low) / off
                t = math.copysign(1.0, ratio) / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):
                    x, y = matrix[k, p], matrix[k, q]
                    matrix[k, p], matrix[k, q] = c * x - s * y, s * x + c * y
                for k in range(3):
                    x, y = matrix[p, k], matrix[q, k]
                    matrix[p, k], matrix[q, k] = c * x - s * y, s * x + c * y
                    x, y = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = c * x - s * y, s * x + c * y
                matrix[p, q] = matrix[q, p] = 0.0
        if turns == 0:
            return
