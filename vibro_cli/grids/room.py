"""Memory that is used again for chunk after chunk."""

from __future__ import annotations

from typing import Any

import numpy as np

from vibro_cli.grids.axes import Column
from vibro_cli.storage.files import BLOCK

# How much more of a block is reserved than is asked for: chunks differ in their rows.
_SPARE = 4


class Room:
    """Blocks of memory by name, each as large as was ever asked for; for one thread at a time.

    Fresh pages cost more time than what is written into them: for a chunk of impacts as much as
    encoding it.
    """

    def __init__(self) -> None:
        self._blocks: dict[str, Column] = {}

    def __call__(self, name: str, shape: tuple[int, ...], kind: type) -> Any:
        """Return an array without contents; it is good until the same name is asked for again."""
        size = int(np.prod(shape)) * np.dtype(kind).itemsize
        block = self._blocks.get(name)
        if block is None or block.nbytes < size:
            self._blocks.pop(name, None)
            # Pages that are not written to cost nothing.
            block = np.empty(_SPARE * size + BLOCK, dtype=np.uint8)
            block = block[-block.ctypes.data % BLOCK :]
            self._blocks[name] = block
        return block[:size].view(kind).reshape(shape)
