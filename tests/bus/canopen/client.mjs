// SPDX-License-Identifier: Apache-2.0
// usage: node client.mjs COMAN-HIL: a CANopen master made of the npm package canopen, at the bus of
// the torso of coman-cia402: it reads the EDS, compares every object of the node with it, writes,
// is refused, starts and resets the node, maps its PDOs, sends SYNC, turns a motor, moves data in
// blocks and gives the node another Node-ID. Prints TAP.
import { execFileSync, spawn } from "node:child_process";
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { connect } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createRequire } from "node:module";

const require = createRequire(import.meta.url);
const { DataType, Device, Eds, LssMode, NmtState } = require("canopen");

const program = process.argv[2];
const NODE = 1;
const FREE = 30; // a Node-ID that no node has
const MASTER = 0x7f;
const PATIENCE = 20000; // ms; a busy machine takes its time
const work = mkdtempSync(join(tmpdir(), "hil-canopen-"));

// ---- TAP ----

let count = 0;

async function point(name, judge) {
  const wrong = [];
  try {
    await judge((holds, text) => holds || wrong.push(text));
  } catch (error) {
    wrong.push(error.stack);
  }
  console.log(`${wrong.length ? "not ok" : "ok"} ${++count} - ${name}`);
  for (const text of wrong.slice(0, 20)) console.log(`# ${String(text).replaceAll("\n", "\n# ")}`);
}

// Waits until the condition holds; false when it does not in time.
async function until(condition) {
  for (const end = Date.now() + PATIENCE; Date.now() < end; ) {
    if (condition()) return true;
    await new Promise((resolve) => setTimeout(resolve, 5));
  }
  return false;
}

// ---- the bus: the gateway's raw mode ----

function startSimulator() {
  const ready = join(work, "ready");
  const child = spawn(
    program,
    ["run", "coman-cia402", "--transport", "local", "--clock", "real", "--gateway", "0", "--ready", ready,
      "--quiet"],
    { stdio: ["ignore", "ignore", "pipe"] },
  );
  let text = "";
  child.stderr.on("data", (data) => (text += data));
  const port = until(() => child.exitCode !== null || existsSync(ready)).then(() => {
    if (!existsSync(ready)) throw new Error(`the simulator is not ready: ${text}`);
    return Number(/^gateway_port='(\d+)'$/m.exec(readFileSync(ready, "utf8"))[1]);
  });
  return { child, port };
}

// A raw channel as the library wants it: send, and receive by callback.
async function openBus(port, name, receive) {
  const socket = connect(port, "127.0.0.1");
  const pending = [];
  let text = "";
  let answer;
  const next = () => new Promise((resolve) => (answer = resolve));

  socket.setNoDelay(true);
  socket.on("data", (data) => {
    text += data.toString("latin1");
    for (let end; (end = text.indexOf(">")) >= 0; text = text.slice(end + 1)) {
      const words = text.slice(text.indexOf("<") + 1, end).trim().split(/\s+/);
      if (words[0] === "frame") {
        receive({ id: parseInt(words[1], 16), data: Buffer.from(words.slice(3).join(""), "hex") });
      } else if (answer) {
        answer(words[0]);
      } else {
        pending.push(words[0]);
      }
    }
  });
  if ((pending.shift() ?? (await next())) !== "hi") throw new Error("no greeting");
  for (const command of [`open ${name}`, "rawmode"]) {
    socket.write(`< ${command} >`);
    if ((await next()) !== "ok") throw new Error(`${command} is refused`);
  }
  return {
    send({ id, data }) {
      const bytes = [...data].map((byte) => byte.toString(16).padStart(2, "0")).join(" ");
      socket.write(`< send ${id.toString(16).padStart(3, "0")} ${data.length} ${bytes} >`);
    },
    close: () => socket.destroy(),
  };
}

// ---- the dictionary ----

