"""Linear algebra on one thread, where several would wait for each other."""

import sys
from contextlib import AbstractContextManager
from functools import lru_cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager:
    """A context in which no library of linear algebra uses more than one thread."""
    return _libraries(len(sys.modules)).limit(limits=1)


@lru_cache(maxsize=1)
def _libraries(modules: int) -> ThreadpoolController:
    """The libraries in use; looked for anew, for 20 ms, where modules may have brought more of them."""
    return ThreadpoolController()
