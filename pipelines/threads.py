"""How many threads libraries take."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Libraries of numbers and pictures with a single thread each: ours keep the cores busy side by side.

    The products are small, so it is faster, and sums are the same on every machine; OpenCV's threads wait for each
    other, also for one that has no core.
    """
    import cv2
    from threadpoolctl import threadpool_limits

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(threads)
