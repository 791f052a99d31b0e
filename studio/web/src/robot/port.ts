// The ways bytes take to a robot: a serial port of this computer, a relay of the program that serves the page, or none.

import type { Place } from "../contract.ts";

export interface Port {
  send(bytes: Uint8Array): void;
  close(): Promise<void>;
}

type Heard = { bytes(bytes: Uint8Array): void; lost(why: string): void };

/** Web Serial, of which TypeScript's library knows nothing yet. */
type SerialPort = {
  open(options: { baudRate: number }): Promise<void>;
  close(): Promise<void>;
  readable: ReadableStream<Uint8Array>;
  writable: WritableStream<Uint8Array>;
};
const { serial } = navigator as unknown as { serial?: { requestPort(): Promise<SerialPort> } };

const meta = (name: string) => document.querySelector<HTMLMetaElement>(`meta[name="${name}"]`)?.content;

/** The bus that the serving program relays, by its name. */
export const relayedBus = meta("relay");
export const hasSerial = serial !== undefined;

export async function openPort(place: Place, baud: number, heard: Heard): Promise<Port> {
  if (place === "relay") return openRelay(heard);
  if (place === "simulated" || !serial) return { send() {}, async close() {} };
  const port = await serial.requestPort();
  await port.open({ baudRate: baud });
  const reader = port.readable.getReader();
  const writer = port.writable.getWriter();
  let closed = false;
  const listen = async () => {
    try {
      for (;;) {
        const { value, done } = await reader.read();
        if (done) break;
        heard.bytes(value);
      }
      if (!closed) heard.lost("the serial port was closed");
    } catch (error) {
      if (!closed) heard.lost(`the serial port was lost: ${(error as Error).message}`);
    }
  };
  void listen();
  return {
    send: (bytes) => void writer.write(bytes).catch((error: Error) => closed || heard.lost(`the serial port takes no bytes: ${error.message}`)),
    async close() {
      closed = true;
      await reader.cancel().catch(() => {});
      reader.releaseLock();
      await writer.close().catch(() => {});
      await port.close().catch(() => {});
    },
  };
}

function openRelay(heard: Heard): Promise<Port> {
  const address = new URL("link", location.href);
  address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  address.hash = "";
  address.search = new URLSearchParams({ token: meta("token") ?? "" }).toString();
  const socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  let closed = false;
  return new Promise((resolve, reject) => {
    socket.onopen = () => {
      socket.onclose = ({ reason }) => closed || heard.lost(reason || "the relay of rollwalk studio was closed");
      resolve({
        send: (bytes) => socket.send(bytes as Uint8Array<ArrayBuffer>),
        async close() {
          closed = true;
          socket.close();
        },
      });
    };
    socket.onmessage = ({ data }) => heard.bytes(new Uint8Array(data));
    socket.onclose = () => reject(new Error("the relay of rollwalk studio does not answer"));
  });
}
