// Edits of swings, without a browser.
import assert from "node:assert/strict";
import { test } from "node:test";
import { load } from "./load.mjs";

const { swingsOf, moved, resized, painted, without } = await load("src/timeline/footfalls.ts");
const row = (text) => [...text].map((letter) => letter === "#");
const text = (row) => row.map((stance) => (stance ? "#" : ".")).join("");

test("swings are found, also over the end of a period", () => {
  assert.deepEqual(swingsOf(row("##...###"), true), [{ from: 2, length: 3 }]);
  assert.deepEqual(swingsOf(row(".####..."), true), [{ from: 5, length: 4 }]);
  assert.deepEqual(swingsOf(row("#...#..#"), false), [{ from: 1, length: 3 }, { from: 5, length: 2 }]);
  assert.deepEqual(swingsOf(row("........"), true), [{ from: 0, length: 8 }]);
  assert.deepEqual(swingsOf(row("########"), true), []);
});

test("a swing moves over the end of a period, and stops at the end of a motion at rest", () => {
  const [swing] = swingsOf(row("###...##"), true);
  assert.equal(text(moved(row("###...##"), swing, 3, true).row), ".#####..");
  assert.equal(text(moved(row("###...##"), swing, 3, false).row), "####...#");
  assert.equal(text(moved(row("###...##"), swing, -9, false).row), "#...####");
});

test("a swing keeps at least three samples and leaves two of stance", () => {
  const before = row("##....####");
  const [swing] = swingsOf(before, true);
  assert.equal(text(resized(before, swing, "land", -3, true).row), "##...#####");
  assert.equal(text(resized(before, swing, "lift", 3, true).row), "###...####");
  assert.equal(text(resized(before, swing, "land", 20, true).row), "##........");
  assert.equal(text(resized(before, swing, "land", 20, false).row), "##.......#");
  assert.equal(text(resized(before, swing, "lift", -20, false).row), "#.....####");
});

test("a stroke paints a swing in either direction", () => {
  assert.equal(text(painted(row("##########"), 3, 6, true).row), "###....###");
  assert.equal(text(painted(row("##########"), 6, 3, true).row), "###....###");
  assert.equal(text(painted(row("##########"), 4, 4, true).row), "####...###");
  assert.equal(text(painted(row("##########"), 9, 9, false).row), "######...#");
});

test("a removed swing leaves stance", () => {
  const before = row(".####...");
  assert.equal(text(without(before, swingsOf(before, true)[0])), "########");
});
