"""Pairs of rows and columns, one to one, at the least total cost."""

import math

import numpy as np

from .. import helper


@helper
def assign(cost):
    """Give each row a column: the Hungarian method, by shortest augmenting paths (Kuhn 1955).

    `cost`, shape (m, n), is inf where it is not allowed; each row must be left with a column,
    whatever the others take. Returns the row of each column, or -1, shape (n,).
    """
    rows, columns = cost.shape
    owner, via = np.full(columns + 1, -1, np.int64), np.empty(columns + 1, np.int64)
    prices, price = np.zeros(rows), np.zeros(columns + 1)
    least, done = np.empty(columns + 1), np.empty(columns + 1, np.bool_)
    for i in range(rows):
        least[:], done[:] = math.inf, False
        # The row begins from a virtual column; from each next one, its owner looks further.
        last = columns
        owner[last] = i
        while owner[last] >= 0:
            done[last] = True
            row, nearest, following = owner[last], math.inf, last
            for j in range(columns):
                if not done[j]:
                    reduced = cost[row, j] - prices[row] - price[j]
                    if reduced < least[j]:
                        least[j], via[j] = reduced, last
                    if least[j] < nearest:
                        nearest, following = least[j], j
            # The prices of the rows that are reached rise, so that the nearest column is free.
            by = least[following]
            for j in range(columns + 1):
                if done[j]:
                    prices[owner[j]] += by
                    price[j] -= by
                else:
                    least[j] -= by
            last = following
        while last != columns:
            owner[last] = owner[via[last]]
            last = via[last]
        owner[columns] = -1
    return owner[:columns]
