"""A tab of a headless Chromium, spoken to over its debugging pipe: what scripts see, what the console says."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from .chromium import FLAGS

_TO_PIPES = (
    "import os, sys; os.dup2(int(sys.argv[1]), 3); os.dup2(int(sys.argv[2]), 4); os.execvp(sys.argv[3], sys.argv[3:])"
)
WATCHED = ("Page.enable", "Runtime.enable", "Log.enable", "Network.enable")
TELLING = ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded", "Page.javascriptDialogOpening")


@dataclass
class Tab:
    """One page. `told` is what its console, its errors and its dialogs said, `requests` what it asked for."""

    send: Any
    receive: Any
    session: str = ""
    number: int = 0
    told: list[dict[str, Any]] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    loaded: bool = False

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command of the protocol, and what it answers."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        self.send.write(json.dumps(message).encode() + b"\0")
        self.send.flush()
        while True:
            answer = self._next()
            if answer.get("id") == self.number:
                assert "error" not in answer, answer
                return dict(answer["result"])

    def _next(self) -> dict[str, Any]:
        data = bytearray()
        while (byte := self.receive.read(1)) != b"\0":
            assert byte, "the browser went away"
            data += byte
        message = json.loads(data)
        method, parameters = message.get("method"), message.get("params", {})
        if method in TELLING:
            self.told.append({"method": method, **parameters})
        if method == "Network.requestWillBeSent":
            self.requests.append(parameters["request"]["url"])
        self.loaded = self.loaded or method == "Page.loadEventFired"
        return dict(message)

    def open(self, page: Path) -> None:
        """Load a file and wait until all of it is there."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for method in WATCHED:
            self.call(method)
        self.loaded = False
        self.call("Page.navigate", url=page.as_uri())
        while not self.loaded:
            self._next()

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")


@contextmanager
def tab(page: Path, folder: Path) -> Iterator[Tab]:
    """A page in a new browser with a new profile in `folder`; skips the test where there is no Chromium."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("needs chromium: apt-get install chromium")
    (to_read, to_send), (to_receive, to_write) = os.pipe(), os.pipe()
    profile = folder / "profile"
    flags = [*FLAGS, "--remote-debugging-pipe", f"--user-data-dir={profile}", "--window-size=1500,1000"]
    words = [sys.executable, "-c", _TO_PIPES, str(to_read), str(to_write), program, *flags]
    silent = subprocess.DEVNULL
    with subprocess.Popen(words, pass_fds=(to_read, to_write), stdout=silent, stderr=silent) as browser:
        os.close(to_read)
        os.close(to_write)
        try:
            with os.fdopen(to_send, "wb") as send, os.fdopen(to_receive, "rb") as receive:
                opened = Tab(send, receive)
                opened.open(page)
                yield opened
        finally:
            browser.kill()
    shutil.rmtree(profile, ignore_errors=True)
