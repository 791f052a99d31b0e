"""Cubic splines with two continuous derivatives, as docs/formats/plan-format.md, "Between the samples", defines them.

Values are complex, so that the two horizontal coordinates are one curve, and a multiplication rotates it about the
vertical. A column of real numbers uses the real part.
"""

import numpy as np


class Spline:
    """Spline through equally spaced values: one column for each curve."""

    def __init__(self, spacing, values, slopes):
        self.spacing, self.values, self.slopes = spacing, values, slopes

    @staticmethod
    def periodic(spacing, values, turn, shift):
        """Spline through one period of values: v(t + H) = turn * v(t) + shift, and both derivatives turn likewise."""
        values = np.asarray(values, dtype=complex)
        count = len(values)
        knots = np.vstack([values, turn * values[0] + shift])
        before = np.conj(turn) * (values[-1] - shift)
        matrix = 4 * np.eye(count, dtype=complex)
        rises = np.empty_like(values)
        for i in range(count):
            rises[i] = knots[i + 1] - (knots[i - 1] if i else before)
            # Neighbours beyond the ends are those of the next period, turned.
            matrix[i, (i + 1) % count] += turn if i + 1 == count else 1
            matrix[i, i - 1] += np.conj(turn) if i == 0 else 1
        slopes = np.linalg.solve(matrix, 3 / spacing * rises)
        return Spline(spacing, knots, np.vstack([slopes, turn * slopes[0]]))

    @staticmethod
    def clamped(spacing, values, first_slope, last_slope):
        """Spline with given slopes at both ends."""
        values = np.asarray(values, dtype=complex)
        count = len(values)
        matrix, rhs = np.eye(count, dtype=complex), np.empty_like(values)
        rhs[0], rhs[-1] = first_slope, last_slope
        for i in range(1, count - 1):
            matrix[i, i - 1 : i + 2] = 1, 4, 1
            rhs[i] = 3 / spacing * (values[i + 1] - values[i - 1])
        return Spline(spacing, values, np.linalg.solve(matrix, rhs))

    def at(self, time):
        """Value and slope. Beyond the ends, the curve is linear with the slope at the end."""
        h = self.spacing
        i = min(max(int(time / h), 0), len(self.values) - 2)
        u = time / h - i
        inside = min(max(u, 0.0), 1.0)
        rise = self.values[i + 1] - self.values[i]
        m0, m1 = self.slopes[i] * h, self.slopes[i + 1] * h
        c2, c3 = 3 * rise - 2 * m0 - m1, m0 + m1 - 2 * rise
        value = self.values[i] + inside * (m0 + inside * (c2 + inside * c3))
        slope = (m0 + inside * (2 * c2 + inside * 3 * c3)) / h
        return value + (u - inside) * h * slope, slope
