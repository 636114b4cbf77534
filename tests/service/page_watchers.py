#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""usage: page_watchers.py LOG COUNT
Waits until a run has written the address of its page to LOG, then watches it with so many clients,
frames and all rows too, each in a thread, until the run ends. Prints how many states each has
seen."""
import re
import sys
import threading
import time

from page_client import Page


def watch(port, address, seen, i):
    page = Page(port, address)
    page.ask("watch", rate_hz=60, trace=True, rows=True, signals=["q_*"])
    try:
        while not isinstance(message := page.receive(), tuple):
            seen[i] += isinstance(message, bytes) and message[0] == 1
    except (EOFError, ConnectionError):
        pass


def main(log, count):
    end = time.monotonic() + 20
    address = None
    while not address and time.monotonic() < end:
        time.sleep(0.02)
        try:
            address = re.search(r"^page, to look only: (\S+)$", open(log).read(), re.M)
        except FileNotFoundError:
            pass
    if not address:
        print("no page")
        return
    port = int(re.search(r":(\d+)/", address[1])[1])
    seen = [0] * count
    threads = [threading.Thread(target=watch, args=(port, address[1], seen, i))
               for i in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    print("states", *seen)


main(sys.argv[1], int(sys.argv[2]))
