#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: plot.py ADDRESS SECONDS SIGNAL... >plot.svg
Draws signals of a run that was started with --http: ADDRESS is the one that it has printed, token
and all. Needs Debian's python3-websocket; docs/page.md has the messages."""
import json
import struct
import sys

import websocket

address, seconds, names = sys.argv[1], float(sys.argv[2]), sys.argv[3:]
host, token = address.removeprefix("http://").split("/#token=")
page = websocket.create_connection(f"ws://{host}/socket", origin=f"http://{host}")

# The token comes first and is answered by the description of the run; then what we want to see
page.send(json.dumps({"cmd": "enter", "token": token}))
units = {signal["name"]: signal["unit"] for signal in json.loads(page.recv())["signals"]}
page.send(json.dumps({"cmd": "watch", "rate_hz": 50, "signals": names}))
chosen, rows = [], []
while not rows or rows[-1][0] - rows[0][0] < seconds:
    message = page.recv()
    if isinstance(message, str):  # an answer, or an event
        chosen = json.loads(message).get("signals", chosen)
    elif message[0] == 1:  # a state: virtual time at byte 16, the chosen signals at its end
        count, = struct.unpack_from("<H", message, 76)
        time_ns, = struct.unpack_from("<q", message, 16)
        rows.append((time_ns * 1e-9, *struct.unpack(f"<{count}f", message[-4 * count:])))
page.close()

# A curve for each signal, from its least to its greatest value
colors = ["#1f6feb", "#d1372c", "#2f9e6e", "#b05cd6", "#c98a0a"]
print('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 800 400" font-family="sans-serif">')
for k, name in enumerate(chosen):
    low, high = min(row[k + 1] for row in rows), max(row[k + 1] for row in rows)
    points = " ".join(f"{800 * (row[0] - rows[0][0]) / seconds:.1f},"
                      f"{380 - 340 * (row[k + 1] - low) / ((high - low) or 1):.1f}" for row in rows)
    color = colors[k % len(colors)]
    print(f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.5"/>')
    print(f'<text x="{8 + 260 * k}" y="20" fill="{color}">{name}: {low:.3g} to {high:.3g} '
          f'{units[name]}</text>')
print("</svg>")
