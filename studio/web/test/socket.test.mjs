// The page with its engine behind WebSockets, as `rollwalk studio` serves it. Here the engine is the same WebAssembly in Node.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { after, before, describe, test } from "node:test";
import { WebSocketServer } from "ws";
import { launch, serve, Studio, WASM } from "./harness.mjs";
import { load } from "./load.mjs";

describe("an engine behind WebSockets", () => {
  let server, sockets, browser, studio;
  const connected = [];
  before(async () => {
    const { Door } = await load("src/engine/door.ts");
    const module = new WebAssembly.Module(await readFile(WASM));
    server = await serve((html) => html.replace("<title>", '<meta name="engine" content="websocket"><meta name="token" content="secret"><title>'));
    sockets = new WebSocketServer({ server: server.server, path: "/engine" });
    sockets.on("connection", (socket, request) => {
      connected.push(request.url);
      const door = new Door(module, (json, binary) => {
        socket.send(JSON.stringify({ ...JSON.parse(json), binary: binary !== null }));
        if (binary) socket.send(binary);
      });
      let header = null;
      socket.on("message", (data, isBinary) => {
        if (isBinary) door.request(header, new Uint8Array(data));
        else if (JSON.parse(data).binary) header = String(data);
        else door.request(String(data), null);
      });
    });
    browser = await launch("chromium");
    studio = await Studio.open(browser, `${server.origin}/?quality=low`);
  });
  after(async () => {
    await browser?.close();
    sockets?.close();
    server?.close();
  });

  test("plans, with the token of the page", async () => {
    assert.equal(await studio.converged(), true);
    assert.ok(connected.length > 0 && connected.every((url) => url === "/engine?token=secret"), connected.join());
    assert.ok(!studio.requests.some((url) => url.endsWith(".wasm")));
  });

  test("follows an edit", async () => {
    await studio.edit(() => studio.type("Forward", "0.1"));
    assert.equal(await studio.converged(), true);
    assert.match(await studio.text(), /^forward_m = 0\.1$/m);
  });

  test("after a lost connection the next edit connects again", async () => {
    for (const socket of sockets.clients) socket.close();
    const before = connected.length;
    await studio.edit(() => studio.type("Forward", "0.11"));
    assert.ok(connected.length > before);
    assert.equal(await studio.converged(), true);
    assert.match(await studio.text(), /^forward_m = 0\.11$/m);
  });

  test("no error on the console, but for the connection that was lost", () => {
    assert.deepEqual(studio.errors.filter((error) => !/connection to rollwalk was lost/.test(error)), []);
  });
});
