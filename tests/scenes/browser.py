"""A real browser without a window, driven through its DevTools protocol: opens one page, runs JavaScript in it."""

from __future__ import annotations

import base64
import itertools
import json
import shutil
import subprocess
import time
from pathlib import Path

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--window-size=1280,900",
    "--remote-debugging-port=0",
    "--remote-allow-origins=*",
)
SOFTWARE_WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WITHOUT_WEBGL = ("--disable-3d-apis",)
PATIENCE = 60.0


def find_browser() -> str | None:
    """Return the path of Chromium or Chrome, None where there is none."""
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    return next((path for name in names if (path := shutil.which(name))), None)


class Browser:
    """A browser with an empty profile; `complaints` gathers what the page wrote to the console and its exceptions."""

    def __init__(self, profile: Path, webgl: bool = True) -> None:
        executable = find_browser()
        assert executable is not None
        command = [executable, *FLAGS, *(SOFTWARE_WEBGL if webgl else WITHOUT_WEBGL), f"--user-data-dir={profile}"]
        self.process = subprocess.Popen([*command, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self._ids = itertools.count(1)
        self._socket = self._connect(profile)
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def _connect(self, profile: Path):
        import urllib.request

        import websocket

        deadline = time.monotonic() + PATIENCE
        port = profile / "DevToolsActivePort"
        while True:
            assert time.monotonic() < deadline, "the browser does not start"
            assert self.process.poll() is None, "the browser stopped"
            if port.exists() and port.read_text().strip():
                with urllib.request.urlopen(f"http://127.0.0.1:{port.read_text().split()[0]}/json") as answer:
                    pages = [p for p in json.load(answer) if p["type"] == "page"]
                if pages:
                    return websocket.create_connection(pages[0]["webSocketDebuggerUrl"], timeout=PATIENCE)
            time.sleep(0.05)

    def call(self, method: str, **parameters):
        """Send a command and return its result; events that come meanwhile are noted."""
        number = next(self._ids)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv())
            if message.get("id") == number:
                assert "error" not in message, message["error"]
                return message["result"]
            self._note(message)

    def _note(self, message) -> None:
        kind, content = message.get("method"), message.get("params", {})
        if kind == "Runtime.exceptionThrown":
            self.complaints.append(content["exceptionDetails"]["text"])
        elif kind == "Runtime.consoleAPICalled" and content["type"] in ("error", "warning", "assert"):
            self.complaints.append(str([a.get("value") for a in content["args"]]))
        elif kind == "Log.entryAdded" and content["entry"]["level"] in ("error", "warning"):
            # Chromium's own remarks on reading pixels back from software WebGL are no fault of the page
            if "GL Driver Message" not in content["entry"]["text"]:
                self.complaints.append(content["entry"]["text"])
        elif kind == "Network.requestWillBeSent":
            self.requests.append(content["request"]["url"])

    def open(self, page: Path, wait_for: str) -> None:
        """Load a file and wait until an expression of the page is true."""
        self.call("Page.navigate", url=page.resolve().as_uri())
        self.wait(wait_for)

    def wait(self, expression: str) -> None:
        """Wait until an expression of the page is true."""
        deadline = time.monotonic() + PATIENCE
        while (
            self.value(f"(() => {{ try {{ return Boolean({expression}); }} catch {{ return false; }} }})()") is not True
        ):
            assert time.monotonic() < deadline, f"never true: {expression}; {self.complaints}"
            time.sleep(0.05)

    def value(self, expression: str):
        """Return the value of an expression of the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def mouse(self, kind: str, x: float, y: float, **more) -> None:
        """Send an event of the mouse: mousePressed, mouseMoved, mouseReleased or mouseWheel."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def drag(self, start, end, button: str = "left") -> None:
        """Press the mouse at a place of the window and release it at another."""
        pressed = {"button": button, "buttons": 1 if button == "left" else 2}
        self.mouse("mousePressed", *start, clickCount=1, **pressed)
        for t in (0.3, 0.7, 1.0):
            self.mouse("mouseMoved", *(a + t * (b - a) for a, b in zip(start, end, strict=True)), **pressed)
        self.mouse("mouseReleased", *end, clickCount=1, **pressed)

    def screenshot(self, path: Path) -> None:
        """Save what is seen."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def close(self) -> None:
        """End the browser."""
        self._socket.close()
        self.process.terminate()
        self.process.wait(PATIENCE)
