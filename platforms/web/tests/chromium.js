// Finds a headless Chromium, and opens the page in it.

import { access } from "node:fs/promises";
import { delimiter, join } from "node:path";

const NAMES = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
const ARGUMENTS = [
  "--no-sandbox",
  "--use-gl=angle",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--ignore-gpu-blocklist",
  "--in-process-gpu",
  "--disable-gpu-watchdog",
];
/** Milliseconds for what the software renderer of a busy machine takes. */
const PATIENCE = 120000;

/** Script that lets a page wait for what it fetches, until it calls `letGo()`. */
const HOLD = `{
  const held = new Promise((resolve) => (window.letGo = resolve));
  const { fetch } = window;
  window.fetch = (...parameters) => held.then(() => fetch(...parameters));
}`;

async function executable() {
  if (process.env.CHROMIUM) return process.env.CHROMIUM;
  for (const folder of (process.env.PATH ?? "").split(delimiter)) {
    for (const name of NAMES) {
      const path = join(folder, name);
      if (
        await access(path).then(
          () => true,
          () => false,
        )
      )
        return path;
    }
  }
  // A build for machines without a desktop, from npm.
  const packed = await import("@sparticuz/chromium").catch(() => null);
  return packed ? packed.default.executablePath() : null;
}

/** Starts Chromium; or returns what is missing, or why it does not start, as text. */
export async function launch() {
  const puppeteer = await import("puppeteer-core").catch(() => null);
  if (!puppeteer) return "puppeteer-core is not there";
  try {
    const executablePath = await executable();
    if (!executablePath) return "no Chromium is there";
    const settings = { executablePath, headless: "shell", args: ARGUMENTS, protocolTimeout: PATIENCE };
    return await puppeteer.default.launch(settings);
  } catch (error) {
    return `Chromium does not start: ${error.message}`;
  }
}

/** The page in a tab, with what it complained about. */
export class Tab {
  complaints = [];

  /** Opens the page. `early` is called with the tab before the page has its library. */
  static async open(browser, address, viewport, early = null) {
    const tab = new Tab();
    const page = (tab.page = await browser.newPage());
    await page.setViewport(viewport);
    page.on("console", (message) => {
      if (message.type() === "error" || /error/i.test(message.text())) tab.complaints.push(message.text());
    });
    page.on("pageerror", ({ message }) => tab.complaints.push(message));
    page.on("requestfailed", (request) => tab.complaints.push(`failed: ${request.url()}`));
    page.on("request", (request) => {
      const { protocol, host } = new URL(request.url());
      if (/^http/.test(protocol) && host !== new URL(address).host)
        tab.complaints.push(`another host: ${host}`);
    });
    if (early) await page.evaluateOnNewDocument(HOLD);
    await page.goto(address);
    if (early) {
      await early(tab);
      await page.evaluate("letGo()");
    }
    await tab.until("window.page?.state.errors > 0 || (page.state.frames > 2 && !page.state.loading)");
    return tab;
  }

  until(condition) {
    return this.page.waitForFunction(condition, { timeout: PATIENCE });
  }

  /** Runs a statement in the page, waits until the next frames are drawn, and returns the page's state. */
  async act(statement = "") {
    const frames = await this.page.evaluate(`${statement}; page.state.frames`);
    await this.until(`page.state.frames > ${frames + 1} || page.state.errors > 0`);
    return this.page.evaluate("(({ seen, facts, ...rest }) => rest)(page.state)");
  }

  /** As `act`, and waits for the judge's answer to the picture. */
  async judged(statement) {
    await this.act(`${statement}; page.toggle("measure", false)`);
    await this.act(`page.toggle("measure", true)`);
    await this.until("page.state.check !== null");
    return this.act();
  }

  /** Chooses files in the page's own way, and waits until they are shown or refused. */
  async openFiles(...paths) {
    await this.page.evaluate(`page.state.message = ""; page.state.loadMs = null`);
    const input = await this.page.$("#file");
    await input.uploadFile(...paths);
    await this.until(`page.state.message || (!page.state.loading && page.state.loadMs !== null)`);
    return this.act();
  }

  /**
   * Drags files over the page from its left to its right by the browser's own events, as a person does, and drops them.
   * `over` is called at each place on the way. Waits until they are shown or refused.
   */
  async dropFiles(paths, over = async () => {}) {
    await this.page.evaluate(`page.state.message = ""; page.state.loadMs = null`);
    const { width, height } = this.page.viewport();
    const session = await this.page.createCDPSession();
    const data = { items: [], files: paths, dragOperationsMask: 1 };
    const send = (type, x) =>
      session.send("Input.dispatchDragEvent", { type, x: x * width, y: height / 2, data });
    await send("dragEnter", 0.2);
    for (const x of [0.2, 0.5, 0.9, 0.5]) {
      await send("dragOver", x);
      await over();
    }
    await send("drop", 0.5);
    await session.detach();
    if (paths.length > 0)
      await this.until(`page.state.message || (!page.state.loading && page.state.loadMs !== null)`);
    return this.act();
  }

  picture(path) {
    return this.page.screenshot({ path });
  }
}
