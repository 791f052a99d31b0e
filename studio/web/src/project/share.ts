// A project in a link: the texts, deflated, in the fragment, which browsers never send anywhere.

import type { Snapshot } from "./documents.ts";

const PREFIX = "#project=";
/** A link that unpacks to more was not made by this page. */
const MOST_BYTES = 4_000_000;

export async function linkTo(snapshot: Snapshot): Promise<string> {
  const bytes = new TextEncoder().encode(JSON.stringify({ files: snapshot.files, motion: snapshot.motion }));
  const packed = await through(new Blob([bytes]).stream().pipeThrough(new CompressionStream("deflate-raw")), Infinity);
  let text = "";
  for (const byte of packed) text += String.fromCharCode(byte);
  const base = btoa(text).replace(/\+/g, "-").replace(/\//g, "_").replace(/=+$/, "");
  // Without the query, which may contain the token of a server.
  const page = new URL(location.href);
  page.search = page.hash = "";
  return `${page.href}${PREFIX}${base}`;
}

/** Project in this page's address, if any. */
export async function fromLink(hash: string): Promise<Snapshot | null> {
  if (!hash.startsWith(PREFIX)) return null;
  const text = atob(hash.slice(PREFIX.length).replace(/-/g, "+").replace(/_/g, "/"));
  const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const unpacked = await through(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw")), MOST_BYTES);
  const { files, motion } = JSON.parse(new TextDecoder().decode(unpacked));
  const sound = Array.isArray(files) && files.every((file) => typeof file?.path === "string" && typeof file?.text === "string");
  if (!sound || typeof motion !== "string") throw new Error("the link does not contain a project");
  return { files, motion };
}

async function through(stream: ReadableStream<Uint8Array>, most: number): Promise<Uint8Array> {
  const parts: Uint8Array[] = [];
  let length = 0;
  const reader = stream.getReader();
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    length += value.length;
    if (length > most) throw new Error(`the link unpacks to more than ${most / 1e6} MB`);
    parts.push(value);
  }
  const all = new Uint8Array(length);
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}
