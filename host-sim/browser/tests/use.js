// node use.js CHROMIUM URL FOLDER <FILES: uses the page as a user does, loaded from a disk and from a server. FILES names recordings.
// FOLDER gets the files that the caller compares with those of the program.
"use strict";
const assert = require("node:assert");
const fs = require("node:fs");
const http = require("node:http");
const path = require("node:path");
const { fileURLToPath } = require("node:url");
const { withPage } = require("./chromium.js");
const { looks } = require("./looks.js");

const [program, url, folder] = process.argv.slice(2);
const files = JSON.parse(fs.readFileSync(0));
const text = (id) => `document.getElementById("${id}").innerText`;
const isShown = (id) => `!document.getElementById("${id}").hidden`;
const simulate = (seconds) => `document.querySelector("#simulate [name=seconds]").value = ${seconds};
  document.getElementById("simulate").requestSubmit()`;
// Resolves to the directive of the page's policy that refuses the request of `act`.
const refused = (act) => `new Promise((resolve) => {
  document.addEventListener("securitypolicyviolation", (event) => resolve(event.effectiveDirective), { once: true });
  ${act};
})`;
const quiet = (page) => {
  assert.deepEqual(page.errors, []);
  assert.deepEqual(page.requests, page.allowed);
};

const fromDisk = (page) => (async () => {
  page.allowed = [url];
  await page.until("document.readyState === 'complete'");
  await looks(page, "begin");
  quiet(page);
  assert.equal(await page.value(refused('fetch("https://example.org/").catch(() => {})')), "connect-src");
  assert.equal(await page.value(refused('new Image().src = "https://example.org/a.png"')), "img-src");
  page.errors = [];
  page.requests = page.requests.filter((request) => !request.includes("example.org"));

  // Each format is recognised. A damaged file gives an error of one line, and the other files are shown.
  await page.drop([files.csv, files.npy, files.ulog, files.bag, files.damaged]);
  const cards = await page.value('[...document.querySelectorAll("#inspected > section")].map((card) => card.innerText)');
  const kinds = ["text", "NumPy", "PX4", "ROS 1"];
  assert.equal(cards.length, kinds.length, cards.join("\n"));
  kinds.forEach((kind, at) => assert.ok(cards[at].includes(kind), `${kind}: ${cards[at]}`));
  const error = await page.value(text("error"));
  assert.ok(error.includes(path.basename(files.damaged)) && !error.includes("\n"), error);
  await looks(page, "inspected");

  // The keyboard alone leads from the beginning of the page to the report of the first recording.
  await page.choose([files.csv]);
  await page.value("document.activeElement.blur()");
  const reached = [];
  for (let presses = 0; presses < 40 && reached.at(-1) !== "Analyse"; presses += 1) {
    await page.key("Tab");
    reached.push(await page.value("document.activeElement.innerText?.trim() || document.activeElement.id || document.activeElement.name"));
  }
  assert.equal(reached.at(-1), "Analyse", reached.join(", "));
  assert.ok(reached.includes("files") && reached.includes("Simulate"), reached.join(", "));
  assert.equal(await page.value("getComputedStyle(document.activeElement).outlineStyle"), "solid");
  await page.key("Enter", "\r");
  await page.until(isShown("report"));
  await page.idle();
  assert.ok((await page.value(text("report-title"))).includes(path.basename(files.csv)));
  assert.equal(await page.value("document.activeElement.id"), "result");
  const inFrame = 'document.getElementById("frame").contentDocument';
  await page.until(`${inFrame}.querySelectorAll("figure svg").length > 3`);
  // The script of the report has run if there is the button that saves figures and tables.
  await page.until(`[...${inFrame}.querySelectorAll("button")].some((button) => button.textContent === "Save")`);
  await page.until(`document.getElementById("frame").clientHeight >= ${inFrame}.body.scrollHeight`);
  await looks(page, "report");

  const saved = await page.download(() => page.click("#save-page"));
  assert.ok(fs.readFileSync(path.join(folder, saved), "utf8").startsWith("<!DOCTYPE html>"));
  const formats = await page.value('[...document.querySelectorAll("#export [name=format] option")].map((option) => option.value)');
  assert.ok(formats.length >= 10);
  // A browser accepts ten downloads from a page before it asks the user.
  for (const format of [formats[0], ...formats.slice(-3)]) {
    await page.value(`document.querySelector("#export [name=format]").value = "${format}"`);
    const exported = await page.download(() => page.value('document.getElementById("export").requestSubmit()'));
    fs.renameSync(path.join(folder, exported), path.join(folder, `export-${format}`));
    await page.idle();
  }

  // Several recordings are compared.
  await page.choose(files.compared);
  await page.click("#compare");
  await page.until(isShown("comparison"));
  await page.idle();
  fs.writeFileSync(path.join(folder, "agreement.txt"), await page.value('document.getElementById("agreement").textContent'));
  await looks(page, "comparison");

  // The simulation of a day is cancelled after its begin. The next simulation succeeds.
  await page.value(simulate(86_400));
  await page.until(`${text("status")}.includes("simulating") && document.getElementById("progress").value > 0`);
  await looks(page, "progress");
  await page.click("#cancel");
  await page.idle();
  assert.equal(await page.value(text("error")), "Cancelled.");
  await page.value(simulate(60));
  await page.until(isShown("report"));
  await page.idle();
  assert.ok(!(await page.value(isShown("error"))));
  quiet(page);
})();

const fromServer = async (page, address) => {
  page.allowed = [`${address}/index.html`, `${address}/observatory.wasm.gz`];
  await page.value(simulate(60));
  await page.until(isShown("report"));
  await page.idle();
  quiet(page);
  assert.equal(await page.value(refused('fetch("index.html").catch(() => {})')), "connect-src");
  const image = await page.download(() => page.click("#image-save"));
  assert.equal(fs.readFileSync(path.join(folder, image), "utf8"), "the bytes of an image");
};

(async () => {
  await withPage(program, url, folder, fromDisk);
  const server = http.createServer((request, response) => {
    const type = request.url.endsWith(".html") ? "text/html" : "application/octet-stream";
    response.writeHead(200, { "Content-Type": type });
    fs.createReadStream(path.join(path.dirname(fileURLToPath(url)), path.basename(request.url))).pipe(response);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  const address = `http://127.0.0.1:${server.address().port}`;
  await withPage(program, `${address}/index.html`, folder, (page) => fromServer(page, address));
  server.close();
})().catch((error) => { console.error(error); process.exitCode = 1; });
