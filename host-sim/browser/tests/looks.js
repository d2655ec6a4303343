// Checks the appearance of a page: no element is wider than the window, and text has sufficient contrast.
"use strict";
const assert = require("node:assert");
const path = require("node:path");

// Texts with a contrast below 4.5, or below 3 if they are large (WCAG 2.2, criterion 1.4.3), as [contrast, text].
const FAINT = `(() => {
  const parse = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const light = (colour) => {
    const [r, g, b] = parse(colour).map((of) => { const c = of / 255; return c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4; });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ground = (of) => {
    for (let at = of; at; at = at.parentElement) {
      const colour = getComputedStyle(at).backgroundColor;
      if ((parse(colour)[3] ?? 1) > 0) return colour;
    }
    return "rgb(255, 255, 255)";
  };
  const faint = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const of = walker.currentNode.parentElement;
    if (!walker.currentNode.textContent.trim() || !of.checkVisibility() || of.closest("script, option")) continue;
    const style = getComputedStyle(of);
    const [a, b] = [light(style.color), light(ground(of))];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < (parseFloat(style.fontSize) >= 24 ? 3 : 4.5)) faint.push([contrast, of.textContent.slice(0, 40)]);
  }
  return faint;
})()`;

/** Checks the page at three widths with light and dark colours. The folder PICTURES, if set, gets screenshots. */
exports.looks = async (page, what) => {
  for (const width of [400, 800, 1280]) {
    for (const isDark of [false, true]) {
      await page.looks(width, isDark);
      const place = `${what}, ${width} pixels, ${isDark ? "dark" : "light"}`;
      assert.equal(await page.value("document.documentElement.scrollWidth - document.documentElement.clientWidth"), 0, place);
      assert.deepEqual(await page.value(FAINT), [], place);
      if (process.env.PICTURES) await page.screenshot(path.join(process.env.PICTURES, `${what}-${width}-${isDark ? "dark" : "light"}.png`));
    }
  }
  await page.looks(1280, false);
};
