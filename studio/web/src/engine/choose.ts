// Choice of the engine: that of the program that serves the page, if the program offers one, else the engine in the page.

import type { Engine } from "./engine.ts";
import { SocketEngine } from "./socket.ts";
import { compile, WasmEngine } from "./wasm.ts";

export async function chooseEngine(): Promise<Engine> {
  const meta = (name: string) => document.querySelector<HTMLMetaElement>(`meta[name="${name}"]`)?.content;
  if (meta("engine") !== "websocket") return new WasmEngine(await compile());
  const address = new URL("engine", location.href);
  address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  address.hash = "";
  address.search = new URLSearchParams({ token: meta("token") ?? "" }).toString();
  return new SocketEngine(address.href);
}
