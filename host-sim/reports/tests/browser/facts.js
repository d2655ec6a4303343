"use strict";
// What a browser shows of a page: run in the parent of an iframe that holds it. The facts become the text of an element.
// The places of a path that begins with "m" and goes on in steps.
const vertices = (path) => {
  const steps = (path.match(/-?(\d+\.?\d*|\.\d+)/g) ?? []).map(Number);
  let [x, y] = [0, 0];
  return steps.flatMap((step, at) => at % 2 ? [] : [[x += step, y += steps[at + 1]]]);
};
async function facts(frame) {
  const view = frame.contentWindow;
  const page = frame.contentDocument;
  const channels = (colour) => (colour.match(/[\d.]+/g) || []).map(Number);
  const luminance = ([r, g, b]) => {
    const linear = (of) => { const part = of / 255; return part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4; };
    return 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
  };
  const ground = (element) => {
    for (let of = element; of; of = of.parentElement) {
      const colour = channels(view.getComputedStyle(of).backgroundColor);
      if (colour.length === 3 || colour[3] > 0.99) return colour;
    }
    return [255, 255, 255];
  };
  const contrasts = [];
  for (const element of page.querySelectorAll("body *")) {
    const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
    if (!own || ["SCRIPT", "STYLE", "title"].includes(element.tagName)) continue;
    const style = view.getComputedStyle(element);
    const colour = channels(element instanceof view.SVGElement ? style.fill : style.color);
    const [one, other] = [luminance(colour), luminance(ground(element))];
    contrasts.push([(Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05), element.textContent.trim().slice(0, 40)]);
  }
  contrasts.sort((a, b) => a[0] - b[0]);
  for (const folded of page.querySelectorAll("details")) folded.open = true;
  const figures = [...page.querySelectorAll("figure")].map((figure) => {
    const drawn = [...figure.querySelectorAll("g[data-line]")].map((group) => ({
      name: group.dataset.line,
      points: vertices(group.querySelector("path")?.getAttribute("d") ?? ""),
      dots: [...group.querySelectorAll("circle")].map((dot) => [Number(dot.getAttribute("cx")), Number(dot.getAttribute("cy"))]),
      visible: [...group.children].every((shape) => {
        const style = view.getComputedStyle(shape);
        return shape.tagName === "circle" ? style.fill !== "none" : style.stroke !== "none";
      }),
    }));
    const output = figure.querySelector("output");
    const before = output.textContent;
    figure.focus();
    const focused = page.activeElement === figure;
    const press = (key) => figure.dispatchEvent(new view.KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
    press("ArrowRight");
    const read = output.textContent;
    const svg = figure.querySelector(".drawing svg");
    const box = svg.getBoundingClientRect();
    figure.blur();
    svg.dispatchEvent(new view.PointerEvent("pointermove", { clientX: box.left + box.width / 2, clientY: box.top + box.height / 3 }));
    const pointed = output.textContent;
    svg.dispatchEvent(new view.PointerEvent("pointerleave"));
    return {
      id: figure.id, label: svg.getAttribute("aria-label"), focused, before, read, pointed, after: output.textContent,
      panels: JSON.parse(figure.querySelector(".values").textContent).map((panel) => {
        panel.lines.forEach((line, position) => { line.x ??= panel.lines[position - 1].x; });
        return panel;
      }), drawn,
    };
  });
  // What is chosen in the list is saved: first of its tables, first of its figures.
  const save = async (ending) => {
    const [list, button] = ["select", "button"].map((name) => page.querySelector(`#save ${name}`));
    list.value = [...list.options].find((of) => of.value.endsWith(ending))?.value;
    delete button.dataset.saved;
    button.click();
    // Decoding an image takes no time of the page: the caller gives it as much as it needs.
    while (!button.dataset.saved) await new Promise((done) => setTimeout(done, 20));
    return button.dataset.saved;
  };
  const csv = decodeURIComponent((await save(".csv")).split(",").slice(1).join(","));
  const png = await save(".png");
  return {
    width: page.documentElement.clientWidth,
    overflow: page.documentElement.scrollWidth - page.documentElement.clientWidth,
    // What is wider than its place, and therefore cut off or to be scrolled.
    cut: [...page.querySelectorAll("body *")]
      .filter((element) => element.scrollWidth > element.clientWidth + 1 && view.getComputedStyle(element).overflowX !== "visible")
      .map((element) => `${element.closest("section")?.className ?? ""} ${element.className}`.trim()),
    contrasts: contrasts.slice(0, 3),
    dark: view.matchMedia("(prefers-color-scheme: dark)").matches,
    requests: view.performance.getEntriesByType("resource").map((entry) => entry.name),
    links: [...page.querySelectorAll("a[href^='#']")].filter((link) => !page.getElementById(link.getAttribute("href").slice(1))).map((link) => link.href),
    csv,
    png: await pixels(png),
    figures,
  };
}
// The size of an image, and how many of its pixels have each colour that at least 200 have.
async function pixels(source) {
  const image = new Image();
  image.src = source;
  await image.decode();
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.width, image.height];
  const drawn = canvas.getContext("2d");
  drawn.drawImage(image, 0, 0);
  const counts = {};
  const { data } = drawn.getImageData(0, 0, image.width, image.height);
  for (let at = 0; at < data.length; at += 4) {
    const colour = [...data.slice(at, at + 3)].map((of) => of.toString(16).padStart(2, "0")).join("");
    counts[colour] = (counts[colour] ?? 0) + 1;
  }
  return { width: image.width, height: image.height, colours: Object.fromEntries(Object.entries(counts).filter(([, count]) => count >= 200)) };
}
window.addEventListener("load", async () => {
  const result = document.createElement("pre");
  result.id = "facts";
  try {
    result.textContent = JSON.stringify(await Promise.all([...document.querySelectorAll("iframe")].map(facts)));
  } catch (error) {
    result.textContent = JSON.stringify({ error: String(error), stack: error.stack });
  }
  document.body.append(result);
});
