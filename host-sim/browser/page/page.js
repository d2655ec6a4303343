"use strict";
const observatory = (() => {
  const element = (id) => document.getElementById(id);
  const show = (id, isShown) => { element(id).hidden = !isShown; };
  const STAGES = ["samples", "models of the whole record and of the first half", "effects", "assessment"];
  const ENDINGS = { "matlab": "m", "gtsam": "py", "basalt": "json", "gazebo": "sdf", "csv": "csv" };
  const CANCELLED = "Cancelled.";
  const SIMULATED_HZ = 204.8;

  // The program is in this file, or in a file beside it.
  const bytesOf = (base64) => Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const compressed = async () => {
    const inside = element("program").textContent;
    if (inside) return new Blob([bytesOf(inside)]).stream();
    const response = await fetch("observatory.wasm.gz");
    if (!response.ok) throw new Error(`${response.url}: ${response.status}`);
    return response.body;
  };
  const compiled = (async () => {
    const stream = (await compressed()).pipeThrough(new DecompressionStream("gzip"));
    const bytes = await new Response(stream).arrayBuffer();
    // From here on nothing may be requested.
    const policy = document.createElement("meta");
    policy.httpEquiv = "Content-Security-Policy";
    policy.content = "connect-src 'none'";
    document.head.append(policy);
    return WebAssembly.compile(bytes);
  })();

  // Runs the program in a worker, which answers calls in order.
  const workerUrl = URL.createObjectURL(new Blob([element("worker").textContent], { type: "text/javascript" }));
  class Thread {
    #worker = null;
    #calls = [];
    async run(name, request, file, progress = () => {}) {
      const started = await this.#started();
      if (started !== this.#worker) throw new Error(CANCELLED);
      return new Promise((resolve, reject) => {
        this.#calls.push({ resolve, reject, progress });
        started.postMessage({ name, request, file });
      });
    }
    async #started() {
      if (this.#worker) return this.#worker;
      const begun = this.#worker = new Worker(workerUrl);
      begun.onmessage = ({ data }) => {
        // A worker that was ended may have sent this message before.
        if (begun !== this.#worker) return;
        if ("task" in data) return this.#calls[0].progress(data);
        if (data.isBroken) return this.end(data.error);
        const { resolve, reject } = this.#calls.shift();
        if ("error" in data) reject(new Error(data.error)); else resolve(data);
      };
      begun.onerror = ({ message }) => this.end(message ?? "the browser starts no worker");
      begun.postMessage(await compiled);
      return begun;
    }
    end(why) {
      this.#worker?.terminate();
      this.#worker = null;
      for (const { reject } of this.#calls.splice(0)) reject(new Error(why));
    }
  }

  // Runs one task at a time, and shows its progress and its error.
  const thread = new Thread();
  let job = null;
  const call = (name, request, file, total) => thread.run(name, request, file, ({ task, done }) => {
    const [what, most] = [["reading", file?.size], ["analysing", STAGES.length], ["simulating", total]][task];
    element("progress").max = most || 1;
    // The progress starts again, since a file is read more than once.
    element("progress").value = task === 0 ? done % (most || 1) : done;
    job.what = task === 1 ? `${what}: ${STAGES[done]}, ${done + 1} of ${STAGES.length}` : what;
    tell();
  });
  const tell = () => {
    const seconds = Math.round((performance.now() - job.began) / 1000);
    element("status").textContent = `${job.name}: ${job.what}${seconds > 1 ? `, ${seconds} s` : ""}`;
  };
  const work = async (name, act) => {
    if (job) return;
    job = { name, what: "loading", began: performance.now() };
    const clock = setInterval(() => tell(), 1000);
    element("progress").removeAttribute("value");
    show("error", false);
    show("work", true);
    tell();
    document.body.setAttribute("aria-busy", "true");
    try {
      await act();
    } catch (error) {
      element("error").textContent = error.message;
      show("error", true);
    } finally {
      clearInterval(clock);
      job = null;
      show("work", false);
      document.body.removeAttribute("aria-busy");
    }
  };
  element("cancel").addEventListener("click", () => thread.end(CANCELLED));

  // State and functions of the report.
  let report = null;
  const frame = element("frame");
  frame.addEventListener("load", () => {
    const shown = frame.contentDocument?.documentElement;
    if (!shown || !report) return;
    const fit = () => { frame.style.height = `${shown.ownerDocument.body.scrollHeight + 48}px`; };
    new ResizeObserver(fit).observe(shown.ownerDocument.body);
    fit();
  });
  const showReport = ({ answer, memory }, name) => {
    report = { name, ...JSON.parse(answer) };
    element("report-title").textContent = report.title;
    element("report").dataset.memory = memory;
    frame.srcdoc = report.html;
    show("comparison", false);
    show("report", true);
    element("result").focus();
  };
  const saveFrom = (name, address) => {
    const link = document.createElement("a");
    [link.href, link.download] = [address, name];
    link.click();
  };
  const save = (name, content, type) => {
    const address = URL.createObjectURL(new Blob([content], { type }));
    saveFrom(name, address);
    setTimeout(() => URL.revokeObjectURL(address), 60_000);
  };
  element("save-page").addEventListener("click", () => save(`${report.name}.html`, report.html, "text/html"));
  element("save-json").addEventListener("click", () => save(`${report.name}.json`, `${report.json}\n`, "application/json"));
  element("export").addEventListener("submit", (event) => {
    event.preventDefault();
    const { format, axis } = Object.fromEntries(new FormData(event.target));
    work(format, async () => {
      const { answer } = await call("export", { report: report.json, format, axis });
      save(`${report.name}-${format}.${ENDINGS[format] ?? "yaml"}`, answer, "text/plain");
    });
  });

  // Functions of the recordings.
  const list = (text) => text.split(",").map((word) => word.trim()).filter(Boolean);
  const options = (form) => {
    const fields = Object.fromEntries([...new FormData(form)].map(([name, value]) => [name, value.trim()]));
    const number = (name) => {
      if (!fields[name]) return null;
      const value = Number(fields[name]);
      if (!Number.isFinite(value)) throw new Error(`${name}: ${fields[name]} is no number`);
      return value;
    };
    return {
      topic: fields.topic || null, sensor: fields.sensor || null, columns: list(fields.columns), units: list(fields.units),
      rate: number("rate"), range: number("range"), from: number("from"), to: number("to"),
    };
  };
  const analyse = (file, form) => work(file.name, async () => {
    showReport(await call("analyse", { name: file.name, ...options(form) }, file), file.name);
  });
  const card = (file, html) => {
    const section = document.createElement("section");
    const title = document.createElement("h2");
    title.textContent = file.name;
    section.innerHTML = html;
    section.prepend(title);
    for (const form of section.querySelectorAll("form")) {
      form.addEventListener("submit", (event) => {
        event.preventDefault();
        analyse(file, form);
      });
    }
    return section;
  };
  const compare = (files, cards) => work("comparison", async () => {
    for (const [index, file] of files.entries()) {
      job.name = file.name;
      await call("keep", { name: file.name, isFirst: index === 0, ...options(cards[index].querySelector("form")) }, file);
    }
    element("agreement").textContent = (await call("compare", null)).answer;
    show("report", false);
    show("comparison", true);
    element("result").focus();
  });
  const open = (files) => work("recordings", async () => {
    const inspected = element("inspected");
    const cards = [], opened = [], errors = [];
    inspected.replaceChildren();
    for (const file of files) {
      job.name = file.name;
      try {
        const { answer } = await call("inspect", { name: file.name }, file);
        cards.push(card(file, answer));
        opened.push(file);
        inspected.append(cards.at(-1));
      } catch (error) {
        errors.push(error.message);
        if (error.message === CANCELLED) break;
      }
    }
    if (opened.length > 1) {
      const button = document.createElement("button");
      [button.type, button.id, button.className, button.textContent] = ["button", "compare", "main", "Compare their noise"];
      button.addEventListener("click", () => compare(opened, cards));
      inspected.prepend(button);
    }
    inspected.querySelector("button")?.focus();
    if (errors.length > 0) throw new Error(errors.join("\n"));
  });
  const drop = element("drop");
  element("files").addEventListener("change", (event) => {
    open([...event.target.files]);
    event.target.value = "";
  });
  for (const [name, isOver] of [["dragover", true], ["dragleave", false], ["drop", false]]) {
    addEventListener(name, (event) => {
      event.preventDefault();
      drop.classList.toggle("over", isOver);
      if (name === "drop" && event.dataTransfer.files.length > 0) open([...event.dataTransfer.files]);
    });
  }
  element("simulate").addEventListener("submit", (event) => {
    event.preventDefault();
    const { seconds, seed, plain } = Object.fromEntries(new FormData(event.target));
    const request = { seconds: Number(seconds), seed: Number(seed), plain: Boolean(plain) };
    work("simulation", async () => {
      showReport(await call("simulate", request, null, request.seconds * SIMULATED_HZ), "simulation");
    });
  });
  return { element, show, Thread, save, saveFrom, open, bytesOf };
})();
