"""A headless Chromium, driven through the DevTools protocol over a pipe (chromium --remote-debugging-pipe).

Requests and answers are JSON objects that end with a zero byte, on the browser's file descriptors 3 and 4. That is all
there is to it, so no driver package has to keep pace with Debian's browser.
https://chromedevtools.github.io/devtools-protocol/
"""

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time

REMEDY = "run 'apt-get install --no-install-recommends chromium' as root, or set CHROMIUM=/path/to/chromium"


def find():
    """The browser's path. Raises FileNotFoundError, with the remedy, where there is none."""
    for name in [os.environ.get("CHROMIUM"), "chromium", "chromium-browser", "google-chrome"]:
        if name and shutil.which(name):
            return shutil.which(name)
    raise FileNotFoundError(f"the report's tests need Chromium: {REMEDY}")


class Page:
    """One page in a browser of its own, without a network. Use in a with statement."""

    def __init__(self, timeout=60):
        self.timeout = timeout
        self.events = []
        self._count = 0
        self._buffer = b""

    def __enter__(self):
        self._profile = tempfile.TemporaryDirectory(prefix="oted-chromium-", ignore_cleanup_errors=True)
        to_browser, self._write = os.pipe()
        self._read, from_browser = os.pipe()

        def connect():
            # dup2 onto 3 and 4 must not overwrite the other end's number first.
            ends = [os.dup(fd) if fd < 10 else fd for fd in (to_browser, from_browser)]
            high = [os.dup2(fd, 20 + i, inheritable=False) for i, fd in enumerate(ends)]
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        options = [
            "--headless=new", "--remote-debugging-pipe", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
            "--hide-scrollbars", "--disable-background-networking", "--disable-component-update", "--disable-sync",
            "--disable-extensions", "--host-resolver-rules=MAP * ~NOTFOUND", "--force-color-profile=srgb",
            f"--user-data-dir={self._profile.name}",
        ]
        if os.geteuid() == 0:
            options.append("--no-sandbox")  # which root cannot have; the page is our own
        self._browser = subprocess.Popen([find(), *options, "about:blank"], preexec_fn=connect, close_fds=False,
                                         stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                         stderr=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        return self

    def __exit__(self, *unused):
        self._browser.terminate()
        try:
            self._browser.wait(20)
        except subprocess.TimeoutExpired:
            self._browser.kill()
            self._browser.wait()
        os.close(self._write)
        os.close(self._read)
        self._profile.cleanup()

    def _receive(self, until):
        while b"\0" not in self._buffer:
            left = until - time.monotonic()
            if left <= 0 or not select.select([self._read], [], [], left)[0]:
                raise TimeoutError(f"no answer from Chromium within {self.timeout} s")
            part = os.read(self._read, 1 << 20)
            if not part:
                raise ConnectionError("Chromium ended; run it by hand to see why")
            self._buffer += part
        message, self._buffer = self._buffer.split(b"\0", 1)
        return json.loads(message)

    def _call(self, method, session=None, **parameters):
        self._count += 1
        request = {"id": self._count, "method": method, "params": parameters}
        if session:
            request["sessionId"] = session
        os.write(self._write, json.dumps(request).encode() + b"\0")
        until = time.monotonic() + self.timeout
        while True:
            message = self._receive(until)
            if message.get("id") != self._count:
                self.events.append(message)
                continue
            if "error" in message:
                raise RuntimeError(f"{method}: {message['error']}")
            return message["result"]

    def call(self, method, **parameters):
        """One call of the protocol, for this page."""
        return self._call(method, self._session, **parameters)

    def evaluate(self, expression):
        """The value of a JavaScript expression; a promise is waited for."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(json.dumps(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def show(self, path, width, height, dark=False, mobile=False):
        """Opens a file at a size [CSS pixels] in light or dark mode and waits until it is loaded."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=mobile)
        self.call("Emulation.setEmulatedMedia", features=[
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"},
            {"name": "prefers-reduced-motion", "value": "reduce"}])
        self.events.clear()
        self.call("Page.navigate", url=path.resolve().as_uri())
        until = time.monotonic() + self.timeout
        while not any(event["method"] == "Page.loadEventFired" for event in self.events):
            self.events.append(self._receive(until))
        # Plots are drawn, fonts and pictures are there, and two frames have passed.
        self.evaluate("""(async () => {
            await document.fonts.ready;
            await Promise.allSettled([...document.images].map(image => image.decode()));
            for (let i = 0; i < 2; ++i) await new Promise(done => requestAnimationFrame(done));
        })()""")

    def of(self, method):
        """The events of that name since the page was opened."""
        return [event["params"] for event in self.events if event["method"] == method]

    def screenshot(self):
        """The whole page, from top to bottom, as PNG."""
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        clip = {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}
        data = self.call("Page.captureScreenshot", format="png", clip=clip, captureBeyondViewport=True)["data"]
        return base64.b64decode(data)
