// Connection that carries bytes to and from a robot, and the connection through the program that serves the page.

export interface Port {
  send(bytes: Uint8Array): void;
  close(): Promise<void>;
}

export type PortEvents = { bytes(bytes: Uint8Array): void; lost(why: string): void };

/** A bus of the computer where `rollwalk studio` runs. */
export function openRelay(address: string, heard: PortEvents): Promise<Port> {
  const socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  let closed = false;
  return new Promise((resolve, reject) => {
    socket.onopen = () => {
      socket.onclose = ({ reason }) => closed || heard.lost(reason || "rollwalk studio closed its relay to the bus");
      resolve({
        send: (bytes) => socket.send(bytes as Uint8Array<ArrayBuffer>),
        async close() {
          closed = true;
          socket.close();
        },
      });
    };
    socket.onmessage = ({ data }) => heard.bytes(new Uint8Array(data));
    socket.onclose = () => reject(new Error("the relay of rollwalk studio does not answer; check that `rollwalk studio --bus` still runs"));
  });
}
