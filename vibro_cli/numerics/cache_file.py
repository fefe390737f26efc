"""numba's cache with what it lacks: files that are checked before they are believed.

numba unpickles what it finds in a cache file and runs the machine code in it. Damaged by a full
disk or a broken network file system, such a file would end a run with an error, or with a crash.
Here every file ends with a digest of its content; one without, or with another, counts as missing.
"""

# numba says no types of its functions.
# mypy: disallow-untyped-calls=False

from __future__ import annotations

import contextlib
import hashlib
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

from vibro_cli.numerics.cache import tell

_DIGEST = hashlib.sha256
_LENGTH = _DIGEST().digest_size


def keep_in(folder: Path, dispatcher: Any) -> None:
    """Have the machine code of a numba dispatcher kept in a folder, wherever its source file is.

    The folder is to be one for this processor, these versions, and the sources of whatever the
    function calls; its own source file is looked at here.
    """

    class Place:
        """Answers numba's questions where files go and what they depend on."""

        def __init__(self, source: str) -> None:
            self.source = Path(source)

        @classmethod
        def from_function(cls, function: Any, source: str) -> Any:
            return cls(source)

        def ensure_cache_path(self) -> None:
            folder.mkdir(parents=True, exist_ok=True)

        def get_cache_path(self) -> str:
            return str(folder)

        def get_source_stamp(self) -> str:
            return _DIGEST(self.source.read_bytes()).hexdigest()

        def get_disambiguator(self) -> str:
            function = dispatcher.py_func
            return f"{function.__module__}.{function.__code__.co_firstlineno}"

    class Implementation(CompileResultCacheImpl):
        _locator_classes: list[Any] = [Place]  # noqa: RUF012 (numba's own form)

    class Cache(_CheckedCache):
        _impl_class: Any = Implementation

    dispatcher._cache = Cache(dispatcher.py_func)


class _CheckedCache(FunctionCache):
    """A cache of machine code that never is the reason for a failure."""

    kept = True
    """Whether what was compiled last could be saved, if anything was."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = _CheckedFile(
            self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp()
        )

    def save_overload(self, signature: Any, data: Any) -> None:
        try:
            super().save_overload(signature, data)
        except OSError as error:
            self.kept = False
            tell(f"compiled kernels cannot be kept in {self._cache_path} ({error.strerror})")


class _CheckedFile(IndexDataCacheFile):
    """The index and the data files of one function; pickles end before the digest after them."""

    @contextlib.contextmanager
    def _open_for_write(self, path: str) -> Iterator[io.BytesIO]:
        content = io.BytesIO()
        yield content
        with super()._open_for_write(path) as file:
            file.write(content.getvalue() + _DIGEST(content.getvalue()).digest())

    def _load_index(self) -> dict[Any, str]:
        if not _is_sound(self._index_path):
            return {}
        return super()._load_index()  # type: ignore[no-any-return]

    def _load_data(self, name: str) -> Any:
        path = self._data_path(name)
        if not _is_sound(path):
            raise FileNotFoundError(path)  # numba's own word for machine code to be made
        return super()._load_data(name)


def _is_sound(path: str) -> bool:
    """Whether a file is there and as it was written; a damaged one is told about and removed."""
    try:
        with open(path, "rb") as file:
            content = file.read()
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError as error:
        tell(f"compiled kernels cannot be read: {path} ({error.strerror}); they are made anew")
        return False
    if _DIGEST(content[:-_LENGTH]).digest() == content[-_LENGTH:]:
        return True
    tell(f"compiled kernels are damaged: {path}; they are made anew, which takes a minute or two")
    with contextlib.suppress(OSError):
        os.unlink(path)
    return False
