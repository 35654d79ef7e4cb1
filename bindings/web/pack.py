"""Puts the page's parts and the WebAssembly into one file: pack.py WASM OUT"""

import base64
import gzip
import json
import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
# In order: each uses what stands before it.
SCRIPTS = ["strings", "engine", "chart", "drives", "scene", "loop", "guess", "story", "hand", "force", "share", "page", "places"]


def part(name):
    return (HERE / "page" / name).read_text()


def names(signal):
    """The value table of a signal of the product's DBC file."""
    line = re.search(rf"^VAL_ \d+ {signal} (.*);", (HERE / "../../core/haptic.dbc").read_text(), re.M)
    return dict((number, name) for number, name in re.findall(r'(\d+) "([^"]*)"', line.group(1)))


def main(wasm, out):
    parts = {
        "/*CHART_CSS*/": part("chart.css"),
        "/*PAGE_CSS*/": part("page.css"),
        "/*WASM*/": base64.b64encode(gzip.compress(Path(wasm).read_bytes(), 9, mtime=0)).decode(),
        "/*MODES*/": json.dumps(names("Guidance_Mode")),
        "/*LIMITS*/": json.dumps(names("Guidance_Limit")),
        "/*WORKER*/": json.dumps(part("engine.js") + part("worker.js")),
        "/*PAGE_JS*/": "\n".join(part(f"{name}.js") for name in SCRIPTS),
    }
    page = part("page.html")
    for mark, text in parts.items():
        assert page.count(mark) == 1, mark
        page = page.replace(mark, text)
    Path(out).write_text(page)
    print(f"{out}: {len(page.encode()) / 1000:.0f} kB")


main(*sys.argv[1:])
