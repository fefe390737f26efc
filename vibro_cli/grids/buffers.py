"""Memory that is used again: fresh pages cost more time than what is written into them."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibro_cli.grids.axes import Array
from vibro_cli.storage.files import BLOCK

# Bytes of a block of which pieces are cut; larger pieces have blocks of their own.
_OF_PIECES = 1 << 25
# Pieces begin with a line of the processor's cache.
_LINE = 64


class Room:
    """Blocks of memory by name, each as large as was ever asked for; for one thread at a time."""

    def __init__(self) -> None:
        self._blocks: dict[str, Array] = {}

    def __call__(self, name: str, size: int) -> Array:
        """Return so many bytes; they are good until the same name is asked for again."""
        block = self._blocks.get(name)
        if block is None or block.nbytes < size:
            self._blocks.pop(name, None)
            # Pages that are not written to cost nothing; the next one may need some more.
            block = np.empty(2 * size + BLOCK, dtype=np.uint8)
            block = block[-block.ctypes.data % BLOCK :]
            self._blocks[name] = block
        return block[:size]


class Rooms:
    """Rooms that any thread may take and give back."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._spare: list[Room] = []

    def take(self) -> Room:
        """Return a room that nobody works in."""
        with self._lock:
            return self._spare.pop() if self._spare else Room()

    def give_back(self, room: Room) -> None:
        """Take back a room."""
        with self._lock:
            self._spare.append(room)


@dataclass(eq=False)
class _Block:
    memory: Array
    used: int = 0
    leases: int = 0


class Pieces:
    """Pieces of memory for one thread, one after another; any thread may give them back."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._block = _Block(np.empty(0, dtype=np.uint8))
        self._spare: list[_Block] = []

    def cut(self, size: int) -> tuple[Array, _Block]:
        """Return so many bytes, and what to give back once they are not needed any more."""
        with self._lock:
            if self._block.leases == 0:
                self._block.used = 0
            if self._block.used + size > self._block.memory.nbytes:
                self._block = self._another(size)
            block, begin = self._block, self._block.used
            block.used += -(-size // _LINE) * _LINE
            block.leases += 1
            return block.memory[begin : begin + size], block

    def _another(self, size: int) -> _Block:
        if self._block.leases == 0:
            self._spare.append(self._block)
        # The one used last may still be in the processor's cache.
        for block in reversed(self._spare):
            if block.memory.nbytes >= size:
                self._spare.remove(block)
                block.used = 0
                return block
        if self._spare:  # all of them are too small
            self._spare.remove(min(self._spare, key=lambda block: block.memory.nbytes))
        return _Block(np.empty(max(size + size // 4, _OF_PIECES), dtype=np.uint8))

    def give_back(self, block: _Block) -> None:
        """Take back a piece."""
        with self._lock:
            block.leases -= 1
            if block.leases == 0 and block is not self._block:
                self._spare.append(block)


class Lease:
    """Arrays of pieces, given back together."""

    def __init__(self, pieces: Pieces) -> None:
        self._pieces = pieces
        self._blocks: list[_Block] = []

    def __call__(self, shape: tuple[int, ...], kind: type) -> Any:
        """Return an array without contents."""
        size = int(np.prod(shape)) * np.dtype(kind).itemsize
        memory, block = self._pieces.cut(size)
        self._blocks.append(block)
        return memory.view(kind).reshape(shape)

    def give_back(self) -> None:
        """Give all arrays back: nobody must look at them any more."""
        while self._blocks:
            self._pieces.give_back(self._blocks.pop())
