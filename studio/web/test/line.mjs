// A fake serial port for the page: `navigator.serial` as in browsers, and in Node the other end of the cable: a controller's line
// at a pseudo terminal, or a CAN adapter with SLCAN.
import { connect } from "node:net";
import { child } from "./programs.mjs";
import { within } from "./within.mjs";

/** Installs ports that behave like Web Serial in the page, before its scripts. Bytes arrive in pieces of any length. With `inWorkers`
 * the page's workers have the ports too. */
export function fakeSerial(inWorkers) {
  const isPage = typeof document !== "undefined";
  const fake = { port: null, baud: 0, refusal: null, failure: null, isOpen: false };
  // Channel between the page and its workers.
  const between = new BroadcastChannel("serial");
  const opened = (isOpen, baud = fake.baud) => {
    Object.assign(fake, { isOpen, baud });
    if (!isPage) between.postMessage({ isOpen, baud });
  };
  const sent = (bytes) => (isPage ? globalThis.serialOut(bytes) : between.postMessage({ sent: bytes }));
  between.onmessage = ({ data }) => {
    if (data.arrived) fake.arrive(data.arrived);
    else if (data.sent) sent(data.sent);
    else Object.assign(fake, data);
  };
  let into = null;
  let out = null;
  let pieces = 0;
  class Port {
    readable = null;
    writable = null;
    async open({ baudRate }) {
      if (fake.failure) throw new DOMException(fake.failure, "NetworkError");
      if (fake.isOpen) throw new DOMException("The port is already open.", "InvalidStateError");
      opened(true, baudRate);
      const ends = (name) => () => (this[name] = null);
      this.readable = new ReadableStream({ start: (controller) => (into = controller), cancel: ends("readable") });
      const write = (bytes) => sent([...bytes]);
      this.writable = new WritableStream({ start: (controller) => (out = controller), write, close: ends("writable"), abort: ends("writable") });
    }
    async close() {
      if (this.readable?.locked || this.writable?.locked) throw new TypeError("Cannot cancel a locked stream");
      opened(false);
    }
    getInfo() {
      return { usbVendorId: 0x0403, usbProductId: 0x6001 };
    }
  }
  fake.arrive = (bytes) => {
    if (isPage && inWorkers) return between.postMessage({ arrived: bytes });
    for (let at = 0; at < bytes.length && fake.port?.readable; ) {
      const length = 1 + ((7 * ++pieces) % 11);
      into.enqueue(Uint8Array.from(bytes.slice(at, at + length)));
      at += length;
    }
  };
  /** Unplugs the adapter. */
  fake.lose = () => {
    const lost = new DOMException("The device has been lost.", "NetworkError");
    into.error(lost);
    out.error(lost);
    [fake.port.readable, fake.port.writable] = [null, null];
  };
  if (!isPage) fake.port = new Port();
  const getPorts = async () => [fake.port];
  const requestPort = async () => {
    if (fake.refusal) throw new DOMException("No port selected by the user.", fake.refusal);
    return (fake.port = new Port());
  };
  globalThis.fakeSerial = fake;
  Object.defineProperty(navigator, "serial", { value: { requestPort, getPorts } });
  if (!isPage || !inWorkers) return;
  const Plain = Blob;
  globalThis.Blob = class extends Plain {
    constructor(parts, options) {
      super(options?.type === "text/javascript" ? [`(${fakeSerial})(true);`, ...parts] : parts, options);
    }
  };
}

/** A line with a pseudo terminal at its far end, whose name is `device`. */
export async function serialLine(heard) {
  const source = `
import os, pty, select, sys, tty
near, far = pty.openpty()
tty.setraw(far)
os.write(1, os.ttyname(far).encode() + b"\\n")
while True:
    for ready in select.select([near, 0], [], [])[0]:
        data = os.read(ready, 4096)
        if not data:
            sys.exit()
        os.write(1 if ready == near else near, data)
`;
  const program = child("python3", ["-c", source], { stdio: ["pipe", "pipe", "inherit"] });
  const device = await within("the name of a pseudo terminal", new Promise((resolve) => program.stdout.once("data", (name) => resolve(String(name).trim()))));
  program.stdout.on("data", (bytes) => heard(bytes));
  return { device, send: (bytes) => program.stdin.write(bytes), close: () => program.stdin.end() };
}

/** An SLCAN adapter on the link of a simulated robot. */
export async function slcanAdapter(socket, heard) {
  const robot = connect(socket);
  await within(`a connection to ${socket}`, new Promise((resolve, reject) => robot.once("connect", resolve).once("error", reject)));
  let isOpen = false;
  let text = "";
  let packet = [];
  robot.on("data", (bytes) => {
    for (const byte of bytes) {
      if (byte !== 0) packet.push(byte);
      else {
        const [kind, low, high, length, ...rest] = unstuffed(packet);
        packet = [];
        const hex = rest.slice(0, length).map((one) => one.toString(16).padStart(2, "0"));
        if (kind === LINK && isOpen) heard(Buffer.from(`t${(low + 256 * high).toString(16).padStart(3, "0")}${length}${hex.join("")}\r`));
      }
    }
  });
  const obey = (order) => {
    const frame = /^t([0-7][0-9a-f]{2})([0-8])((?:[0-9a-f]{2})*)$/i.exec(order);
    if (frame && isOpen) {
      const id = parseInt(frame[1], 16);
      const body = [LINK, id & 255, id >> 8, Number(frame[2]), ...Buffer.from(frame[3], "hex")];
      robot.write(Buffer.from([...stuffed([...body, ...crc32c(body)]), 0]));
    } else if (order === "O" || order === "C") isOpen = order === "O";
    else if (order !== "S8" && order !== "") return "\x07";
    return "\r";
  };
  return {
    send(bytes) {
      text += bytes.toString("latin1");
      const orders = text.split("\r");
      text = orders.pop();
      for (const order of orders) heard(Buffer.from(obey(order)));
    },
    close: () => robot.destroy(),
  };
}

/** A packet with a frame of the link (docs/formats/wire-format.md). */
const LINK = 16;

function stuffed(bytes) {
  const out = [];
  for (const part of split(bytes)) out.push(part.length + 1, ...part);
  return out;
}

/** Splits bytes at zeros; a packet has fewer than 254 bytes. */
function split(bytes) {
  const parts = [[]];
  for (const byte of bytes) byte === 0 ? parts.push([]) : parts.at(-1).push(byte);
  return parts;
}

function unstuffed(bytes) {
  const out = [];
  for (let at = 0; at < bytes.length; at += bytes[at]) out.push(...bytes.slice(at + 1, at + bytes[at]), 0);
  return out.slice(0, -1);
}

function crc32c(bytes) {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; bit++) crc = (crc >>> 1) ^ (crc & 1 ? 0x82f63b78 : 0);
  }
  return [0, 8, 16, 24].map((shift) => (~crc >>> shift) & 255);
}
