#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The page's server: who may ask, what it tells, that who may look cannot control, and that slow
and hostile clients cost nobody else anything. Prints TAP."""
import gzip
import math
import socket
import struct
import sys
import time

from page_client import Page, Simulator, ask_http, header, token
from tap import check

EVIL = "evil.example"


def judge_requests(run):
    port = run.port
    status, body, head = ask_http(port)
    check(status == 200 and b"page.js" in body, "the page is served")
    check("default-src 'self'" in head and "no-referrer" in head, "with a policy", head)
    status, body, head = ask_http(port, "/page.js")
    check(status == 200 and "gzip" in head and b"coman" in gzip.decompress(body), "its program too")
    found = [ask_http(port, host=host)[0] for host in (f"{EVIL}:{port}", EVIL, "127.0.0.1:1")]
    check(found == [403] * 3, "another Host is refused: a name may be pointed here", found)
    found = [ask_http(port, headers=[f"Origin: {origin}"])[0]
             for origin in (f"http://{EVIL}", "null", f"https://127.0.0.1:{port}")]
    check(found == [403] * 3, "another Origin too", found)
    check(Page(port, origin=f"http://{EVIL}:{port}").status == 403, "also for a WebSocket")
    check(Page(port, origin=f"http://127.0.0.1:{port}").status == 101, "its own page gets one")
    found = [ask_http(port, path)[0] for path in ("/messages.json", "/mesh/1", "/etc/passwd")]
    check(found == [401] * 3, "what is shown needs a token", found)
    bearer = [f"Authorization: Bearer {token(run.look)}"]
    found = [ask_http(port, path, headers=bearer)[0]
             for path in ("/messages.json", "/mesh/1", "/mesh/0", "/mesh/99", "/mesh/-1", "/x")]
    check(found == [200, 200, 404, 404, 404, 404], "and is there with one", found)
    found = [ask_http(port, "/messages.json", headers=[f"authorization: {text}"])[0] for text in (
        f"bearer {token(run.look)}", f"BEARER   {token(run.look)}", f"bearer{token(run.look)}",
        f"basic {token(run.look)}", "bearer", "bearer ")]
    check(found == [200, 200, 401, 401, 401, 401], "the scheme is written in any case", found)
    found = [ask_http(port, send=text)[0] for text in (
        b"POST / HTTP/1.1\r\n\r\n", b"\x16\x03\x01\r\n\r\n", b"GET / HTTP/1.1\r\n" + b"a" * 9000)]
    check(found == [405, 400, 431], "other requests are told what they are", found)


def judge_entering(run):
    wrong = Page(run.port)
    wrong.send({"cmd": "enter", "token": "0" * 32})
    check(wrong.receive() == ("closed", 1008), "a wrong token ends the connection")
    none = Page(run.port)
    none.send({"cmd": "stop"})
    check(none.receive() == ("closed", 1008), "so does a request without one")
    huge = Page(run.port, run.look)
    huge.connection.sendall(b"\x82\xff" + struct.pack(">Q", 0x7fff0000) + b"abcd")
    check(huge.receive() == ("closed", 1009), "a frame of 2 GB is refused before it has come")
    odd = Page(run.port, run.look)
    odd.connection.sendall(b"\xff\x00")
    check(odd.receive() == ("closed", 1002), "what is no frame too")


def judge_looking(run):
    page = Page(run.port, run.look)
    check(page.hello["right"] == "look", "the address to look gives no other right")
    refused = [page.ask(cmd, **keys).get("code") for cmd, keys in (
        ("push", {"body": "Waist", "force_n": [500, 0, 0]}), ("fault", {"name": "jam", "on": True}),
        ("pause", {}), ("stop", {}), ("set", {"name": "supply_v", "value": 1}), ("reset", {}),
        ("subscribe", {"signals": ["q_*"]}),
        ("send", {"bus": "torso", "frame_id": 1, "data": ""}))]
    check(refused == ["right"] * len(refused), "who may look cannot control", refused)
    check(page.ask("status")["rig"] == "coman", "but may ask")
    page.close()


def quaternion_turn(q, v):
    """v turned by the quaternion q."""
    w, u = q[0], q[1:]
    cross = lambda a, b: [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                          a[0] * b[1] - a[1] * b[0]]
    t = [2 * c for c in cross(u, v)]
    return [v[i] + w * t[i] + cross(u, t)[i] for i in range(3)]


def judge_states(run):
    page = Page(run.port, run.control)
    scene = page.hello["scene"]
    check(page.hello["right"] == "control" and len(scene["joints"]) == 23, "the scene is described")
    page.ask("pause")
    page.ask("watch", rate_hz=60, signals=["q_RKneeSag_rad", "fz_*Foot_n", "base_z_m"])
    first = header(page.state())
    check(first["kind"] == 1 and first["version"] == 1 and first["flags"] & 1, "a state comes",
          first)
    before = page.ask("status")
    page.ask("step", count=300)
    after = page.ask("status")
    state = page.state()
    while header(state)["tick"] < after["tick"]:
        state = page.state()
    now = header(state)
    check(after["tick"] - before["tick"] == 300 and now["tick"] == after["tick"],
          "steps are those of ctl, and are seen", now["tick"])

    # Poses, angles and forces are those that other ways tell
    at = 80
    bodies = [struct.unpack_from("<7f", state, at + 28 * i) for i in range(now["nbody"])]
    at += 28 * now["nbody"]
    joints = [struct.unpack_from("<2f", state, at + 8 * i) for i in range(now["njoint"])]
    at += 8 * now["njoint"]
    contacts = {struct.unpack_from("<H", state, at + 28 * i)[0]:
                struct.unpack_from("<6f", state, at + 28 * i + 4) for i in range(now["ncontact"])}
    at += 28 * now["ncontact"]
    angles = {joint["name"]: joints[i][0] for i, joint in enumerate(scene["joints"])}
    worst = max(abs(angles[name] - q) for name, q in after["joints"].items())
    check(worst < 1e-6, "angles are those of ctl status", worst)
    forces = {scene["contacts"][i]["name"]: wrench[2] for i, wrench in contacts.items()}
    worst = max(abs(forces.get(name, 0) - z) for name, z in after["contacts"].items())
    check(worst < 0.01 and sum(forces.values()) > 200, "forces too, and they carry the robot",
          forces)
    index = {body["name"]: i for i, body in enumerate(scene["bodies"])}
    foot = bodies[index["RFoot"]]
    check(abs(foot[2] - bodies[index["LFoot"]][2]) < 0.01 and 0 < foot[2] < 0.2
          and bodies[0][2] - foot[2] > 0.3, "the robot stands on its feet", foot)
    check(all(abs(math.hypot(*body[3:]) - 1) < 1e-5 for body in bodies), "quaternions are unit")
    up = quaternion_turn(foot[3:], [0, 0, 1])
    check(up[2] > 0.95, "a foot is flat", up)
    values = struct.unpack_from(f"<{now['nsignal']}f", state, len(state) - 4 * now["nsignal"])
    check(now["nsignal"] == 4 and abs(values[0] - angles["RKneeSag"]) < 1e-6,
          "chosen signals follow", values)
    board = len(state) - 4 * now["nsignal"] - 4 * ((now["nfault"] + 31) // 32) - 12 * now["nboard"]
    bus = board - 24 * now["nbus"]
    rx, tx, rx_lost, tx_lost, load, up = struct.unpack_from("<IIIIfI", state, bus)
    status = after["buses"][0]
    check((rx, tx, up) == (status["rx_frames"], status["tx_frames"], 0) and bus == at,
          "the buses' counters are those of ctl status", (rx, tx, load))
    page.close()


def judge_acting(run):
    page = Page(run.port, run.control)
    page.ask("watch", rate_hz=60, trace=True)
    page.ask("pause")
    other = Page(run.port, run.look)
    other.ask("watch", rate_hz=60, trace=True)
    answer = page.ask("send", bus="torso", frame_id=0x001, data="7e")
    check(answer.get("ok"), "a frame is taken", answer)
    record = None
    for _ in range(50):
        trace = other.state(kind=2)
        time_ns, frame_id, bus, flags, length = struct.unpack_from("<qIBBB", trace, 12)
        if flags & 0x80:
            record = frame_id, bus, length, trace[28:28 + length]
            break
    check(record == (1, 0, 1, b"\x7e"), "another page sees it on the bus", record)
    page.ask("step", count=3)
    other.events.clear()
    end = time.monotonic() + 10
    text = ""
    while "unknown command 0x7e" not in text and time.monotonic() < end:
        other.state()
        text = " ".join(event["text"] for event in other.events)
    check("unknown command 0x7e" in text, "and the board hears it: its event comes", text[-200:])
    check(page.ask("send", bus="nowhere", frame_id=1, data="")["code"] == "input",
          "a bus that there is not is told")
    answer = page.ask("fault", name="jam", on=True)
    state = page.state()
    while not state[-4] & 1 and time.monotonic() < end:
        state = page.state()
    check(answer.get("ok") and state[-4] & 1, "a fault is switched, and is seen")
    refused = page.ask("push", body="Wast")
    check(refused["code"] == "input" and "Waist" in refused["error"],
          "refusals are those of ctl", refused["error"])
    page.close()
    other.close()


def judge_crowds(run):
    """Whoever takes nothing is skipped; too many are refused; the others go on."""
    lazy = Page(run.port, run.look)
    lazy.connection.setsockopt(socket.SOL_SOCKET,
                               socket.SO_RCVBUF, 4096)
    lazy.send({"cmd": "watch", "rate_hz": 60, "signals": ["q_*"], "trace": True})
    crowd = [Page(run.port, run.look) for _ in range(9)]
    for page in crowd:
        page.ask("watch", rate_hz=60)
    start = time.monotonic()
    counts = [0] * len(crowd)
    while time.monotonic() - start < 1.5:
        for i, page in enumerate(crowd):
            page.state()
            counts[i] += 1
    check(min(counts) > 15, "nine pages are served beside one that reads nothing", counts)
    crowd += [Page(run.port, run.look) for _ in range(5)]
    late = Page(run.port, run.look)
    check(late.hello == ("closed", 1013), "the sixteenth page that looks is told that there are "
          "too many", late.hello)
    owner = Page(run.port, run.control)
    check(owner.hello["right"] == "control" and owner.ask("status")["ok"],
          "and the last place is for who may control")
    for connection in [lazy, owner, *crowd]:
        connection.close()
    foreign = [Page(run.port, run.look, source="127.0.0.2") for _ in range(9)]
    own = Page(run.port, run.look)
    check([page.hello != ("closed", 1013) for page in foreign] == [True] * 8 + [False]
          and own.hello["right"] == "look", "one address has eight places to look")
    for connection in [*foreign, own]:
        connection.close()


def judge_slow_connections(run):
    """Two hundred that ask nothing, or half of a request, and stay."""
    page = Page(run.port, run.control)
    slow = []
    for i in range(200):
        connection = socket.create_connection(("127.0.0.1", run.port))
        connection.sendall(b"GET / HTTP/1.1\r\nHost: " if i % 2 else b"")
        slow.append(connection)
        if i % 50 == 49:
            check(ask_http(run.port)[0] == 200, f"beside {i + 1} slow connections the page comes")
    late = Page(run.port, run.look)
    check(late.hello["right"] == "look" and late.ask("status")["ok"], "and a new page gets in")
    check(page.ask("status")["ok"], "and the one that was there stays")
    for connection in [*slow, late, page]:
        connection.close()


def series(message):
    """Signals, id, rows, lost, times and columns of a binary message of rows."""
    nsignal, number, count, rows, lost = struct.unpack_from("<HIIIQ", message, 2)
    times = struct.unpack_from(f"<{count}d", message, 24)
    columns = [struct.unpack_from(f"<{count}f", message, 24 + 8 * count + 4 * k * count)
               for k in range(nsignal)]
    return number, rows, lost, times, columns


def judge_history(run):
    """Every row comes as it is made, and what was before a signal was chosen is there too."""
    lead = Page(run.port, run.control)
    names = ["q_RKneeSag_rad", "torque_RKneeSag_nm"]
    check(lead.hello["limits"]["rows"] is True, "a history is kept")
    lead.ask("pause")
    lead.ask("step", count=5)
    begun = lead.ask("watch", rate_hz=60, rows=True, signals=names)["rows_after_s"]
    first = lead.ask("status")["tick"]
    lead.send({"id": "steps", "cmd": "step", "count": 700})
    last = first + 700
    times, values, missing = [], [], 0
    while not times or times[-1] < last * 1e-3 - 1e-6:
        number, rows, lost, some, columns = series(lead.state(kind=3))
        check_row = number == 0 and rows == len(some)
        times += some
        values += columns[0]
        missing += lost
    ticks = [round(1e3 * time) for time in times]
    check(check_row and missing == 0 and ticks == list(range(first + 1, last + 1)),
          "a row comes for every tick", (ticks[0], ticks[-1], len(ticks)))
    check(round(1e3 * begun) == first, "behind those that there were", (begun, first))
    lead.ask("watch", rate_hz=0)
    lead.send({"id": 77, "cmd": "series", "signals": names, "from_s": (first + 1) * 1e-3,
               "to_s": last * 1e-3, "points": 8000})
    number, rows, _, before, columns = series(lead.state(kind=3))
    inside = [i for i, time in enumerate(before) if times[0] <= time <= times[-1]]
    check(number == 77 and [columns[0][i] for i in inside] == values
          and [before[i] for i in inside] == times, "the same rows are kept", len(before))
    lead.send({"id": 78, "cmd": "series", "signals": ["q_LElbj_rad"], "from_s": 0, "to_s": 1e6,
               "points": 200})
    number, rows, _, few, _ = series(lead.state(kind=3))
    check(number == 78 and rows > 600 and len(few) <= 200, "all of it in few points", rows)
    lead.ask("watch", rate_hz=60, rows=True, signals=names)
    lead.ask("reset")
    lead.send({"id": "more", "cmd": "step", "count": 20})
    some = series(lead.state(kind=3, where=lambda m: series(m)[3][0] < 0.02))[3]
    check(round(1e3 * some[0]) == 1, "after a reset rows begin anew", some)
    lead.close()


def judge_late_comers(run, reason):
    """Who joins while no tick runs sees the last one, not the start or that of the last look."""
    page = Page(run.port, run.look)
    tick = page.ask("status")["tick"]
    page.ask("watch", rate_hz=60)
    first = header(page.state())
    page.close()
    check(first["tick"] == tick > 0 and first["time_ns"] == tick * 1000000,
          f"the first state of a page that joins is of now, {reason}", (tick, first["tick"]))


def judge_pauses(run):
    lead = Page(run.port, run.control)
    lead.ask("step", count=250)
    judge_late_comers(run, "in a pause")
    lead.ask("step", count=250)
    judge_late_comers(run, "in a later one")
    lead.close()


def main():
    print("1..57")
    with Simulator("coman", "--clock", "real", "--task", "squat", "--fault",
                   "jam: motor LKneeSag jam manual") as run:
        judge_states(run)
        judge_requests(run)
        judge_entering(run)
        judge_looking(run)
        judge_acting(run)
        judge_crowds(run)
        judge_slow_connections(run)
        last = Page(run.port, run.look)
        last.ask("watch", rate_hz=10)
        status = run.stop()
        while isinstance(message := last.receive(), (bytes, dict)):
            pass
        check(message == ("closed", 1001), "at the end every page is told", message)
        check(status == 0 and "page: " in run.text().split("wake-up")[0], "and the summary counts",
              [line for line in run.text().splitlines() if "clients" in line])
    with Simulator("coman", "--clock", "free", "--control", "none", "--ticks", "2000000") as run:
        page = Page(run.port, run.look)
        check(run.control is None and page.hello["right"] == "look",
              "without a control socket nobody may control")
    with Simulator("coman", "--clock", "free", "--ticks", "2000000") as run:
        judge_pauses(run)
    with Simulator("coman", "--clock", "lockstep", "--task", "squat") as run:
        judge_history(run)
    with Simulator("hyq-leg", "--clock", "free", "--ticks", "2000000") as run:
        units = {signal["name"]: signal["unit"]
                 for signal in Page(run.port, run.look).hello["signals"]}
        found = [units.get(f"{name}_knee_pa") for name in ("piston_pressure", "rod_pressure")]
        check(found == ["Pa", "Pa"] and "valve_opening_knee" in units
              and units.get("hydraulic_supply_pa") == "Pa",
              "pressures and valves of hydraulic joints can be plotted", found)
    with Simulator("coman", "--clock", "lockstep") as run:
        lead = Page(run.port, run.control)
        lead.ask("step", count=100)
        lead.ask("resume")
        judge_late_comers(run, "while its controller is silent")
    return 0


sys.exit(main())
