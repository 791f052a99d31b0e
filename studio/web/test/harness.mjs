// Serves the page with its engine, and drives it in a real browser like a user: mouse, keyboard, reload. Waits are for a version of
// the documents with a complete plan, never for a duration.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { access, readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { dirname, extname, join } from "node:path";
import { fileURLToPath } from "node:url";
import puppeteer from "puppeteer-core";
import { child } from "./programs.mjs";
import { WAIT_MS, within } from "./within.mjs";

const here = dirname(fileURLToPath(import.meta.url));
export const DIST = process.env.STUDIO_DIST ?? join(here, "../../dist");
export const WASM = process.env.STUDIO_WASM ?? join(here, "../../../target/studio/studio.wasm");
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm" };
const PROGRAMS = { chromium: "/usr/bin/chromium", firefox: "/usr/bin/firefox-esr" };

/** Serves the page. `changed` may change index.html, like a program that serves the page. */
export async function serve(changed = (html) => html) {
  await access(WASM).catch(() => assert.fail(`no engine at ${WASM}: build it with \`cargo xtask studio\`, or name it in STUDIO_WASM`));
  const server = createServer(async (request, response) => {
    const path = new URL(request.url, "http://page").pathname;
    const name = path === "/" ? "index.html" : path.slice(1);
    try {
      const file = await readFile(name === "studio.wasm" ? WASM : join(DIST, name));
      const body = name === "index.html" ? changed(String(file)) : file;
      response.writeHead(200, { "content-type": TYPES[extname(name)] ?? "application/octet-stream" });
      response.end(body);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { server, origin: `http://127.0.0.1:${server.address().port}`, close: () => server.close() };
}

/** A display for Firefox, whose headless mode has no WebGL without a GPU. */
async function display() {
  if (spawnSync("which", ["Xvfb"]).status !== 0) return null;
  const program = child("Xvfb", ["-displayfd", "3", "-screen", "0", "1600x1200x24", "-nolisten", "tcp"], { stdio: ["ignore", "ignore", "ignore", "pipe"] });
  const number = await within("the display of Xvfb", new Promise((resolve) => program.stdio[3].once("data", (data) => resolve(String(data).trim()))));
  return { name: `:${number}`, close: () => program.kill() };
}

export async function launch(name) {
  const executablePath = process.env[`STUDIO_${name.toUpperCase()}`] ?? PROGRAMS[name];
  if (name === "chromium") {
    // Root has no user namespaces for a sandbox.
    return closing(await puppeteer.launch({ executablePath, headless: true, timeout: WAIT_MS, args: process.getuid() === 0 ? ["--no-sandbox"] : [] }));
  }
  const screen = await display();
  const browser = await puppeteer.launch({
    browser: "firefox",
    executablePath,
    timeout: WAIT_MS,
    headless: screen === null,
    env: { ...process.env, DISPLAY: screen?.name ?? "", LIBGL_ALWAYS_SOFTWARE: "1" },
    extraPrefsFirefox: { "webgl.force-enabled": true },
  });
  return closing(browser, () => screen?.close());
}

/** A browser, which is killed if it does not close. */
function closing(browser, then = () => {}) {
  const close = browser.close.bind(browser);
  browser.close = async () => {
    const process = browser.process();
    try {
      await within("the end of the browser", close());
    } finally {
      process?.kill("SIGKILL");
      then();
    }
  };
  return browser;
}

/** Messages of browsers about rendering in software, which the page does not cause. */
const NOISE = /software WebGL|GPU stall|GL Driver Message|WebGL context was lost|WEBGL_debug_renderer_info/i;

export class Studio {
  errors = [];
  requests = [];
  /** Questions of the browser, each answered with yes. */
  questions = [];

  static async open(browser, url, options = {}) {
    const studio = new Studio();
    studio.page = await browser.newPage();
    const { page } = studio;
    page.setDefaultTimeout(WAIT_MS);
    await page.setViewport({ width: 1280, height: 860, ...options.viewport });
    if (options.theme) await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: options.theme }]);
    page.on("console", (message) => {
      if (["error", "warn"].includes(message.type()) && !NOISE.test(message.text())) studio.errors.push(message.text());
    });
    page.on("pageerror", (error) => studio.errors.push(String(error)));
    page.on("request", (request) => studio.requests.push(request.url()));
    page.on("dialog", (dialog) => {
      studio.questions.push(dialog.type());
      void dialog.accept();
    });
    await options.before?.(page);
    await page.goto(url);
    await studio.settled();
    return studio;
  }

  /** Waits until the present documents are planned completely, or have faults. */
  async settled() {
    const settled = () => {
      const state = globalThis.studio?.state;
      if (document.querySelector(".stopped")) throw new Error("the page did not start");
      return state && state.version > 0 && state.settled === state.version && !state.planning;
    };
    await this.until(settled);
  }

  /** Waits until a function of the page is true; on failure reports the function and the page's text. */
  async until(wanted, argument, ms = WAIT_MS) {
    try {
      await this.page.waitForFunction(wanted, { timeout: ms }, argument);
    } catch (error) {
      const shown = await this.page.evaluate(() => {
        const { version, settled, planning, problem, faults } = globalThis.studio?.state ?? {};
        const robot = globalThis.studio?.link?.view?.state;
        return JSON.stringify({ version, settled, planning, problem, faults, robot, says: document.body.innerText.slice(0, 300) });
      });
      const what = argument === undefined ? `${wanted}` : `${wanted} of ${JSON.stringify(argument)}`;
      throw new Error(`${error.message}\nwaited for ${what}\n${shown}\n${this.errors.join("\n")}`);
    }
  }

  /** Runs an action that changes the documents, and waits for the plan. */
  async edit(act) {
    const before = await this.state("state.version");
    await act();
    await this.until((version) => globalThis.studio.state.version > version, before);
    await this.settled();
  }

  state(path) {
    return this.page.evaluate((path) => path.split(".").reduce((value, key) => value?.[key], globalThis.studio), path);
  }

  text(kind = "motionPath") {
    return this.page.evaluate((kind) => {
      const { documents } = globalThis.studio.state;
      return documents.text(documents[kind]);
    }, kind);
  }

  converged() {
    return this.state("state.shown.planned.converged");
  }

  words() {
    return this.page.$eval(".status", (status) => status.innerText);
  }

  async click(selector) {
    const element = await this.page.waitForSelector(selector);
    // Sticky headings of a scrolling panel would cover the clicked element; scroll-padding prevents that.
    await element.evaluate((one) => one.scrollIntoView({ block: "nearest" }));
    await this.page.locator(selector).click();
  }

  button(text) {
    return this.click(`::-p-xpath(//button[normalize-space(.)="${text}"])`);
  }

  async example(path) {
    await this.button("Examples");
    await this.edit(() => this.click(`.example[data-path="${path}"]`));
  }

  async field(label) {
    return this.page.waitForSelector(`.panels input[aria-label^="${label}"]`);
  }

  async type(label, value) {
    const field = await this.field(label);
    await field.evaluate((input) => (input.focus(), input.select()));
    await this.page.keyboard.type(value);
    await this.page.keyboard.press("Enter");
  }

  async press(...keys) {
    for (const key of keys.slice(0, -1)) await this.page.keyboard.down(key);
    await this.page.keyboard.press(keys.at(-1));
    for (const key of keys.slice(0, -1).reverse()) await this.page.keyboard.up(key);
  }

  /** Drags from one point to another in steps, like a hand. */
  async drag(from, to, steps = 8) {
    const { mouse } = this.page;
    await mouse.move(from.x, from.y);
    await mouse.down();
    for (let k = 1; k <= steps; k++) await mouse.move(from.x + ((to.x - from.x) * k) / steps, from.y + ((to.y - from.y) * k) / steps);
    await mouse.up();
  }

  box(selector) {
    return this.page.$eval(selector, (element) => {
      const { x, y, width, height } = element.getBoundingClientRect();
      return { x, y, width, height };
    });
  }
}