// Every object and sub-object that has a value: {index, subIndex, entry}.
function* objects(eds) {
  for (const [key, entry] of eds.entries()) {
    const index = parseInt(key, 16);
    if (entry.dataType !== undefined) {
      yield { index, subIndex: 0, entry };
      continue;
    }
    for (let subIndex = 0; subIndex < 255; subIndex++) {
      const part = eds.getSubEntry(index, subIndex);
      if (part) yield { index, subIndex, entry: part };
      else if (subIndex >= entry.subNumber && subIndex > 16) break;
    }
  }
}

const nameOf = ({ index, subIndex }) => `0x${index.toString(16)}.${subIndex}`;

// What the EDS says, as a number or text; undefined when it says nothing.
function factoryValue(entry) {
  const text = entry.defaultValue;
  if (text === undefined || text === "") return undefined;
  if (entry.dataType === DataType.VISIBLE_STRING) return text;
  return text.split("+").reduce((sum, term) => sum + (term === "$NODEID" ? NODE : Number(term)), 0);
}

// ---- the judge ----

const files = join(work, "eds");
execFileSync("mkdir", [files]);
execFileSync(program, ["eds", "coman-cia402", "-o", files]);
const { child, port } = startSimulator();
console.log("1..11");

await point("the library takes the EDS of every node", (check) => {
  for (const file of readdirSync(files)) {
    const eds = Eds.fromFile(join(files, file));
    check([...objects(eds)].length > 20, `${file} has few objects`);
    check(eds.getIdentity().vendorId === 0, `${file} has vendor ${eds.getIdentity().vendorId}`);
  }
});

const eds = Eds.fromFile(join(files, `coman-cia402-torso_0x01.eds`));
const master = new Device({ eds: new Eds(), id: MASTER });
const heard = { states: [], beats: 0, emergencies: [], pdos: 0, boots: [] };
const bus = await openBus(await port, "torso", (message) => {
  heard.beats += message.id === 0x700 + NODE;
  heard.pdos += message.id === 0x180 + NODE;
  if (message.id >> 7 === 0x700 >> 7 && message.data[0] === 0) heard.boots.push(message.id & 0x7f);
  master.receive(message);
});
master.on("message", (message) => bus.send(message));
master.nmt.on("heartbeat", ({ deviceId, state }) => deviceId === NODE && heard.states.push(state));
master.emcy.on("emergency", (told) => heard.emergencies.push(told));
master.eds.addSdoClientParameter(NODE, 0x600 + NODE, 0x580 + NODE);
master.eds.addHeartbeatConsumer(NODE, PATIENCE);
master.eds.addEmcyConsumer(0x80 + NODE);

const where = (index, subIndex) => ({ serverId: NODE, index, subIndex, timeout: PATIENCE });
const read = (index, subIndex, dataType) =>
  master.sdo.upload({ ...where(index, subIndex), dataType });
const write = (index, subIndex, dataType, data) =>
  master.sdo.download({ ...where(index, subIndex), dataType, data });

// The abort code of what is refused, undefined of what is not.
async function refusal(transfer) {
  try {
    await transfer;
  } catch (error) {
    return error.code;
  }
  return undefined;
}

await point("a reset node boots up and beats as the EDS says", async (check) => {
  master.start();
  master.nmt.startNode();
  master.nmt.resetNode(NODE);
  check(await until(() => heard.states.includes(NmtState.INITIALIZING)), "no boot-up");
  await write(0x1017, 0, DataType.UNSIGNED16, 20);
  const before = heard.beats;
  check(await until(() => heard.beats > before + 20), `${heard.beats - before} heartbeats`);
  check(heard.states.at(-1) === NmtState.PRE_OPERATIONAL, `${heard.states}`);
});

