
// The live view of a device on a serial port.
(() => {
  const { element, show, Thread, save, saveFrom, open, bytesOf } = observatory;
  const SHOWN_LINES = 300;
  const LOOK_MS = 250, ASK_AGAIN_MS = 2_000;
  show("no-serial", !navigator.serial);
  show("connect", Boolean(navigator.serial));

  // The image of the Pico is in this page, or in a file beside it.
  const IMAGE = "observatory-pico.uf2";
  const image = element("image").textContent;
  show("flash", Boolean(image));
  element("image-save").addEventListener("click", async () => {
    if (image === IMAGE) return saveFrom(IMAGE, IMAGE);
    const stream = new Blob([bytesOf(image)]).stream().pipeThrough(new DecompressionStream("gzip"));
    save(IMAGE, await new Response(stream).arrayBuffer(), "application/octet-stream");
  });

  const pause = (ms) => new Promise((resolve) => { setTimeout(resolve, ms); });
  const say = (text) => { element("device-status").textContent = text; };
  const log = (lines) => {
    if (lines.length === 0) return;
    const shown = element("log");
    shown.textContent = [...shown.textContent.split("\n"), ...lines].slice(-SHOWN_LINES).join("\n").trimStart();
    shown.scrollTop = shown.scrollHeight;
  };
  // The live view has its own thread, so an analysis does not stop it.
  const thread = new Thread();
  // The state of the connection: the port, and the received bytes that are not decoded yet.
  let device = null;
  const send = async (command) => {
    if (!device.port.writable) throw new Error("the device is disconnected");
    const writer = device.port.writable.getWriter();
    try {
      await writer.write(new TextEncoder().encode(`${command}\r`));
    } finally {
      writer.releaseLock();
    }
  };
  const receive = async (connected) => {
    // After an error of the line, such as an overrun, the port has a new stream; after it was unplugged, it has none.
    while (connected.isOpen && connected.port.readable) {
      const reader = connected.reader = connected.port.readable.getReader();
      try {
        for (;;) {
          const { value, done } = await reader.read();
          if (done) break;
          connected.waiting.push(value);
          connected.recorded?.push(value);
          connected.received = performance.now();
        }
      } catch (error) {
        if (error.name === "NetworkError") break;
      } finally {
        reader.releaseLock();
      }
    }
    connected.isOpen = false;
  };
  // Decodes and shows the bytes received since the last call. Resolves to true if there were any.
  const look = async () => {
    const waiting = device.waiting.splice(0);
    const request = { silence_s: (performance.now() - device.received) / 1000 };
    const { html, lines, bursts, is_answered } = JSON.parse((await thread.run("receive_bytes", request, new Blob(waiting))).answer);
    if (html !== device.html) element("live").innerHTML = device.html = html;
    log(lines);
    device.isAnswered ||= is_answered;
    if (device.recorded) {
      device.bursts += bursts;
      say(`Recording: ${device.bursts} bursts.`);
      const now = performance.now();
      if (bursts > 0) device.asked = now;
      // A device that has restarted has forgotten the command.
      if (now - device.asked >= ASK_AGAIN_MS) {
        device.asked = now;
        await send("w 1");
      }
    }
    return waiting.length > 0;
  };
  const connect = async () => {
    const port = await navigator.serial.requestPort();
    try {
      await port.open({ baudRate: Number(element("connect").dataset.baud), bufferSize: 1 << 16 });
    } catch (error) {
      throw new Error(`The port does not open; another program may have it. (${error.message})`);
    }
    device = { port, waiting: [], received: performance.now(), isOpen: true, html: "", recorded: null, bursts: 0, bench: null };
    const isConnected = (is) => { for (const id of ["connected", "connect"]) show(id, (id === "connected") === is); };
    let receiving;
    try {
      await thread.run("connect_device", "device");
      element("log").textContent = "";
      say("Connected.");
      isConnected(true);
      receiving = receive(device);
      await send("r");
      while (device.isOpen || device.waiting.length > 0) {
        await look();
        await (device.bench ?? pause(LOOK_MS));
      }
    } finally {
      device.isOpen = false;
      await device.reader?.cancel().catch(() => {});
      await receiving;
      await port.close().catch(() => {});
      isConnected(false);
      say("Disconnected. What was received stays here.");
      if (device.recorded) endRecording();
    }
  };
  const endRecording = () => {
    const file = new File(device.recorded, "device.bin");
    device.recorded = null;
    element("record").textContent = "Record";
    element("bench").disabled = false;
    say(`${element("device-status").textContent} Recorded: ${device.bursts} bursts.`);
    element("recorded-save").onclick = () => save(file.name, file, "application/octet-stream");
    element("recorded-open").onclick = () => open([file]);
    show("recorded", true);
  };
  const record = async () => {
    if (device.recorded) {
      await send("w 0");
      say("");
      endRecording();
      return;
    }
    Object.assign(device, { recorded: [], bursts: 0, asked: performance.now() });
    element("record").textContent = "End the recording";
    element("bench").disabled = true;
    await send("w 1");
  };
  const bench = async () => {
    const next = async (isFirst) => JSON.parse((await thread.run("bench_step", isFirst)).answer);
    let step = await next(true);
    while (step.command !== undefined && device.isOpen) {
      say(`Check, step ${step.position + 1} of ${step.steps}: ${step.command}`);
      device.isAnswered = false;
      await send(step.command);
      const end = performance.now() + 1000 * step.seconds;
      while (!device.isAnswered && performance.now() < end && device.isOpen) if (!(await look())) await pause(LOOK_MS / 10);
      step = await next(false);
    }
    if (step.table === undefined) return;
    for (const command of step.restore) await send(command).then(() => pause(1000 * step.pause_s));
    element("bench-table").textContent = step.table;
    show("bench-result", true);
    say("Checked.");
  };
  const guarded = (act) => async (event) => {
    event.preventDefault();
    show("device-error", false);
    try {
      await act(event);
    } catch (error) {
      element("device-error").textContent = error.name === "NotFoundError" ? "No port was chosen." : error.message;
      show("device-error", true);
    }
  };
  element("connect").addEventListener("click", guarded(connect));
  element("record").addEventListener("click", guarded(record));
  element("disconnect").addEventListener("click", guarded(async () => {
    device.isOpen = false;
    await device.reader.cancel();
  }));
  element("command").addEventListener("submit", guarded(async ({ target }) => {
    const { value } = target.elements.command;
    target.reset();
    log([`> ${value}`]);
    await send(value);
  }));
  element("bench").addEventListener("click", guarded(async () => {
    const checked = bench();
    element("controls").disabled = true;
    device.bench = checked.catch(() => {});
    try {
      await checked;
    } finally {
      device.bench = null;
      element("controls").disabled = false;
    }
  }));
})();
