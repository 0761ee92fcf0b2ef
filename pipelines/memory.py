"""Memory that a process of ours keeps, in large pages: its first touch else costs as much as the sums on it.

By its own settings the GNU C library gives an array of a megabyte back to the system as soon as it is free, and takes
it anew, page by page of 4 KiB, for the next: some ten thousand times a fit. For processes of our own only: such memory
stays with them until they end.
"""

from __future__ import annotations

import ctypes
import platform
import sys

KEPT = 512 << 20  # bytes of address space: a photograph's pictures and more; nothing is taken before it is touched
LARGEST = 32 << 20  # bytes of an array that is kept; the library takes no higher threshold
PAGE = 2 << 20
M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD, MADV_HUGEPAGE = -1, -2, -3, 14  # malloc.h, linux/mman.h


def keep_memory() -> bool:
    """Let this process keep what it frees and begin with KEPT bytes of address space in large pages.

    False where the C library is another or the system has no such pages; then all is as it was, or as good as.
    """
    if sys.platform != "linux" or platform.libc_ver()[0] != "glibc":
        return False
    library = ctypes.CDLL(None, use_errno=True)
    library.malloc.restype = library.sbrk.restype = ctypes.c_void_p
    settings = {M_MMAP_THRESHOLD: LARGEST, M_TRIM_THRESHOLD: 2**31 - 1, M_TOP_PAD: KEPT}
    if not all(library.mallopt(name, value) for name, value in settings.items()):
        return False
    first = library.malloc(ctypes.c_size_t(LARGEST - PAGE)) or 0  # room beyond which the heap grows by KEPT
    library.free(ctypes.c_void_p(first))
    begin, end = -(-first // PAGE) * PAGE, (library.sbrk(ctypes.c_ssize_t(0)) or 0) // PAGE * PAGE
    if not 0 < end - begin <= 2 * KEPT:  # it was taken elsewhere
        return False
    return bool(library.madvise(ctypes.c_void_p(begin), ctypes.c_size_t(end - begin), MADV_HUGEPAGE) == 0)


def give_back_memory() -> None:
    """Give what this process keeps free back to the system, before a fork: else each side's first write to a page of it
    copies that page.
    """
    if sys.platform == "linux" and platform.libc_ver()[0] == "glibc":
        ctypes.CDLL(None).malloc_trim(ctypes.c_size_t(0))
