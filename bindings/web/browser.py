"""A headless Chromium, spoken to through a pipe: browser.py PAGE SCRIPT DATA... [--axe AXE.js PICTURES]

Runs the script in the page, with the texts of the data as the list EXPECTED, and prints the lines that it returns. With --axe every
step of the page is looked at by axe-core, in light and dark, and photographed; and at three sizes for words that lie over each other or
are cut off.
"""

import base64
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path


class Browser:
    """One page of one Chromium."""

    def __init__(self, width=1280, height=800):
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        to_read, to = os.pipe()
        of, to_write = os.pipe()

        def hand_over():
            # Chromium reads from 3 and writes to 4; neither end may be lost while it is moved there.
            ends = os.dup2(to_read, 60), os.dup2(to_write, 61)
            os.dup2(ends[0], 3)
            os.dup2(ends[1], 4)

        self.process = subprocess.Popen(
            ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", "--no-first-run",
             "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-extensions",
             # It drops addresses that come faster than 200 in ten seconds, as those of the test do.
             "--disable-ipc-flooding-protection",
             f"--user-data-dir={self.profile.name}", "about:blank"],
            stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL, close_fds=False, preexec_fn=hand_over,
        )
        os.close(to_read)
        os.close(to_write)
        self.input, self.output = os.fdopen(of, "rb"), os.fdopen(to, "wb")
        self.number = 0
        self.session = None
        self.events = []
        target = next(t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page")
        self.session = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        self.call("Page.enable")
        self.call("Runtime.enable")
        self.size(width, height)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()
        self.profile.cleanup()

    def hear(self):
        """The next message."""
        text = bytearray()
        while (piece := self.input.read(1)) != b"\0":
            if not piece:
                raise SystemExit("Chromium ended")
            text += piece
        return json.loads(text)

    def call(self, method, **params):
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        self.output.write(json.dumps(message).encode() + b"\0")
        self.output.flush()
        while True:
            heard = self.hear()
            if heard.get("id") != self.number:
                self.events.append(heard)
                continue
            if "error" in heard:
                raise SystemExit(f"{method}: {heard['error']}")
            return heard["result"]

    def size(self, width, height, dark=False, calm=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)
        features = [("prefers-color-scheme", "dark" if dark else "light"), ("prefers-reduced-motion", "reduce" if calm else "no-preference")]
        self.call("Emulation.setEmulatedMedia", features=[{"name": n, "value": v} for n, v in features])

    def open(self, page, hash_=""):
        self.call("Page.navigate", url="about:blank")
        self.call("Page.navigate", url=Path(page).resolve().as_uri() + hash_)
        return self.run("new Promise(done => { const look = () => document.body?.dataset.ready ? done(1) : setTimeout(look, 20); look(); })")

    def run(self, script):
        """The value of an expression, or of its promise."""
        got = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True, userGesture=True)
        if "exceptionDetails" in got:
            raise SystemExit(json.dumps(got["exceptionDetails"].get("exception", {}).get("description", got["exceptionDetails"])))
        return got["result"].get("value")

    def picture(self, place, full=False):
        shot = self.call("Page.captureScreenshot", captureBeyondViewport=full)
        Path(place).write_bytes(base64.b64decode(shot["data"]))


STEPS = ["loop", "guidance", "reliance", "failure", "handover", "probe", "compare", "bar", "drive", "law"]
# What is not there by its name: both drives through a torsion bar.
OTHERS = {"bar": "for (const drive of ['a', 'b']) page.state()[drive].column = 'bar'; page.go('compare')"}
DONE = "new Promise(done => { const look = () => document.body.dataset.done ? done(1) : setTimeout(look, 50); setTimeout(look, 100); })"
AXE = """axe.run({resultTypes: ["violations"]}).then(({violations}) => violations
  .map(v => `${v.id}: ${v.nodes.slice(0, 3).map(n => n.target + " " + n.any.map(a => a.message)).join("; ")}`).join(" | "))"""


def accessible(browser, page, axe, pictures):
    """A line for each step and theme: what axe-core finds."""
    Path(pictures).mkdir(parents=True, exist_ok=True)
    for dark in (False, True):
        browser.size(1280, 800, dark, calm=True)
        browser.open(page)
        browser.run(Path(axe).read_text() + ";1")
        for step in STEPS:
            browser.run(OTHERS.get(step, f"page.go('{step}')"))
            browser.run(DONE)
            theme = "dark" if dark else "light"
            browser.picture(Path(pictures) / f"{step}-{theme}.png")
            found = browser.run(AXE)
            if browser.run("!document.getElementById('ask').hidden"):
                browser.run("document.querySelector('[data-guess=shown]').click()")
                browser.run(DONE)
                found = " | ".join(filter(None, [found, browser.run(AXE)]))
            print(f"{'FAILED' if found else 'ok'} axe, {step}, {theme}: {found or 'nothing'}")


SIZES = {"phone": (360, 740), "tablet": (1024, 768), "desk": (1600, 900)}
# Words of the pictures that lie over each other by more than a pixel, or beyond their picture.
CROWDED = """(() => {
  const found = [], words = [...document.querySelectorAll("svg text")].filter(text => text.textContent.trim() && text.getClientRects().length);
  const boxes = words.map(text => text.getBoundingClientRect());
  words.forEach((text, i) => {
    const a = boxes[i], around = text.ownerSVGElement.getBoundingClientRect();
    if (a.right > around.right + 1 || a.left < around.left - 1) found.push(`cut: ${text.textContent}`);
    for (let k = i + 1; k < words.length; k++) {
      const b = boxes[k], wide = Math.min(a.right, b.right) - Math.max(a.left, b.left), tall = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (wide > 1 && tall > 3) found.push(`${text.textContent} over ${words[k].textContent}`);
    }
  });
  return [...new Set(found)].join(" | ");
})()"""


def legible(browser, page, pictures):
    """A line for each step and size: words that cannot be read."""
    for name, size in SIZES.items():
        browser.size(*size, calm=True)
        browser.open(page)
        for step in STEPS:
            browser.run(OTHERS.get(step, f"page.go('{step}')"))
            browser.run(DONE)
            browser.run("document.querySelector('#ask:not([hidden]) [data-guess=shown]')?.click()")
            browser.run(DONE)
            browser.picture(Path(pictures) / f"{step}-{name}.png", full=True)
            found = browser.run(CROWDED)
            print(f"{'FAILED' if found else 'ok'} words, {step}, {name}: {found or 'all legible'}")


def main(page, script, *rest):
    data, looks = (rest[: rest.index("--axe")], rest[rest.index("--axe") + 1 :]) if "--axe" in rest else (rest, ())
    with Browser() as browser:
        browser.open(page)
        texts = json.dumps([Path(text).read_text() for text in data])
        print(browser.run(f"(() => {{ const EXPECTED = {texts};\n{Path(script).read_text()} }})()"))
        if looks:
            accessible(browser, page, *looks)
            legible(browser, page, looks[1])
        for event in browser.events:
            if event.get("method") == "Runtime.exceptionThrown":
                print("FAILED the page's own error:", json.dumps(event["params"]["exceptionDetails"])[:400])


if __name__ == "__main__":
    main(*sys.argv[1:])
