"""Blocks of rows, so that no array compares all samples with all templates at once."""

from __future__ import annotations

from collections.abc import Iterator

ROWS = 192
"""Rows of a block: with some hundred features, its cosines take as much as the templates."""
HELD_ROWS = 8 * ROWS
"""Rows of a block with a large fixed cost, as when covariances are factored for each block."""


def row_blocks(count: int, rows: int = ROWS) -> Iterator[slice]:
    """Yield slices of `rows` rows that cover `count` rows in order; the last has up to one more.

    Matrix products in blocks of rows equal the whole product to the bit if the library adds the
    terms of an element in the same order everywhere in the matrix. OpenBLAS does, except for
    products with a single row or column, which have their own routine, and for an odd row at the
    end. So blocks have an even number of rows, and only the last block of an odd total ends with
    such a row; a block has a single row only if there is no other row. In single precision, blocks
    must be multiples of 96 rows, like `ROWS`.
    """
    start = 0
    while start < count:
        # A single remaining row joins the block before it.
        stop = count if count - start <= rows + 1 else start + rows
        yield slice(start, stop)
        start = stop
