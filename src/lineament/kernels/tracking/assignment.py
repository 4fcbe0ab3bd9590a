"""Pairs of rows and columns, one to one, at the least total cost."""

import math

from .. import helper

#: The lines of `paths` (see `assign`).
PATHS = 3
_PRICE, _LEAST, _DONE = range(PATHS)


@helper
def assign(cost, paths, prices, via, owner):
    """Give each row a column: the Hungarian method, by shortest augmenting paths.

    Parameters
    ----------
    cost : float64 array, shape (m, n)
        inf where it is not allowed; each row must be left with a column, whatever the others take.
    paths : float64 array, shape (PATHS, n + 1 or more)
        Scratch.
    prices : float64 array, shape (m or more,)
        Scratch.
    via : int64 array, shape (n + 1 or more,)
        Scratch.
    owner : int64 array, shape (n + 1 or more,)
        Written: the row of each column, or -1.
    """
    rows, columns = cost.shape
    price = paths[_PRICE, : columns + 1]
    least, done = paths[_LEAST], paths[_DONE]
    for j in range(columns + 1):
        owner[j], price[j] = -1, 0.0
    for i in range(rows):
        prices[i] = 0.0
        for j in range(columns + 1):
            least[j], done[j] = math.inf, 0.0
        # The row begins from a column that is none; from each next one, its owner looks further.
        last = columns
        owner[last] = i
        while owner[last] >= 0:
            done[last] = 1.0
            following = _look(cost, owner[last], last, prices, price, least, done, via)
            _raise(least[following], owner, prices, price, least, done)
            last = following
        while last != columns:
            owner[last] = owner[via[last]]
            last = via[last]
    owner[columns] = -1


@helper
def _look(cost, row, column, prices, price, least, done, via):
    """Look from a row, reached by its column, for nearer ways; the nearest column not done."""
    nearest, following = math.inf, column
    for j in range(cost.shape[1]):
        if done[j] == 0.0:
            reduced = cost[row, j] - prices[row] - price[j]
            if reduced < least[j]:
                least[j], via[j] = reduced, column
            if least[j] < nearest:
                nearest, following = least[j], j
    return following


@helper
def _raise(by, owner, prices, price, least, done):
    """Raise the prices of the rows that are reached, so that the nearest column costs nothing."""
    for j in range(len(price)):
        if done[j] == 1.0:
            prices[owner[j]] += by
            price[j] -= by
        else:
            least[j] -= by
