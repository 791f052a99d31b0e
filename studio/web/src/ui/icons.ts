// Icons, drawn as strokes on a grid of 20.

import { icon } from "./dom.ts";

const PATHS = {
  play: "M6 4l10 6-10 6z",
  pause: "M7 4v12M13 4v12",
  start: "M5 4v12M15 4l-8 6 8 6z",
  loop: "M4 10a6 6 0 0 1 10.5-4L16 8M16 4v4h-4M16 10a6 6 0 0 1-10.5 4L4 12M4 16v-4h4",
  undo: "M8 5L4 9l4 4M4 9h8a4 4 0 0 1 0 8H9",
  redo: "M12 5l4 4-4 4M16 9H8a4 4 0 0 0 0 8h3",
  open: "M3 16V5h5l2 2h7v9z",
  save: "M4 4h10l2 2v10H4zM7 4v4h6V4M7 16v-5h6v5",
  theme: "M10 3a7 7 0 1 0 0 14zM10 3a7 7 0 0 1 0 14",
  help: "M7.5 7.5a2.5 2.5 0 1 1 3.5 2.3c-.7.3-1 .8-1 1.7M10 14.5v.5",
  share: "M8 10l5-3M8 10l5 3M6 12a2 2 0 1 0 0-4 2 2 0 0 0 0 4zM15 8a2 2 0 1 0 0-4 2 2 0 0 0 0 4zM15 16a2 2 0 1 0 0-4 2 2 0 0 0 0 4z",
  plus: "M10 4v12M4 10h12",
  remove: "M5 5l10 10M15 5L5 15",
  layers: "M10 3l7 4-7 4-7-4zM3 11l7 4 7-4",
  stop: "M6 6h8v8H6z",
  down: "M5 8l5 5 5-5",
} as const;

export type IconName = keyof typeof PATHS;

export function picture(name: IconName): SVGElement {
  return icon(PATHS[name]);
}
