// The view as a picture, and a run of the motion as a video. The browser itself makes both.

import type { Playback } from "../project/playback.ts";
import { download } from "../project/files.ts";
import type { Stage } from "./stage.ts";

const FRAMES_HZ = 30;
export const canRecord = typeof MediaRecorder !== "undefined" && MediaRecorder.isTypeSupported("video/webm");

export function savePicture(stage: Stage, name: string) {
  // Draws again, because the previous drawing is lost after the browser has shown it.
  stage.draw();
  stage.canvas.toBlob(async (blob) => blob && download(name, new Uint8Array(await blob.arrayBuffer())));
}

/** Plays the motion once from its start and records the view. */
export async function saveVideo(stage: Stage, playback: Playback, name: string) {
  const recorder = new MediaRecorder(stage.canvas.captureStream(FRAMES_HZ), { mimeType: "video/webm", videoBitsPerSecond: 6_000_000 });
  const parts: Blob[] = [];
  recorder.ondataavailable = ({ data }) => parts.push(data);
  const ended = new Promise((resolve) => (recorder.onstop = resolve));
  const { loop } = playback;
  playback.pause();
  playback.seek(0);
  playback.loop = false;
  recorder.start();
  playback.play();
  const forget = playback.onChange(() => !playback.playing && recorder.state === "recording" && recorder.stop());
  await ended;
  forget();
  playback.loop = loop;
  download(name, new Uint8Array(await new Blob(parts).arrayBuffer()));
}
