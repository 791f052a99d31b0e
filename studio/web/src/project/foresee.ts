// Effect of an edit on the shown motion, before the engine answers with the new text.

import type { Edit, MotionView, Scene } from "../contract.ts";

export function predict(edit: Edit, motion: MotionView, scene: Scene): { motion: MotionView; scene: Scene } {
  const next: MotionView = { ...motion };
  switch (edit.edit) {
    case "number":
      if (edit.table.length === 0) (next as Record<string, unknown>)[edit.key] = edit.value;
      else if (edit.table[0] === "goal") next.goal = { ...motion.goal, [edit.key]: edit.value };
      if (edit.key === "samples" && edit.value) next.stance = resampled(motion.stance, edit.value);
      break;
    case "footfalls":
      next.stance = edit.stance;
      break;
    case "swing":
      next.stance = motion.stance.map((row, index) => (index === edit.end_effector ? set(row, edit) : row));
      break;
    case "target":
      next.targets = changed(motion.targets, edit.index, edit.target);
      break;
    case "height":
      next.heights = changed(motion.heights, edit.index, edit.height);
      break;
    case "parameter":
      return {
        motion,
        scene: {
          ...scene,
          parameters: scene.parameters.map((one) => (one.name === edit.name ? { ...one, value: edit.value } : one)),
        },
      };
    default:
      break;
  }
  return { motion: next, scene };
}

function changed<T>(list: T[], index: number | null, value: T | null): T[] {
  if (index === null) return value === null ? list : [...list, value];
  return list.flatMap((one, at) => (at !== index ? [one] : value === null ? [] : [value]));
}

function set(row: boolean[], edit: { from: number; to: number; stance: boolean }): boolean[] {
  const next = [...row];
  const n = row.length;
  for (let i = edit.from; i < edit.to; i++) next[((i % n) + n) % n] = edit.stance;
  return next;
}

/** Resamples stance rows to a number of samples (docs/motion-files.md). */
function resampled(stance: boolean[][], samples: number): boolean[][] {
  return stance.map((row) => Array.from({ length: samples }, (_, i) => row[Math.floor((i * row.length) / samples)]));
}
