"""A headless Chromium, driven by the Chrome DevTools Protocol over pipes: no package is needed for that."""

import base64
import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
OPTIONS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-dev-shm-usage")


class Browser:
    """One page; commands go in on descriptor 3, answers come out of 4, each ended by a zero byte."""

    def __init__(self, profile: Path, url: str) -> None:
        into, self._write = os.pipe()
        self._read, out = os.pipe()

        def descriptors() -> None:
            # First out of the way of each other, then to where Chromium looks for them.
            first, second = os.dup(into), os.dup(out)
            os.dup2(first, 3)
            os.dup2(second, 4)

        assert PROGRAM is not None
        self._process = subprocess.Popen(
            [PROGRAM, *OPTIONS, "--remote-debugging-pipe", f"--user-data-dir={profile}", "--window-size=1280,900"],
            preexec_fn=descriptors,
            close_fds=False,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(into)
        os.close(out)
        self._buffer, self._number, self._session = b"", 0, ""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.call("Page.enable")
        self.call("Page.navigate", url=url)

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        """Return the result of a command."""
        self._number += 1
        command: dict[str, Any] = {"id": self._number, "method": method, "params": params}
        if self._session:
            command["sessionId"] = self._session
        os.write(self._write, json.dumps(command).encode() + b"\0")
        while True:
            while b"\0" not in self._buffer:
                part = os.read(self._read, 1 << 16)
                if not part:
                    raise RuntimeError("Chromium ended")
                self._buffer += part
            message, _, self._buffer = self._buffer.partition(b"\0")
            answer = json.loads(message)
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(str(answer["error"]))
                return dict(answer["result"])

    def value(self, expression: str) -> Any:
        """Return the value of JavaScript on the page."""
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def wait(self, expression: str, holds: Callable[[Any], bool], seconds: float = 120.0) -> Any:
        """Wait until ``holds`` of the value, and return it."""
        end = time.monotonic() + seconds
        while not holds(value := self.value(expression)):
            if time.monotonic() > end:
                raise AssertionError(f"{expression}: {value!r} after {seconds:g} s")
            time.sleep(0.05)
        return value

    def screenshot(self, path: Path) -> None:
        """Write what the page looks like as PNG."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def close(self) -> None:
        """End the browser."""
        self._process.terminate()
        self._process.wait(10.0)
        os.close(self._write)
        os.close(self._read)
