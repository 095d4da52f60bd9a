"""The numbers that the paper prints: final Tr(P), mean and standard deviation over trials.

Source: Yang, Cao, Sartoretti 2023 (arXiv:2303.05351), Tables I to IV. Each is the mean over 30 instances x 10 trials;
the paper's "std" is read as the standard deviation over trials of the mean over instances (docs/protocol.md).
"""

from collections.abc import Mapping
from typing import NamedTuple


class Printed(NamedTuple):
    """One cell of a table of the paper."""

    mean: float
    std: float


Column = Mapping[float, Printed]  # by budget, domain units
Block = Mapping[str, Column]  # by the paper's name of the method


def _column(first_budget: int, *numbers: float) -> Column:
    """The cells of one line: mean, std, mean, std, ..., for budgets that rise by one."""
    pairs = zip(numbers[::2], numbers[1::2], strict=True)
    return {float(first_budget + i): Printed(*pair) for i, pair in enumerate(pairs)}


TABLE_1: Block = {
    "SGA+RRT(0.9, 1.0)": _column(2, 178.37, 6.66, 151.59, 3.44, 145.15, 6.47, 135.41, 6.74),
    "SGA+RRT(0.6, 0.7)": _column(2, 102.03, 3.80, 55.95, 3.51, 45.44, 1.80, 41.47, 3.21),
    "SGA+RRT(0.3, 0.4)": _column(2, 39.42, 1.91, 16.90, 1.10, 9.16, 0.65, 5.46, 0.41),
    "SGA+CAtNIPP": _column(2, 38.75, 3.05, 13.39, 0.91, 5.61, 0.34, 3.27, 0.29),
    "DI(8, 3)": _column(2, 37.43, 1.27, 11.55, 0.89, 4.56, 0.41, 2.82, 0.11),
    "TI(8, 5)": _column(2, 32.85, 2.07, 8.25, 0.61, 3.66, 0.27, 2.34, 0.10),
    "TI(8, 5)*": _column(2, 30.30, 1.26, 7.76, 0.34, 3.32, 0.24, 1.99, 0.16),
}

# The paper does not say which path lengths its SGA+RRT has here; (0.3, 0.4) is the best of Table I.
TABLE_2: Block = {
    "SGA+RRT(0.3, 0.4)": _column(2, 30.50, 1.79, 16.12, 1.33, 10.85, 0.88),
    "SGA+CAtNIPP": _column(2, 27.83, 3.45, 8.90, 1.17, 4.51, 0.30),
    "DI(8, 3)": _column(2, 23.86, 3.09, 7.14, 0.39, 3.81, 0.44),
    "TI(8, 5)*": _column(2, 19.39, 2.34, 5.87, 0.46, 3.07, 0.34),
}

TABLE_3: Block = {
    "DI(8, 3)": _column(3, 11.55, 0.89, 4.56, 0.41),
    "DI(8, 6)": _column(3, 12.53, 0.45, 4.81, 0.39),
    "DI(8, 9)": _column(3, 12.61, 0.91, 5.24, 0.45),
    "TI(8, 3)": _column(3, 9.65, 0.72, 3.94, 0.25),
    "TI(8, 6)": _column(3, 8.43, 0.48, 3.67, 0.21),
    "TI(8, 9)": _column(3, 8.92, 0.78, 3.91, 0.30),
}

TABLE_4_NEAR: Block = {  # communication range 0.3
    "SGA+RRT(0.3, 0.4)": _column(2, 99.53, 6.33, 52.29, 3.95, 26.82, 3.61),
    "SGA+CAtNIPP": _column(2, 65.62, 4.59, 25.35, 2.24, 11.11, 0.80),
    "DI(8, 3)": _column(2, 66.59, 3.57, 24.34, 1.99, 9.74, 0.59),
    "TI(8, 5)*": _column(2, 50.95, 2.34, 16.04, 1.82, 6.21, 0.27),
}

TABLE_4_FAR: Block = {  # communication range 0.6
    "SGA+RRT(0.3, 0.4)": _column(2, 54.96, 6.31, 26.75, 1.62, 17.86, 2.17),
    "SGA+CAtNIPP": _column(2, 54.02, 2.91, 20.16, 2.54, 8.87, 0.75),
    "DI(8, 3)": _column(2, 51.70, 3.72, 18.00, 1.73, 7.61, 1.07),
    "TI(8, 5)*": _column(2, 40.99, 3.07, 11.39, 0.65, 5.12, 0.65),
}

TABLE_4_GLOBAL: Block = {"TI(8, 5)*": _column(2, 30.30, 1.26, 7.76, 0.34, 3.32, 0.24)}


def best(block: Block, budget: float) -> float:
    """The lowest mean that the paper prints at this budget."""
    return min(column[budget].mean for column in block.values())
