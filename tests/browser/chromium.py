"""A headless Chromium that tells what a page shows, what it complains of, and what it asks the network for."""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--hide-scrollbars",
    "--enable-logging=stderr",
    "--proxy-bypass-list=<-loopback>",
)
BROWSERS_OWN = ("clients2.google.com", "update.googleapis.com", "accounts.google.com")  # asked with a blank page too


@dataclass(frozen=True)
class Visit:
    """What came of opening a page: its document as text, messages of its console, lines that it asked a proxy for."""

    dom: str
    console: tuple[str, ...]
    requests: tuple[str, ...]


def visit(page: Path, folder: Path, *flags: str) -> Visit:
    """Open a file in a browser with a new profile in `folder`; skips the test where there is no Chromium."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("needs chromium: apt-get install chromium")
    profile = folder / "profile"
    with _proxy() as (port, requests):
        run = subprocess.run(
            [
                program,
                *FLAGS,
                f"--user-data-dir={profile}",
                f"--proxy-server=http://127.0.0.1:{port}",
                *flags,
                page.as_uri(),
            ],
            capture_output=True,
            text=True,
            timeout=120,
            check=True,
        )
    shutil.rmtree(profile, ignore_errors=True)
    console = re.findall(r"CONSOLE.*?\] (\".*)", run.stderr)
    asked = tuple(line for line in requests if not any(host in line for host in BROWSERS_OWN))
    return Visit(dom=run.stdout, console=tuple(console), requests=asked)


@contextmanager
def _proxy() -> Iterator[tuple[int, list[str]]]:
    """A proxy that notes the first line of each request and answers none."""
    noted: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=_listen, args=(server, noted), daemon=True)
        thread.start()
        yield server.getsockname()[1], noted
        server.shutdown(socket.SHUT_RDWR)
        thread.join(timeout=10)


def _listen(server: socket.socket, noted: list[str]) -> None:
    while True:
        try:
            client, _ = server.accept()
        except OSError:  # the server was shut down
            return
        with client:
            noted.append(client.recv(4096).split(b"\r\n")[0].decode("ascii", "replace"))
