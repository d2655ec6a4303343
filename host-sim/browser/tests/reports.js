// node reports.js CHROMIUM URL FOLDER <JOBS: lets the page analyse each file, with the proposed or with stated options, and saves the JSON
// of the report in FOLDER. A job is {file, fields, name}, or {simulate: {seconds, seed}, name} without a file.
"use strict";
const assert = require("node:assert");
const fs = require("node:fs");
const path = require("node:path");
const { withPage } = require("./chromium.js");

const [program, url, folder] = process.argv.slice(2);
const fill = (form, fields) => `(() => {
  const form = document.querySelector(${JSON.stringify(form)});
  for (const [name, value] of Object.entries(${JSON.stringify(fields)})) form.elements[name].value = value;
  form.requestSubmit();
})()`;
withPage(program, url, folder, async (page) => {
  for (const { file, fields, simulate, name } of JSON.parse(fs.readFileSync(0))) {
    if (file) await page.choose([file]);
    await page.value(fill(file ? "form.proposal" : "#simulate", fields ?? simulate));
    await page.idle();
    assert.equal(await page.value("document.getElementById('error').innerText"), "", name);
    const saved = await page.download(() => page.click("#save-json"));
    fs.renameSync(path.join(folder, saved), path.join(folder, name));
  }
  assert.deepEqual(page.errors, []);
}).catch((error) => { console.error(error); process.exitCode = 1; });
