// The engine as WebAssembly, for against_wasm.rs: a request a line in, the last answer and its CPU time, ms, a line out.
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";

const wasm = await WebAssembly.compile(readFileSync(process.argv[2]));
let last;
const text = (at, length) => new TextDecoder().decode(new Uint8Array(memory.buffer, at, length));
const page = {
  answer: (json, length) => (last = text(json, length)),
  panicked: (words, length) => console.error(text(words, length)),
};
const { exports } = await WebAssembly.instantiate(wasm, { page });
const { memory, reserve, request } = exports;

for await (const line of createInterface({ input: process.stdin })) {
  const json = new TextEncoder().encode(line);
  // Memory may grow: its buffer is looked at after that.
  const at = reserve(json.length, 0);
  new Uint8Array(memory.buffer, at, json.length).set(json);
  const before = process.cpuUsage();
  request();
  const { user, system } = process.cpuUsage(before);
  console.log(JSON.stringify({ cpu_ms: (user + system) / 1000, answer: JSON.parse(last) }));
}
