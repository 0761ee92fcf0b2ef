"""Children of a prepared process: one interpreter imports the decoders, then forks a child for each file.

A child is a process of its own, with limits of its own, but without the tenth of a second that start-up and imports
take. This process, the owner, has at most one prepared process, which a fork of the owner does not share. Its program
is parent.py: it never decodes, and ends when its socket does, with the owner. Each child has a line, a socket between
owner and prepared process: when that closes at the owner's end, for whatever reason, the child is killed.
"""

from __future__ import annotations

import atexit
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import IO

from toolkit.io import interpreter
from toolkit.io.interpreter import LAST_WORDS, Ending

_BOOT = "from toolkit.io.parent import main; main()"
_GRACE_S = 5.0  # for what takes the prepared process milliseconds


class NotPreparedError(Exception):
    """There is no prepared process, or it was lost on the way: the file is to be asked of a fresh interpreter."""


def run(request: str, answer: IO[bytes], wall_s: float) -> Ending:
    """How a fork of the prepared process ended that decoded what child.py is asked for into the file `answer`.

    Raises NotPreparedError. A child of a process that was lost may go on for a while, and write to `answer`.
    """
    if sys.platform != "linux":  # elsewhere system libraries may not survive a fork
        raise NotPreparedError
    until = time.monotonic() + wall_s
    parent = _own()
    try:
        with parent.child(request, answer) as (line, words):
            return _follow(line, words, until)
    except (OSError, EOFError) as error:
        _part_with(parent)
        if time.monotonic() >= until:  # no time is left for another to try
            return Ending(None, b"")
        raise NotPreparedError from error


def _follow(line: socket.socket, words: socket.socket, until: float) -> Ending:
    """What a child says, until it ends or its time is over, and how it ended."""
    said, ended = _listen(words, until)
    line.shutdown(socket.SHUT_WR)
    line.settimeout(_GRACE_S)
    status = line.recv(16)
    if not status:
        raise EOFError("the prepared process has ended")
    return Ending(int(status) if ended else None, said)


def _listen(words: socket.socket, until: float) -> tuple[bytes, bool]:
    """The last of a child's words, and whether it ended in time: it alone holds the other end."""
    kept = b""
    while (left := until - time.monotonic()) > 0:
        words.settimeout(left)
        try:
            chunk = words.recv(65_536)
        except TimeoutError:
            break
        if not chunk:
            return kept, True
        kept = (kept + chunk)[-LAST_WORDS:]
    return kept, False


class _Parent:
    """The prepared process, seen from its owner."""

    def __init__(self) -> None:
        self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._control.settimeout(_GRACE_S)
        with theirs:
            null = subprocess.DEVNULL
            self.process = interpreter.start(_BOOT, stdin=theirs.fileno(), stdout=null, stderr=null, apart=True)

    @contextmanager
    def child(self, request: str, answer: IO[bytes]) -> Iterator[tuple[socket.socket, socket.socket]]:
        """A new child's line, and what it writes to its standard error.

        Raises OSError where the prepared process has ended.
        """
        with ExitStack() as ours:
            with _lock:  # no fork copies the child's ends, no other thread closes the socket meanwhile
                line, far_line = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                words, far_words = socket.socketpair()
                ours.enter_context(line)
                ours.enter_context(words)
                with far_line, far_words:
                    far_ends = [answer.fileno(), far_line.fileno(), far_words.fileno()]
                    socket.send_fds(self._control, [request.encode()], far_ends)
            ours.callback(line.shutdown, socket.SHUT_RDWR)  # its closing is nothing to a fork that copied it since
            yield line, words

    def end(self) -> None:
        """Have it end, with its children."""
        with _lock:
            self._control.close()
        try:
            self.process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def disown(self) -> None:
        """Leave it to the process that this one was forked from."""
        self._control.close()
        self.process.returncode = 0  # not this process's child: nothing to wait for


_parent: _Parent | None = None
_lock = threading.RLock()  # held while this process forks, too: a fork gets no sockets that are on their way


def _own() -> _Parent:
    """This process's prepared process, started where there is none."""
    global _parent
    with _lock:
        if _parent is None:
            _parent = _Parent()
        return _parent


def _part_with(parent: _Parent) -> None:
    global _parent
    with _lock:
        if _parent is parent:
            _parent = None
    parent.end()


def end() -> None:
    """End this process's prepared process, if there is one; the next file has another started."""
    if _parent is not None:
        _part_with(_parent)


def _in_a_fork() -> None:
    global _parent
    if _parent is not None:
        _parent.disown()
        _parent = None
    _lock.release()


atexit.register(end)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_in_a_fork)
