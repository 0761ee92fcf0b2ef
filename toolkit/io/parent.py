"""The prepared process: it has imported the decoders and forks a child for each file. See prepared.py.

It never decodes and has one thread, so that a fork of it is as good as new. Its standard input is a socket, each
message a request for child.py with three descriptors: the file for the answer, the child's line to the owner, and the
socket that becomes its standard error. The owner sees the child's end by that socket, which nobody else keeps.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import select
import signal
import socket
import sys
from typing import NamedTuple, NoReturn

from toolkit.io import child

_LONGEST_REQUEST = 1 << 17
# not OpenCV: it reads its limits, which are the file's, as it loads
_AHEAD = ("toolkit.io.plausible", "toolkit.io.raw", "rawpy", "exifread", "tifffile")


class _Child(NamedTuple):
    pid: int
    line: socket.socket


def main() -> None:
    """Import, then serve until the owner's end of the socket closes."""
    signal.pthread_sigmask(signal.SIG_SETMASK, ())  # whatever the owner's thread has blocked or ignores
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    for name in _AHEAD:
        with contextlib.suppress(Exception):  # the child that needs it will meet the same, and say so
            importlib.import_module(name)
    _serve(socket.socket(fileno=0))


def _serve(control: socket.socket) -> NoReturn:
    children: dict[int, _Child] = {}  # by their lines' descriptors
    poll = select.poll()
    poll.register(control, select.POLLIN)
    while True:
        for descriptor, _ in poll.poll():
            if descriptor in children:  # all that the owner says on a line is that it is done with the child
                poll.unregister(descriptor)
                _end(children.pop(descriptor))
                continue
            request, descriptors, *_ = socket.recv_fds(control, _LONGEST_REQUEST, 3)
            if not request:
                _end_all(children)
            answer, line, words = descriptors
            pid = os.fork()
            if pid == 0:
                _be_child(request.decode(), answer, words, [line, *children])
            os.close(answer)
            os.close(words)
            children[line] = _Child(pid, socket.socket(fileno=line))
            poll.register(line, select.POLLIN)


def _be_child(request: str, answer: int, words: int, lines: list[int]) -> NoReturn:
    """Decode as a fresh interpreter would: nothing at standard input, the answer at standard output."""
    try:
        os.dup2(answer, 1)
        os.dup2(words, 2)
        for descriptor in (0, answer, words, *lines):
            os.close(descriptor)
        os.open(os.devnull, os.O_RDONLY)  # takes 0, the lowest
        child.main(request)
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        os._exit(1)


def _end(ended: _Child) -> None:
    """Kill a child, which leaves one that has ended as it was, and tell its status."""
    os.kill(ended.pid, signal.SIGKILL)
    status = os.waitstatus_to_exitcode(os.waitpid(ended.pid, 0)[1])
    with ended.line, contextlib.suppress(OSError):  # the owner may have gone
        ended.line.send(str(status).encode())


def _end_all(children: dict[int, _Child]) -> NoReturn:
    for each in children.values():
        os.kill(each.pid, signal.SIGKILL)
    os._exit(0)
