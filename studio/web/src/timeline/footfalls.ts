// Swings of a footfall pattern, and their edits as pure functions from a row of samples to a row. A swing has at least three
// samples (docs/motion-files.md), and motions at rest begin and end with every foot down.

export type Row = readonly boolean[]; // true: stance
export type Swing = { from: number; length: number };

export const LEAST_SWING = 3;

/** Swings in order of their start. In periodic motions, one may continue past the end. */
export function swingsOf(row: Row, periodic: boolean): Swing[] {
  const n = row.length;
  if (n > 0 && row.every((stance) => !stance)) return [{ from: 0, length: n }];
  const swings: Swing[] = [];
  for (let i = 0; i < n; i++) {
    if (row[i]) continue;
    const before = i > 0 ? row[i - 1] : periodic ? row[n - 1] : true;
    if (!before) continue;
    let length = 1;
    while (length < n && !row[(i + length) % n] && (periodic || i + length < n)) length++;
    swings.push({ from: i, length });
  }
  return swings;
}

export function without(row: Row, swing: Swing): boolean[] {
  return fill(row, swing.from, swing.length, true);
}

/** Moves a swing by some samples. */
export function moved(row: Row, swing: Swing, by: number, periodic: boolean): { row: boolean[]; swing: Swing } {
  const rest = without(row, swing);
  const next = fit({ from: swing.from + by, length: swing.length }, row.length, periodic);
  return { row: fill(rest, next.from, next.length, false), swing: next };
}

/** Moves the start (`lift`) or the end (`land`) of a swing. */
export function resized(row: Row, swing: Swing, edge: "lift" | "land", by: number, periodic: boolean): { row: boolean[]; swing: Swing } {
  const n = row.length;
  const most = periodic ? n - 2 : n - 2;
  let { from, length } = swing;
  if (edge === "land") {
    length = clamp(length + by, LEAST_SWING, periodic ? most : Math.min(most, n - 1 - from));
  } else {
    const end = from + length;
    length = clamp(length - by, LEAST_SWING, periodic ? most : Math.min(most, end - 1));
    from = end - length;
  }
  const next = fit({ from, length }, n, periodic);
  return { row: fill(without(row, swing), next.from, next.length, false), swing: next };
}

/** A swing over the samples between `a` and `b` in any order, extended to the minimum length. */
export function painted(row: Row, a: number, b: number, periodic: boolean): { row: boolean[]; swing: Swing } {
  const from = Math.min(a, b);
  const length = Math.max(LEAST_SWING, Math.abs(b - a) + 1);
  const swing = fit({ from, length: Math.min(length, row.length - 2) }, row.length, periodic);
  return { row: fill(row, swing.from, swing.length, false), swing };
}

function fit(swing: Swing, n: number, periodic: boolean): Swing {
  if (periodic) return { from: ((swing.from % n) + n) % n, length: swing.length };
  return { from: clamp(swing.from, 1, Math.max(1, n - 1 - swing.length)), length: swing.length };
}

function fill(row: Row, from: number, length: number, stance: boolean): boolean[] {
  const next = [...row];
  const n = row.length;
  for (let i = from; i < from + length; i++) next[((i % n) + n) % n] = stance;
  return next;
}

function clamp(value: number, least: number, most: number): number {
  return Math.max(least, Math.min(value, most));
}
