"""Objects that hold threads or files and are closed by ``with``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TypeVar

T = TypeVar("T", bound="Closeable")


class Closeable(ABC):
    """``with`` returns the object itself and always closes it at the end."""

    @abstractmethod
    def close(self) -> None: ...

    def __enter__(self: T) -> T:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
