"""Puts page, script, chart and WebAssembly into one file: pack.py WASM OUT [TEST_SCRIPT EXPECTED_CSV]

With a test script the page runs it when it is ready, and has the CSV file to compare with.
"""

import base64
import gzip
import json
import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
CHART = HERE / "../../host-sim/report/assets/uplot"


def names(signal):
    """The value table of a signal of the product's DBC file."""
    line = re.search(rf"^VAL_ \d+ {signal} (.*);", (HERE / "../../core/haptic.dbc").read_text(), re.M)
    return dict((number, name) for number, name in re.findall(r'(\d+) "([^"]*)"', line.group(1)))


def main(wasm, out, test=None, expected=None):
    parts = {
        "/*UPLOT_CSS*/": (CHART / "uPlot.min.css").read_text(),
        "/*UPLOT_JS*/": (CHART / "uPlot.iife.min.js").read_text(),
        "/*WASM*/": base64.b64encode(gzip.compress(Path(wasm).read_bytes(), 9, mtime=0)).decode(),
        "/*MODES*/": json.dumps(names("Guidance_Mode")),
        "/*LIMITS*/": json.dumps(names("Guidance_Limit")),
        "/*LAB_JS*/": (HERE / "lab.js").read_text(),
    }
    page = (HERE / "page.html").read_text()
    for mark, text in parts.items():
        assert page.count(mark) == 1, mark
        page = page.replace(mark, text)
    if test:
        data = json.dumps(Path(expected).read_text())
        script = f"const EXPECTED = {data};\n{Path(test).read_text()}"
        page = page.replace("</body>", f"<pre id=report></pre><script>{script}</script></body>")
    Path(out).write_text(page)
    print(f"{out}: {len(page.encode()) / 1000:.0f} kB")


main(*sys.argv[1:])
