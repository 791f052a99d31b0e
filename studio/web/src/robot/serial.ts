// A serial port of this computer. The user chooses the port in the page by a click. The worker then finds the port among those that
// the page may use, so that bytes do not pass through the page. (Streams of a port can be transferred to a worker, but the page
// would still move their bytes.)

import type { PortEvents, Port } from "./port.ts";

/** Web Serial, which TypeScript's library does not declare yet. */
export type SerialPort = {
  getInfo(): SerialInfo;
  open(options: { baudRate: number }): Promise<void>;
  close(): Promise<void>;
  readable: ReadableStream<Uint8Array>;
  writable: WritableStream<Uint8Array>;
};
/** Identity of a port: its adapter's USB numbers. */
export type SerialInfo = { usbVendorId?: number; usbProductId?: number };

const { serial } = navigator as unknown as { serial?: { requestPort(): Promise<SerialPort>; getPorts(): Promise<SerialPort[]> } };

export const hasSerial = serial !== undefined;

export function choosePort(): Promise<SerialPort> {
  return serial!.requestPort();
}

/** Port with the given identity; null if the browser lists none or several. */
export async function findPort({ usbVendorId, usbProductId }: SerialInfo): Promise<SerialPort | null> {
  const is = (info: SerialInfo) => info.usbVendorId === usbVendorId && info.usbProductId === usbProductId;
  const found = ((await serial?.getPorts()) ?? []).filter((port) => is(port.getInfo()));
  return found.length === 1 ? found[0] : null;
}

export async function openSerial(port: SerialPort, baud: number, heard: PortEvents): Promise<Port> {
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
    send: (bytes) => void writer.write(bytes).catch((error: Error) => closed || heard.lost(`the serial port accepts no bytes: ${error.message}`)),
    async close() {
      closed = true;
      await reader.cancel().catch(() => {});
      reader.releaseLock();
      await writer.close().catch(() => {});
      await port.close().catch(() => {});
    },
  };
}
