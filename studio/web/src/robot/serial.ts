// A serial port of this computer. It is chosen in the page, by a click; the worker then finds it among the ports that the page may
// use, so that bytes do not pass through the page. (A port's streams can be handed over to a worker, but the page goes on pumping them.)

import type { PortEvents, Port } from "./port.ts";

/** Web Serial, of which TypeScript's library knows nothing yet. */
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

/** The port that is so known; null if the browser shows none or several here. */
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
