// Frames between rows and beyond the period.
import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./load.mjs";

const { Frames } = await load("src/project/frames.ts");

// One link and its wheel. In a period of 1 s, shown at 4 Hz, the link moves by 1 m in x, and turns by 90 degrees at its
// end; the wheel turns by 2 rad about y.
const columns = { bodies: 0, com: 14, end_effectors: 17, joints: 24, wheels: 24 };
const header = { count: 4, rate_hz: 4, duration_s: 1, width: 24, columns, period: { offset_m: [1, 0], yaw_rad: Math.PI / 2 } };
const data = new Float32Array(4 * 24);
for (let k = 0; k < 4; k++) {
  const [x, half] = [k / 4, k / 4];
  data.set([x, 0, 0.3, 1, 0, 0, 0, x, 0, 0.05, Math.cos(half), 0, Math.sin(half), 0, x, 0, 0.3, 1, x, 0, 0, 10, 0, 50], k * 24);
}
const frames = new Frames(header, data, [{ body: 0, wheel_body: 1, contact: "actuated_wheel" }]);
const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-5, `${a} is not ${b}`);

test("poses between rows are on the way", () => {
  near(frames.at(0.125)[0], 0.125);
  near(frames.at(0.875)[0], 0.875); // between the last row and the first of the next period
});

test("the next period is turned and moved", () => {
  const row = frames.at(1.5); // 0.5 m on, in a world turned by 90 degrees about z, from (1, 0)
  near(row[0], 1);
  near(row[1], 0.5);
  near(row[3], Math.SQRT1_2);
  near(row[6], Math.SQRT1_2);
  const force = frames.force(row, 0);
  near(force[0], 0);
  near(force[1], 10);
  const later = frames.at(2.5);
  near(later[0], 0.5);
  near(later[1], 1);
});

test("a wheel goes on turning in the next period", () => {
  // Relative to the link: 0.5 s after the end of the first period it has turned by 3 rad about y.
  const row = frames.at(1.5);
  const [w, , , z] = row.slice(3, 7);
  const [a, b, c, d] = row.slice(10, 14);
  // conjugate(link) * wheel, of which the y part is the sine of half the angle
  const relative = [w * a + z * d, w * b + z * c, w * c - z * b, w * d - z * a];
  near(Math.abs(relative[0]), Math.abs(Math.cos(1.5)));
  near(Math.abs(relative[2]), Math.abs(Math.sin(1.5)));
});