let compared = 0;
await point("every object has the type and the factory value of the EDS", async (check) => {
  for (const object of objects(eds)) {
    const { index, subIndex, entry } = object;
    if (entry.accessType === "wo") continue;
    if (index === 0x1003 && subIndex > 0) {
      check((await refusal(read(index, subIndex))) === 0x08000024, "an error that was not");
      continue;
    }
    const found = await read(index, subIndex, entry.dataType);
    const factory = factoryValue(entry);
    const moves = entry.accessType === "ro" || index === 0x1017;
    compared++;
    check(found !== null && found !== undefined, `${nameOf(object)} has no value`);
    if (!moves && factory !== undefined) {
      check(Number(found) === factory || found === factory,
        `${nameOf(object)}: ${found}, not ${factory}`);
    }
  }
  check(compared > 500, `${compared} objects`);
});
console.log(`# ${compared} objects read by expedited and segmented uploads`);

// Types that have room above a limit below 0x7fff.
const { INTEGER16, INTEGER32, UNSIGNED16, UNSIGNED32 } = DataType;
const WIDE = new Set([INTEGER16, INTEGER32, UNSIGNED16, UNSIGNED32]);
let written = 0;
await point("what can be written keeps its value, within its limits only", async (check) => {
  for (const object of objects(eds)) {
    const { index, subIndex, entry } = object;
    if (entry.accessType !== "rw" || index < 0x6000 || entry.highLimit === undefined) continue;
    const low = Number(entry.lowLimit ?? 0); // the library drops a limit of 0
    const high = Number(entry.highLimit);
    const before = await read(index, subIndex, entry.dataType);
    for (const value of [low, high, Math.trunc((low + high) / 2)]) {
      const code = await refusal(write(index, subIndex, entry.dataType, value));
      const found = await read(index, subIndex, entry.dataType);
      check(code === undefined ? found === value : found !== undefined,
        `${nameOf(object)}: wrote ${value}, ${code?.toString(16)}, read ${found}`);
      written += code === undefined;
    }
    await write(index, subIndex, entry.dataType, before);
    if (high < 0x7fff && WIDE.has(entry.dataType)) {
      const code = await refusal(write(index, subIndex, entry.dataType, high + 1));
      check(code === 0x06090031, `${nameOf(object)}: ${high + 1} gets ${code?.toString(16)}`);
    }
  }
  check(written > 30, `${written} writes`);
});
console.log(`# ${written} values written and read back`);

await point("what is refused has the abort code of the standard", async (check) => {
  const cases = [
    ["no such object", 0x06020000, read(0x2fff, 0)],
    ["no such sub-index", 0x06090011, read(0x1018, 9)],
    ["writing a constant", 0x06010002, write(0x1000, 0, DataType.UNSIGNED32, 1)],
    ["too long", 0x06070012, write(0x1017, 0, DataType.UNSIGNED32, 1)],
    ["too short", 0x06070013, write(0x1014, 0, DataType.UNSIGNED8, 1)],
    ["a wrong signature to store", 0x08000020, write(0x1010, 1, DataType.UNSIGNED32, 0x12345678)],
  ];
  for (const [name, expected, transfer] of cases) {
    const code = await refusal(transfer);
    check(code === expected, `${name}: ${code?.toString(16)}, expected ${expected.toString(16)}`);
  }
});

const statusword = () => master.eds.getEntry(0x2000).value;

