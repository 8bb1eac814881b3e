#!/usr/bin/env python3
"""Puts the page together, one file: assemble.py MODULE.wasm OUT.html"""

import base64
import json
import re
import sys
from pathlib import Path

here = Path(__file__).parent
page = (here / "page.html").read_text(encoding="utf-8")
look = (here.parent / "common/page.html").read_text(encoding="utf-8")
parts = {
    "style": re.search(r"<style>\n(.*?)\n</style>", look, re.S)[1],  # that of the gallery
    "settings": json.dumps((here / "settings.txt").read_text(encoding="utf-8").split()),
    "wasm": base64.b64encode(Path(sys.argv[1]).read_bytes()).decode(),
    "script": (here / "play.js").read_text(encoding="utf-8"),
}
whole = re.sub(r"\$(style|settings|wasm|script)\b", lambda found: parts[found[1]], page)
Path(sys.argv[2]).write_text(whole, encoding="utf-8")
