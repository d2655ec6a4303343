// node live.js CHROMIUM URL FOLDER <INPUT: tests the page with a port that replays the answers of a device, and in a browser without Web
// Serial, where the image of the Pico can be saved. FOLDER gets the files that the caller compares with those of the program.
"use strict";
const assert = require("node:assert");
const fs = require("node:fs");
const path = require("node:path");
const { withPage } = require("./chromium.js");
const { looks } = require("./looks.js");

const [program, url, folder] = process.argv.slice(2);
const { answers, points: expected, table, finding, image } = JSON.parse(fs.readFileSync(0));
// A port that answers each command at once with its recorded answer. The page's pauses end one after the other when the test requests it,
// and its clock shows the end of the last pause, so the result does not depend on the speed of the machine.
const PORT = `(() => {
  const PATIENCE_MS = 100_000, LONGEST_PAUSE_MS = 1_000;
  const wait = window.setTimeout.bind(window);
  const pauses = [], answers = ${JSON.stringify(answers)};
  let now = 0, controller;
  performance.now = () => now;
  window.setTimeout = (act, ms) => { if (ms > LONGEST_PAUSE_MS) wait(act, ms); else pauses.push({ act, due: now + ms }); };
  const stream = () => new ReadableStream({ start: (of) => { controller = of; } });
  const fake = window.fake = {
    commands: [], readable: null, writable: null,
    open: async () => {
      fake.readable = stream();
      fake.writable = new WritableStream({ write: (bytes) => {
        const command = new TextDecoder().decode(bytes).trim();
        fake.commands.push(command);
        const at = answers.findIndex((answer) => answer.command === command);
        if (at >= 0) fake.receive(answers.splice(at, 1)[0].bytes);
      } });
    },
    close: async () => { fake.readable = fake.writable = null; },
    receive: (bytes) => controller.enqueue(Uint8Array.from(bytes)),
    // After an error of the line the port has a new stream; after it is unplugged it has none.
    fail: (name, isUnplugged) => {
      const failed = controller;
      fake.readable = isUnplugged ? null : stream();
      if (isUnplugged) fake.writable = null;
      failed.error(new DOMException("the device has been lost", name));
    },
    until: async (isSo) => {
      const end = Date.now() + PATIENCE_MS;
      while (!isSo()) {
        if (Date.now() > end) throw new Error("never; the page says " + document.body.innerText);
        pauses.sort((one, other) => one.due - other.due);
        const next = pauses.shift();
        now = Math.max(now, next?.due ?? 0);
        next?.act();
        await new Promise((resolve) => wait(resolve, 0));
      }
    },
  };
  Object.defineProperty(navigator, "serial", { value: { requestPort: async () => fake } });
})()`;
const NO_SERIAL = 'Object.defineProperty(navigator, "serial", { value: undefined })';
const text = (id) => `document.getElementById("${id}").innerText`;
const isShown = (id) => `!document.getElementById("${id}").hidden`;
const send = (command) => `document.querySelector("#command input").value = "${command}"; document.getElementById("command").requestSubmit()`;
const POINTS = 'document.querySelectorAll("#live .drawing [data-line] circle").length';

const withDevice = async (page) => {
  const until = (expression) => page.value(`fake.until(() => ${expression})`);
  await page.click("#connect");
  await until(`${text("live")}.includes("ADIS16405")`);
  const live = await page.value(text("live"));
  for (const part of ["gyro x", "accel z", "Health:", "bursts used", "Link:", "angle random walk"]) assert.ok(live.includes(part), `${part}: ${live}`);
  const points = await page.value(POINTS);
  assert.equal(points, expected);
  await looks(page, "live");

  // The next report is received after noise on the line and an overrun, and its curves are longer.
  await page.value("fake.receive(Array.from({ length: 5000 }, (_, at) => (at * 7919) % 251))");
  await until(`!${text("live")}.includes(" 0 bytes of noise")`);
  await page.value('fake.fail("BufferOverrunError", false)');
  await page.value(send("r"));
  await until(`${POINTS} > ${points}`);

  // A recording continues although the device has forgotten the request for it.
  await page.click("#record");
  await until(`/Recording: [1-9]/.test(${text("device-status")})`);
  await until('fake.commands.filter((command) => command === "w 1").length === 2');
  await page.click("#record");
  await until(isShown("recorded"));
  fs.renameSync(path.join(folder, await page.download(() => page.click("#recorded-save"))), path.join(folder, "recorded.bin"));
  await page.click("#recorded-open");
  await page.until('document.querySelectorAll("#inspected form").length === 1');
  await page.idle();
  await page.value('document.querySelector("#inspected form").requestSubmit()');
  await page.until(isShown("report"));
  await page.idle();
  fs.renameSync(path.join(folder, await page.download(() => page.click("#save-json"))), path.join(folder, "recorded.json"));

  await page.click("#bench");
  await until(isShown("bench-result"));
  assert.equal(await page.value('document.getElementById("bench-table").textContent'), table);
  assert.equal(await page.value("fake.commands.at(-1)"), "i 10");
  await looks(page, "bench");

  // The page shows the models of an epoch, and then that the device sends nothing any more.
  await page.value(`fake.receive(${JSON.stringify(finding)})`);
  await until(`${text("live")}.includes("What was found")`);
  await until(`${text("live")}.includes("Nothing received for 15 s")`);
  await looks(page, "findings");

  await page.value(send("help"));
  await until('fake.commands.at(-1) === "help"');
  assert.ok((await page.value('document.getElementById("log").textContent')).endsWith("> help"));
  // The device is unplugged during a recording.
  await page.click("#record");
  await until('fake.commands.at(-1) === "w 1"');
  await page.value('fake.fail("NetworkError", true)');
  await until(`${text("device-status")}.includes("Disconnected") && ${text("device-status")}.includes("Recorded: 0 bursts")`);
  assert.ok(await page.value(isShown("connect")));
  // It is plugged in again, and then disconnected by the user.
  await page.click("#connect");
  await until(`${text("device-status")} === "Connected."`);
  await page.click("#disconnect");
  await until(`${text("device-status")}.includes("Disconnected")`);
  assert.ok(!(await page.value(isShown("device-error"))));
  assert.deepEqual(page.errors, []);
};

const withoutSerial = async (page) => {
  assert.ok(await page.value(`${isShown("no-serial")} && !(${isShown("connect")})`));
  assert.match(await page.value(text("no-serial")), /Chrome.*Edge.*Opera/s);
  const saved = await page.download(() => page.click("#image-save"));
  assert.deepEqual([...fs.readFileSync(path.join(folder, saved))], image);
  assert.deepEqual(page.errors, []);
};

(async () => {
  await withPage(program, url, folder, withDevice, PORT);
  await withPage(program, url, folder, withoutSerial, NO_SERIAL);
})().catch((error) => { console.error(error); process.exitCode = 1; });