await point("PDOs mapped by SDO come with the library's SYNC", async (check) => {
  // TPDO 1 of axis 0: statusword, position, type 1; RPDO 1: controlword, voltage
  await write(0x1800, 1, DataType.UNSIGNED32, 0x80000180 + NODE);
  await write(0x1a00, 0, DataType.UNSIGNED8, 0);
  await write(0x1a00, 1, DataType.UNSIGNED32, 0x60410010);
  await write(0x1a00, 2, DataType.UNSIGNED32, 0x60640020);
  await write(0x1a00, 0, DataType.UNSIGNED8, 2);
  await write(0x1800, 2, DataType.UNSIGNED8, 1);
  await write(0x1800, 1, DataType.UNSIGNED32, 0x180 + NODE);
  await write(0x1400, 1, DataType.UNSIGNED32, 0x80000200 + NODE);
  await write(0x1600, 0, DataType.UNSIGNED8, 0);
  await write(0x1600, 1, DataType.UNSIGNED32, 0x60400010);
  await write(0x1600, 2, DataType.UNSIGNED32, 0x40000010);
  await write(0x1600, 0, DataType.UNSIGNED8, 2);
  await write(0x1400, 2, DataType.UNSIGNED8, 255);
  await write(0x1400, 1, DataType.UNSIGNED32, 0x200 + NODE);

  // The master's side of the same
  master.eds.addEntry(0x2000, { parameterName: "statusword", dataType: DataType.UNSIGNED16 });
  master.eds.addEntry(0x2001, { parameterName: "position", dataType: DataType.INTEGER32 });
  master.eds.addEntry(0x2002, { parameterName: "controlword", dataType: DataType.UNSIGNED16 });
  master.eds.addEntry(0x2003, { parameterName: "voltage", dataType: DataType.INTEGER16 });
  const entries = (...indices) => indices.map((index) => master.eds.getEntry(index));
  const received = entries(0x2000, 0x2001);
  const sent = entries(0x2002, 0x2003);
  master.eds.addReceivePdo({ cobId: 0x180 + NODE, transmissionType: 1, dataObjects: received });
  master.eds.addTransmitPdo({ cobId: 0x200 + NODE, transmissionType: 255, dataObjects: sent });
  master.eds.setSyncCobId(0x80);
  master.eds.setSyncCyclePeriod(5000);
  master.eds.setSyncGenerationEnable(true);
  master.nmt.startNode(NODE);
  check(await until(() => heard.states.at(-1) === NmtState.OPERATIONAL), `${heard.states}`);
  const before = heard.pdos;
  check(await until(() => heard.pdos > before + 20), `${heard.pdos - before} PDOs with SYNC`);
  check((statusword() & 0x4f) === 0x40, `0x${statusword().toString(16)}`);
});

function command(controlword, voltage) {
  master.eds.getEntry(0x2002).value = controlword;
  master.eds.getEntry(0x2003).value = voltage;
  master.pdo.write(0x200 + NODE);
}

await point("the state machine of CiA 402 goes up and down as its figure says", async (check) => {
  const steps = [
    [0x00, 0x4f, 0x40, "switch on disabled"],
    [0x06, 0x6f, 0x21, "ready to switch on"],
    [0x07, 0x6f, 0x23, "switched on"],
    [0x0f, 0x6f, 0x27, "operation enabled"],
    [0x07, 0x6f, 0x23, "switched on, from enabled"],
    [0x06, 0x6f, 0x21, "ready, from switched on"],
    [0x00, 0x4f, 0x40, "disabled, from ready"],
  ];
  await write(0x6060, 0, DataType.INTEGER8, -1);
  for (const [controlword, mask, expected, name] of steps) {
    command(controlword, 0);
    const reached = await until(() => (statusword() & mask) === expected);
    check(reached, `${name}: 0x${statusword().toString(16)}`);
  }
});

await point("a voltage turns the motor", async (check) => {
  for (const [controlword, state] of [[0x06, 0x21], [0x07, 0x23], [0x0f, 0x27]]) {
    command(controlword, 0);
    await until(() => (statusword() & 0x6f) === state);
  }
  check(await until(() => (statusword() & 0x6f) === 0x27), `0x${statusword().toString(16)}`);
  const position = () => master.eds.getEntry(0x2001).value;
  const before = position();
  const timer = setInterval(() => command(0x0f, 1000), 5); // 2 V;
  check(await until(() => position() - before > 50), `${before} to ${position()}`);
  clearInterval(timer);
  check((statusword() & 0x6f) === 0x27, `0x${statusword().toString(16)}`);
  command(0x00, 0);
});

