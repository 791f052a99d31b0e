// Writes pictures of the page to a folder: node test/screenshots.mjs FOLDER [NAME]... Without names, all pictures.
import { mkdir } from "node:fs/promises";
import { join } from "node:path";
import { launch, serve, Studio } from "./harness.mjs";

const folder = process.argv[2] ?? "build/screenshots";
const names = process.argv.slice(3);
await mkdir(folder, { recursive: true });
const server = await serve();
const browser = await launch("chromium");
const desktop = { width: 1440, height: 900 };

async function picture(name, options, act = async () => {}) {
  if (names.length > 0 && !names.includes(name)) return;
  const context = await browser.createBrowserContext();
  const studio = await Studio.open(context, `${server.origin}/?quality=${options.quality ?? "high"}`, options);
  await act(studio);
  await studio.page.evaluate(() => new Promise((done) => requestAnimationFrame(() => setTimeout(done, 600))));
  await studio.page.screenshot({ path: join(folder, `${name}.png`) });
  console.log(`${name}.png`, studio.errors.length ? studio.errors : "");
  await context.close();
}

const seek = (time_s) => (studio) => studio.page.evaluate((time_s) => globalThis.studio.playback.seek(time_s), time_s);
await picture("light", { theme: "light", viewport: desktop }, seek(0.6));
await picture("dark", { theme: "dark", viewport: desktop }, seek(0.6));
await picture("tablet", { theme: "light", viewport: { width: 820, height: 1180 } }, seek(0.6));
await picture("trouble", { theme: "light", viewport: desktop }, async (studio) => {
  await studio.example("motions/test_leg_roll.toml");
  await studio.edit(() => studio.type("Forward", "3"));
  await studio.click(".culprit");
});
await picture("target", { theme: "dark", viewport: desktop }, async (studio) => {
  await studio.page.evaluate(() => globalThis.studio.playback.seek(0.8));
  await studio.edit(() => studio.button("Add target"));
  await studio.edit(() => studio.button("Add height limit"));
});
await picture("robot", { theme: "light", viewport: desktop }, (studio) => studio.click("#tab-robot"));
await picture("report", { theme: "light", viewport: desktop }, async (studio) => {
  await studio.click("#tab-report");
  await studio.page.waitForSelector(".report tbody tr");
});
await picture("text", { theme: "dark", viewport: desktop }, async (studio) => {
  await studio.click("#tab-text");
  await studio.edit(() =>
    studio.page.evaluate(() => {
      const area = document.querySelector(".text");
      area.value = area.value.replace("samples = 32", "samples = -3");
      area.dispatchEvent(new Event("input"));
    }),
  );
});
await picture("examples", { theme: "light", viewport: desktop }, (studio) => studio.button("Examples").then(() => studio.page.waitForSelector(".example")));
await picture("skate", { theme: "light", viewport: desktop }, (studio) => studio.example("motions/skate.toml"));
await picture("drive", { theme: "dark", viewport: desktop }, (studio) => studio.example("motions/drive_1m.toml"));
await picture("library", { theme: "light", viewport: desktop }, async (studio) => {
  await studio.example("motions/agilebot_library.toml");
  await studio.click("#tab-library");
  await studio.button("Build library");
  await studio.page.waitForSelector("[data-built]", { timeout: 240_000 });
});
await picture("run", { theme: "light", viewport: desktop }, async (studio) => {
  await studio.example("motions/agilebot_library.toml");
  if (!(await studio.page.waitForSelector("#tab-run", { visible: true, timeout: 5000 }).catch(() => null))) return;
  await studio.click("#tab-run");
  await studio.click(".run .flash");
  await studio.button("Connect");
  await studio.until(() => globalThis.studio.link.view?.contact);
  await studio.until(() => document.querySelector(".run .flash").textContent === "Flash library");
  await studio.click(".run .flash");
  await studio.until(() => globalThis.studio.link.view.motions.length > 1);
});
await browser.close();
server.close();
