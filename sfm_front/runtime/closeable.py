"""What holds threads or files, and is closed by ``with``."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TypeVar

T = TypeVar("T", bound="Closeable")


class Closeable(ABC):
    """``with`` gives the object itself and closes it at the end, whatever happened."""

    @abstractmethod
    def close(self) -> None: ...

    def __enter__(self: T) -> T:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