await point("an RPDO that is too short raises EMCY 0x8210", async (check) => {
  heard.emergencies.length = 0;
  bus.send({ id: 0x200 + NODE, data: Buffer.from([0]) });
  check(await until(() => heard.emergencies.some(({ em }) => (em.code ?? em) === 0x8210)),
    JSON.stringify(heard.emergencies));
});

await point("blocks carry data there and back, with the library's checksum", async (check) => {
  const type = DataType.DOMAIN;
  for (const size of [1, 6, 7, 8, 888, 889, 890, 1024]) {
    const data = Buffer.from(Array.from({ length: size }, (_, i) => (7 * i + size) & 0xff));
    const blocks = { ...where(0x2001, 0), dataType: type, blockTransfer: true, blockInterval: 0 };
    await master.sdo.download({ ...blocks, data });
    check(data.equals(await master.sdo.upload(blocks)), `${size} bytes, by blocks`);
    check(data.equals(await read(0x2001, 0, type)), `${size} bytes, by segments`);
  }
  const long = { ...where(0x2000, 0), blockTransfer: true, blockInterval: 0, data: Buffer.alloc(33) };
  const code = await refusal(master.sdo.download(long));
  check(code === 0x06070012, `33 bytes of text get ${code?.toString(16)}`);
});

await point("LSS finds the node, asks it and gives it another Node-ID", async (check) => {
  const subs = [1, 2, 3, 4];
  const address = await Promise.all(subs.map((sub) => read(0x1018, sub, DataType.UNSIGNED32)));
  const [vendorId, productCode, revisionNumber, serialNumber] = address;
  const identity = { vendorId, productCode, revisionNumber, serialNumber, timeout: PATIENCE };
  const { lss } = master;

  // another Node-ID from the next reset of communication on
  await lss.switchModeSelective(identity);
  check((await lss.inquireVendorId(PATIENCE)) === vendorId, "vendor");
  check((await lss.inquireProductCode(PATIENCE)) === productCode, "product");
  check((await lss.inquireRevisionNumber(PATIENCE)) === revisionNumber, "revision");
  check((await lss.inquireSerialNumber(PATIENCE)) === serialNumber, "serial number");
  check((await refusal(lss.configureBitTiming(0, 0, PATIENCE))) === 1, "a bit rate");
  check((await refusal(lss.configureNodeId(99, PATIENCE))) === 1, "Node-ID 99");
  await lss.configureNodeId(FREE, PATIENCE);
  await lss.storeConfiguration(PATIENCE);
  master.nmt.resetCommunication(NODE);
  master.eds.addSdoClientParameter(FREE, 0x600 + FREE, 0x580 + FREE);
  check(await until(() => heard.boots.includes(FREE)), `boot-ups of ${heard.boots}`);
  const renamed = { serverId: FREE, subIndex: 4, dataType: DataType.UNSIGNED32, timeout: PATIENCE };
  check((await master.sdo.upload({ ...renamed, index: 0x1018 })) === serialNumber, "as node 30");

  // without any it is found by its address, bit by bit
  await lss.switchModeSelective(identity);
  await lss.configureNodeId(255, PATIENCE);
  master.nmt.resetCommunication(FREE);
  const found = await lss.fastscan({ timeout: 600 });
  check(found?.productCode === productCode && found?.serialNumber === serialNumber,
    JSON.stringify(found));
  await lss.configureNodeId(NODE, PATIENCE);
  await lss.storeConfiguration(PATIENCE);
  heard.boots.length = 0;
  lss.switchModeGlobal(LssMode.OPERATION);
  check(await until(() => heard.boots.includes(NODE)), `boot-ups of ${heard.boots}`);
  check((await read(0x1018, 4, DataType.UNSIGNED32)) === serialNumber, "as node 1 again");
});

master.stop();
bus.close();
child.removeAllListeners("exit");
child.kill("SIGTERM");
rmSync(work, { recursive: true });
process.exit(0);
