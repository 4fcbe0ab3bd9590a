"""Pairs of rows and columns, one to one, at the least total cost."""

import math

from .. import helper

#: Rows of the scratch of whole numbers: the row of each column, or -1; the column before it on the
#: way; whether it is reached. And of floats: price of each row, and of each column; the least that
#: it takes to reach it.
OWNER, VIA, DONE = range(3)
PRICES, PRICE, LEAST = range(3)


@helper
def assign(cost, rows, columns, ints, floats):
    """Give each row a column: the Hungarian method, by shortest augmenting paths (Kuhn 1955).

    `cost`, of so many rows and columns, is inf where it is not allowed; each row must be left with
    a column, whatever the others take. Writes the row of each column, or -1, to OWNER. Both
    scratches have three rows, of one column more than that.
    """
    owner, via, done = ints[OWNER], ints[VIA], ints[DONE]
    prices, price, least = floats[PRICES], floats[PRICE], floats[LEAST]
    for j in range(columns + 1):
        owner[j], price[j], prices[j] = -1, 0.0, 0.0
    for i in range(rows):
        _reset(least, done)
        # The row begins beside all columns; from each next one, its owner looks further.
        last = columns
        owner[last] = i
        while owner[last] >= 0:
            done[last] = 1
            row = owner[last]
            following = _nearest(cost[row], prices[row], last, columns, ints, floats)
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


@helper
def _nearest(cost, own_price, last, columns, ints, floats):
    """Reach on from a row, whose column is `last`; the nearest column that was not reached."""
    via, done, price, least = ints[VIA], ints[DONE], floats[PRICE], floats[LEAST]
    nearest, following = math.inf, last
    for j in range(columns):
        if not done[j]:
            reduced = cost[j] - own_price - price[j]
            if reduced < least[j]:
                least[j], via[j] = reduced, last
            if least[j] < nearest:
                nearest, following = least[j], j
    return following


@helper
def _reset(least, done):
    """Nothing is reached."""
    for j in range(len(done)):
        least[j], done[j] = math.inf, 0
