"use strict";
// Values under the pointer and by keyboard, figures as PNG, and tables as CSV. Without this script the page shows everything but these.
(() => {
  // A value with the unit that ends the label of its axis, such as "23.14 µg"; a prefix stands for an exponent.
  const prefixes = [[1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];
  const scale = (values, unit) => {
    const size = Math.max(...values.map((value) => Math.abs(value ?? 0)));
    const takes = !["", "σ", "1", "min", "h", "d"].includes(unit) && size < 0.1 && size > 0;
    return takes ? prefixes.find(([factor]) => size >= factor) ?? prefixes.at(-1) : prefixes[0];
  };
  const number = (value, factor, digits) => value === null ? "–"
    : (value / factor).toLocaleString("en-US", { maximumSignificantDigits: digits }).replace("-", "−");
  // As many digits as the bounds support, and one more; three without bounds.
  const digitsOf = (value, bounds) => {
    const half = bounds && (bounds[1] - bounds[0]) / 2;
    return half > 0 && value ? Math.min(4, Math.max(2, 2 + Math.floor(Math.log10(Math.abs(value) / half)))) : 3;
  };
  const nameOf = (axis) => axis.label.slice(0, axis.label.lastIndexOf(", "));
  const unitOf = (axis) => axis.label.slice(axis.label.lastIndexOf(", ") + 2);
  const format = (axis, value, bounds) => {
    const [factor, prefix] = scale([value], unitOf(axis));
    const digits = digitsOf(value, bounds);
    const between = bounds ? ` (${bounds.map((bound) => number(bound, factor, digits)).join(" … ")})` : "";
    return `${number(value, factor, digits)}${between} ${prefix}${unitOf(axis)}`.trimEnd();
  };
  const at = (axis, value) => {
    const part = axis.log ? Math.log(value / axis.from) / Math.log(axis.to / axis.from)
      : (value - axis.from) / (axis.to - axis.from);
    return axis.start + part * (axis.end - axis.start);
  };
  for (const figure of document.querySelectorAll("figure")) {
    const panels = JSON.parse(figure.querySelector(".values").textContent);
    const svg = figure.querySelector(".drawing svg");
    const cursor = svg.querySelector(".cursor");
    const output = figure.querySelector("output");
    const described = output.textContent;
    if (panels.length === 0) continue;
    // A line without places has those of the line before.
    for (const { lines } of panels) lines.forEach((line, position) => { line.x ??= lines[position - 1].x; });
    let panel = 0;
    let index = -1;
    // The places of a panel are those that were measured, which have bounds; else those of its line with the most of them.
    const places = (of) => of.lines.find((line) => line.low)?.x
      ?? of.lines.reduce((most, line) => line.x.length > most.length ? line.x : most, []);
    const show = () => {
      const of = panels[panel];
      const xs = places(of);
      if (xs.length === 0) return;
      index = Math.max(0, Math.min(xs.length - 1, index));
      const x = at(of.x, xs[index]);
      cursor.setAttribute("x1", x);
      cursor.setAttribute("x2", x);
      cursor.setAttribute("visibility", "visible");
      const texts = [];
      for (const line of of.lines) {
        let nearest = -1;
        line.x.forEach((value, position) => {
          if (nearest < 0 || Math.abs(at(of.x, value) - x) < Math.abs(at(of.x, line.x[nearest]) - x)) nearest = position;
        });
        if (nearest < 0 || Math.abs(at(of.x, line.x[nearest]) - x) > 3 || line.y[nearest] === null) continue;
        const bounds = line.low ? [line.low[nearest], line.high[nearest]] : null;
        texts.push(`${line.name} ${format(of.y, line.y[nearest], bounds)}`);
      }
      output.textContent = `${nameOf(of.x)} ${format(of.x, xs[index])}: ${texts.join(" · ")}`;
    };
    const hide = () => {
      cursor.setAttribute("visibility", "hidden");
      output.textContent = described;
    };
    svg.addEventListener("pointermove", (event) => {
      const box = svg.getBoundingClientRect();
      const scale = svg.viewBox.baseVal.width / box.width;
      const [px, py] = [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale + svg.viewBox.baseVal.y];
      const hit = panels.findIndex((of) => py <= of.y.start + 10);
      panel = hit < 0 ? panels.length - 1 : hit;
      const xs = places(panels[panel]);
      let best = 0;
      xs.forEach((value, position) => {
        if (Math.abs(at(panels[panel].x, value) - px) < Math.abs(at(panels[panel].x, xs[best]) - px)) best = position;
      });
      index = best;
      show();
    });
    svg.addEventListener("pointerleave", () => { if (document.activeElement !== figure) hide(); });
    figure.addEventListener("blur", hide);
    figure.addEventListener("keydown", (event) => {
      const last = places(panels[panel]).length - 1;
      const moves = { ArrowRight: index + 1, ArrowLeft: index < 0 ? last : index - 1, Home: 0, End: last };
      if (event.key in moves) index = moves[event.key];
      else if (event.key === "PageDown") panel = Math.min(panels.length - 1, panel + 1);
      else if (event.key === "PageUp") panel = Math.max(0, panel - 1);
      else if (event.key === "Escape") { hide(); return; }
      else return;
      event.preventDefault();
      show();
    });
  }
  // What is folded away is printed too.
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    for (const folded of opened) folded.open = true;
  });
  addEventListener("afterprint", () => { for (const folded of opened) folded.open = false; });
  // On light ground, with twice the pixels of the figure: sharp on paper at 15 cm.
  const png = async (svg) => {
    // With the legend, which the page has beside the drawing.
    const { width, y, height: below } = svg.viewBox.baseVal;
    const height = y + below;
    const alone = svg.cloneNode(true);
    alone.setAttribute("width", 2 * width);
    alone.setAttribute("height", 2 * height);
    alone.setAttribute("viewBox", `0 0 ${width} ${height}`);
    alone.querySelector(".cursor").remove();
    const style = document.createElementNS("http://www.w3.org/2000/svg", "style");
    style.textContent = document.getElementById("figures").textContent;
    alone.prepend(style);
    const image = new Image();
    image.src = `data:image/svg+xml,${encodeURIComponent(new XMLSerializer().serializeToString(alone))}`;
    await image.decode();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [2 * width, 2 * height];
    const drawn = canvas.getContext("2d");
    drawn.fillStyle = "#fff";
    drawn.fillRect(0, 0, canvas.width, canvas.height);
    drawn.drawImage(image, 0, 0);
    return canvas.toDataURL("image/png");
  };
  const cell = (text) => /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  const csv = (table) => {
    const rows = [...table.rows].map((row) => [...row.cells].map((of) => cell(of.textContent.trim().replace(/\s+/g, " "))).join(","));
    return `data:text/csv;charset=utf-8,${encodeURIComponent(rows.join("\n") + "\n")}`;
  };
  // Everything that can be saved is in one list at the top.
  const save = document.getElementById("save");
  const list = document.createElement("select");
  const sources = new Map();
  const offer = (name, file, make) => {
    sources.set(file, make);
    list.append(new Option(name, file));
  };
  for (const figure of document.querySelectorAll("figure")) {
    const name = figure.querySelector("figcaption").textContent;
    offer(`${name} (PNG)`, `${figure.id}.png`, () => png(figure.querySelector(".drawing svg")));
  }
  document.querySelectorAll("table").forEach((table, position) => {
    const before = table.closest("div.scroll").previousElementSibling;
    const channel = table.closest("details.channel")?.querySelector("strong").textContent ?? "All channels";
    const name = before?.tagName === "H3" ? before.textContent : table.closest(".verdict") ? "N, B and K" : "numbers";
    offer(`${channel}: ${name} (CSV)`, `table-${position + 1}.csv`, () => csv(table));
  });
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = "Save";
  button.addEventListener("click", async () => {
    const link = document.createElement("a");
    link.download = list.value;
    link.href = button.dataset.saved = await sources.get(list.value)();
    link.click();
  });
  const label = document.createElement("label");
  label.append("Figures and tables: ", list);
  save.append(label, button);
  // A link into a channel unfolds it; the contents mark the section that is read.
  const unfold = () => {
    const target = document.getElementById(location.hash.slice(1));
    const folded = target?.closest("details");
    if (folded && !folded.open) { folded.open = true; target.scrollIntoView(); }
  };
  addEventListener("hashchange", unfold);
  unfold();
  const links = new Map([...document.querySelectorAll("nav a")].map((link) => [link.hash.slice(1), link]));
  const seen = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      for (const link of links.values()) link.removeAttribute("aria-current");
      links.get(target.id).setAttribute("aria-current", "true");
    }
  }, { rootMargin: "-10% 0px -80% 0px" });
  for (const id of links.keys()) seen.observe(document.getElementById(id));
})();
