"""A real headless Chromium, driven by its DevTools; for the panel's tests and its pictures."""
import base64
import http.client
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time

import websocket


class Browser:
    """One page in a browser of its own, with an empty profile."""

    def __init__(self, width=1280, height=860, dark=False, mobile=False):
        self.profile = tempfile.mkdtemp(prefix="ressort-browser-")
        command = ["chromium", "--headless=new", "--no-first-run", "--disable-gpu",
                   "--disable-dev-shm-usage", "--disable-background-networking",
                   "--disable-component-update", "--user-data-dir=" + self.profile,
                   "--remote-debugging-port=0", "--remote-allow-origins=*", "about:blank"]
        if os.geteuid() == 0:
            command.insert(2, "--no-sandbox")
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL, start_new_session=True)
        self.count = 0
        self.events = []
        port_file = os.path.join(self.profile, "DevToolsActivePort")
        for _ in range(600):
            if os.path.exists(port_file) and os.path.getsize(port_file) > 0:
                break
            if self.process.poll() is not None:
                raise RuntimeError("the browser has ended")
            time.sleep(0.05)
        self.port = int(open(port_file).readline())
        tabs = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        tabs.request("PUT", "/json/new?about:blank")
        tab = json.load(tabs.getresponse())
        self.socket = websocket.create_connection(tab["webSocketDebuggerUrl"], timeout=60)
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(domain + ".enable")
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height,
                 deviceScaleFactor=1, mobile=mobile)
        self.ask("Emulation.setEmulatedMedia", features=[
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])

    def close(self):
        self.socket.close()
        os.killpg(self.process.pid, signal.SIGTERM)
        self.process.wait(10)
        shutil.rmtree(self.profile, ignore_errors=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def ask(self, method, **params):
        self.count += 1
        self.socket.send(json.dumps({"id": self.count, "method": method, "params": params}))
        while True:
            message = json.loads(self.socket.recv())
            if message.get("id") == self.count:
                if "error" in message:
                    raise RuntimeError(method + ": " + message["error"]["message"])
                return message["result"]
            self.events.append(message)

    def evaluate(self, expression):
        result = self.ask("Runtime.evaluate", expression=expression, awaitPromise=True,
                          returnByValue=True)
        if "exceptionDetails" in result:
            raise RuntimeError(expression + ": " + json.dumps(result["exceptionDetails"]))
        return result["result"].get("value")

    def open(self, address):
        self.ask("Page.navigate", url=address)

    def eventually(self, expression, seconds=30):
        """Waits until the expression is true on the page. Only a page that hangs takes this long."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                if self.evaluate(expression):
                    return True
            except RuntimeError:
                pass
            time.sleep(0.05)
        return False

    def complaints(self):
        """Returns the errors of the page, and the requests that its policy refused."""
        self.evaluate("1")
        found = []
        for event in self.events:
            params = event.get("params", {})
            if event.get("method") == "Runtime.exceptionThrown":
                found.append(params["exceptionDetails"].get("exception", {}).get("description", "?"))
            elif event.get("method") == "Log.entryAdded" and params["entry"]["level"] == "error":
                found.append(params["entry"]["text"] + " " + params["entry"].get("url", ""))
        return found

    def mouse(self, kind, x, y, button="left"):
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y,
                 button=button if kind != "mouseMoved" else "none",
                 buttons=0 if kind == "mouseReleased" else 1, clickCount=1)

    def key(self, key, code, text=None):
        for kind in ("keyDown", "keyUp"):
            values = {"type": kind, "key": key, "code": code}
            if text and kind == "keyDown":
                values["text"] = text
            self.ask("Input.dispatchKeyEvent", **values)

    def screenshot(self, path, whole=True):
        data = self.ask("Page.captureScreenshot", format="png", captureBeyondViewport=whole)
        with open(path, "wb") as file:
            file.write(base64.b64decode(data["data"]))
