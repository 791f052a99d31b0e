// Bounds on waits. Each failure names what was awaited.

/** Longest wait on a busy computer. */
export const WAIT_MS = Number(process.env.STUDIO_WAIT_MS ?? 60_000);

/** Settles with a promise, or fails after some time. `what` describes what was awaited; a function can describe the progress. */
export async function within(what, promise, ms = WAIT_MS) {
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Error(`not within ${ms / 1000} s: ${typeof what === "function" ? what() : what}`)), ms);
  });
  try {
    return await Promise.race([promise, late]);
  } finally {
    clearTimeout(timer);
  }
}
