#!/usr/bin/env python3
"""Puts the page together, one file: assemble.py PLAY.wasm LOG.wasm OUT.html"""

import base64
import gzip
import html
import json
import re
import sys
from pathlib import Path

here = Path(__file__).parent
data = here.parent / "data"
page = (here / "page.html").read_text(encoding="utf-8")
look = (here.parent / "common/page.html").read_text(encoding="utf-8")

# Logs of real machines that come with the page: file, what is on its button, options, source.
samples = [
    ("servo_relay_pid/relay.csv", "a servo under a relay", {"limits": "-100,100"},
     "github.com/gkeiel/dc_motor_position_control, MIT"),
    ("tclab_steps/step.csv", "a heater, steps", {"limits": "0,255"},
     "github.com/APMonitor/arduino, Apache-2.0"),
    ("esp32_motor_step/step.csv", "a motor, one step (refused)", {},
     "github.com/Tamaras-hub/ESP32-DC-Motor-PID-Control, MIT"),
]


def text(file):
    return file.read_text(encoding="utf-8")


def zipped(data_):
    return base64.b64encode(gzip.compress(data_, 9, mtime=0)).decode()


parts = {
    "style": re.search(r"<style>\n(.*?)\n</style>", look, re.S)[1],  # that of the gallery
    "wasm": base64.b64encode(Path(sys.argv[1]).read_bytes()).decode(),
    "log": zipped(Path(sys.argv[2]).read_bytes()),
    "samples": zipped(json.dumps([{
        "name": name, "options": options, "source": f"{name}: {source}",
        "licence": text((data / name).parent / "LICENSE.txt"), "text": text(data / name),
    } for name, _, options, source in samples]).encode()),
    "buttons": " ".join(f'<button data-log="{name}">{html.escape(words)}</button>'
                        for name, words, _, _ in samples),
    "licence": html.escape(text(here.parents[1] / "LICENSE")),
    "script": text(here / "play.js"),
    "worker": text(here / "worker.js"),
    "drop": text(here / "drop.js"),
}
whole = re.sub(r"\$(" + "|".join(parts) + r")\b", lambda found: parts[found[1]], page)
Path(sys.argv[3]).write_text(whole, encoding="utf-8")
