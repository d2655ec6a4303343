// Drives headless Chromium over a pipe by the DevTools protocol. A page is as a user sees it; its requests, errors and downloads are kept.
"use strict";
const { spawn } = require("node:child_process");
const fs = require("node:fs");
const path = require("node:path");

/** Longest time for an action of a page, ms. Only a failing test waits for its end. */
const PATIENCE_MS = 300_000;

/**
 * Opens the page at `url`, lets `act` use it, and closes it. Downloads and the profile of the browser are written into `folder`; `script`
 * runs before the scripts of the page.
 */
exports.withPage = async (program, url, folder, act, script) => {
  const profile = fs.mkdtempSync(path.join(folder, "profile-"));
  const options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe", `--user-data-dir=${profile}`,
    "--no-first-run", "--disable-background-networking", "--disable-component-update", "--window-size=1280,900", "about:blank"];
  const browser = spawn(program, options, { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
  try {
    return await act(await Page.open(browser, url, folder, script));
  } finally {
    browser.kill("SIGKILL");
    await new Promise((resolve) => { browser.on("exit", resolve); if (browser.exitCode !== null || browser.signalCode) resolve(); });
  }
};

class Page {
  /** Addresses of requests for content outside of the page, and errors of its console. */
  requests = [];
  errors = [];
  #browser;
  #calls = new Map();
  #listeners = [];
  #next = 1;
  #session;

  static async open(browser, url, folder, script) {
    const page = new Page();
    page.#browser = browser;
    let rest = "";
    browser.stdio[4].setEncoding("utf8").on("data", (text) => {
      const messages = (rest + text).split("\0");
      rest = messages.pop();
      messages.map(JSON.parse).forEach((message) => page.#receive(message));
    });
    const { targetId } = await page.send("Target.createTarget", { url: "about:blank" });
    page.#session = (await page.send("Target.attachToTarget", { targetId, flatten: true })).sessionId;
    await page.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: folder, eventsEnabled: true });
    for (const domain of ["Page", "Runtime", "Network", "Log", "DOM"]) await page.send(`${domain}.enable`);
    if (script) await page.send("Page.addScriptToEvaluateOnNewDocument", { source: script });
    const loaded = page.event("Page.loadEventFired");
    await page.send("Page.navigate", { url });
    await loaded;
    return page;
  }

  send(method, params = {}) {
    const id = this.#next++;
    const message = { id, method, params };
    // These methods are addressed to the browser; all others are addressed to the page by its session.
    if (this.#session && !/^(Target|Browser|SystemInfo)\./.test(method)) message.sessionId = this.#session;
    this.#browser.stdio[3].write(`${JSON.stringify(message)}\0`);
    return new Promise((resolve, reject) => this.#calls.set(id, { resolve, reject, method }));
  }

  #receive({ id, result, error, method, params }) {
    if (id) {
      const call = this.#calls.get(id);
      this.#calls.delete(id);
      return error ? call.reject(new Error(`${call.method}: ${error.message}`)) : call.resolve(result);
    }
    if (method === "Network.requestWillBeSent" && !/^(data|blob):/.test(params.request.url)) this.requests.push(params.request.url);
    if (method === "Runtime.exceptionThrown") this.errors.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
    if (method === "Log.entryAdded" && params.entry.level === "error") this.errors.push(params.entry.text);
    if (method === "Runtime.consoleAPICalled" && params.type === "error") this.errors.push(params.args.map((arg) => arg.value).join(" "));
    this.#listeners = this.#listeners.filter((listener) => !listener(method, params));
  }

  /** Resolves to the parameters of the next event `name` that `is` accepts. */
  event(name, is = () => true) {
    return new Promise((resolve, reject) => {
      const late = setTimeout(() => reject(new Error(`never: ${name}`)), PATIENCE_MS);
      this.#listeners.push((method, params) => method === name && is(params) && (clearTimeout(late), resolve(params), true));
    });
  }

  /** Resolves to the value of an expression in the page. */
  async value(expression) {
    const { result, exceptionDetails } = await this.send("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true, userGesture: true });
    if (exceptionDetails) throw new Error(`${expression}: ${exceptionDetails.exception?.description ?? exceptionDetails.text}`);
    return result.value;
  }

  /** Waits until an expression is true. */
  async until(expression) {
    const end = Date.now() + PATIENCE_MS;
    while (!(await this.value(expression))) {
      if (Date.now() > end) throw new Error(`never: ${expression}; the page says ${await this.value("document.body.innerText")}`);
      await new Promise((resolve) => setTimeout(resolve, 20));
    }
  }

  /** Waits until the page is not busy. */
  idle() { return this.until("!document.body.hasAttribute('aria-busy')"); }

  click(selector) { return this.value(`document.querySelector(${JSON.stringify(selector)}).click()`); }

  /** Chooses files, as the dialog of the browser does, and waits until they were inspected. */
  async choose(files) {
    const { root } = await this.send("DOM.getDocument");
    const { nodeId } = await this.send("DOM.querySelector", { nodeId: root.nodeId, selector: "#files" });
    await this.send("DOM.setFileInputFiles", { nodeId, files });
    await this.idle();
  }

  /** Drops files on the page. */
  async drop(files) {
    const data = { items: [], files, dragOperationsMask: 1 };
    for (const type of ["dragEnter", "dragOver", "drop"]) await this.send("Input.dispatchDragEvent", { type, x: 300, y: 300, data });
    await this.idle();
  }

  /** Presses a key, such as Tab. */
  async key(key, text) {
    const windowsVirtualKeyCode = { Tab: 9, Enter: 13, " ": 32 }[key];
    await this.send("Input.dispatchKeyEvent", { type: "keyDown", key, code: key === " " ? "Space" : key, windowsVirtualKeyCode, text });
    await this.send("Input.dispatchKeyEvent", { type: "keyUp", key, code: key === " " ? "Space" : key, windowsVirtualKeyCode });
  }

  /** Resolves to the name of the file that `act` downloads. */
  async download(act) {
    const begun = this.event("Browser.downloadWillBegin");
    const completed = this.event("Browser.downloadProgress", ({ state }) => state === "completed");
    await act();
    const { suggestedFilename } = await begun;
    await completed;
    return suggestedFilename;
  }

  async looks(width, isDark) {
    await this.send("Emulation.setDeviceMetricsOverride", { width, height: 900, deviceScaleFactor: 1, mobile: false });
    const features = [{ name: "prefers-color-scheme", value: isDark ? "dark" : "light" }];
    await this.send("Emulation.setEmulatedMedia", { features });
  }

  async screenshot(file) {
    const { data } = await this.send("Page.captureScreenshot", { captureBeyondViewport: true, format: "png" });
    fs.writeFileSync(file, Buffer.from(data, "base64"));
  }
}
