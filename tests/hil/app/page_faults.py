"""Scripts that a browser runs on a page: they scroll through it and list its faults."""

SCROLL = """async () => {
  document.querySelectorAll("details").forEach(one => { one.open = true; });
  const wait = ms => new Promise(r => setTimeout(r, ms));
  const frame = () => new Promise(requestAnimationFrame);
  for (let y = 0; y < document.body.scrollHeight; y += 600) {
    scrollTo({ top: y, behavior: "instant" });
    for (let k = 0; k < 3; k++) await frame();
  }
  for (let k = 0; k < 50 && document.querySelector(".plot:not(.js-plotly-plot)"); k++)
    await wait(100);
  scrollTo({ top: 0, behavior: "instant" });
}"""
"""Through the whole page, each place shown for some frames, however slow these come."""
FAULTS = """() => {
  const found = [];
  if (document.scripts.length && !document.documentElement.dataset.ready) found.push("figures are not ready");
  if (document.documentElement.scrollWidth > innerWidth) found.push("scrolls sideways");
  document.querySelectorAll(".plot").forEach(plot => {
    const area = plot.getBoundingClientRect();
    if (!plot.querySelector(".main-svg")) found.push(`${plot.id} is not drawn`);
    plot.querySelectorAll("text").forEach(text => {
      const box = text.getBoundingClientRect();
      if (box.width && (box.left < area.left - 2 || box.right > area.right + 2 || box.bottom > area.bottom + 2))
        found.push(`${plot.id}: clipped ${text.textContent}`);
    });
    plot.querySelectorAll(".subplot").forEach(panel => {
      const ticks = [...panel.querySelectorAll(".xtick text")].map(one => one.getBoundingClientRect());
      ticks.forEach((one, k) => ticks.slice(k + 1).forEach(other => {
        if (Math.min(one.right, other.right) - Math.max(one.left, other.left) > 2
            && Math.min(one.bottom, other.bottom) - Math.max(one.top, other.top) > 2)
          found.push(`${plot.id}: labels overlap`);
      }));
    });
  });
  document.querySelectorAll(".plot").forEach(plot => {
    const layout = plot._fullLayout, titles = [...plot.querySelectorAll(".infolayer [class*=title] text")];
    Object.keys(layout).filter(key => /^[xy]axis\\d*$/.test(key)).map(key => layout[key])
      .filter(axis => axis.visible && axis.showticklabels && axis.type !== "category" && !axis.title.text)
      .forEach(axis => found.push(`${plot.id}: ${axis._name} has no title`));
    const boxes = titles.map(one => [one.textContent, one.getBoundingClientRect()]).filter(([, box]) => box.width);
    boxes.forEach(([said, one], k) => boxes.slice(k + 1).forEach(([other, two]) => {
      if (Math.min(one.right, two.right) - Math.max(one.left, two.left) > 2
          && Math.min(one.bottom, two.bottom) - Math.max(one.top, two.top) > 2)
        found.push(`${plot.id}: titles overlap: ${said}, ${other}`);
    }));
  });
  document.querySelectorAll("h1, h2, h3, p, li, summary, table, .card").forEach(part => {
    const box = part.getBoundingClientRect(), home = part.closest("section, header");
    const room = home ? home.getBoundingClientRect() : { right: innerWidth };
    if (box.right > room.right + 1 && !part.closest(".scroll"))
      found.push(`beyond its card: ${part.textContent.slice(0, 40)}`);
  });
  return [...new Set(found)];
}"""
CUT = """() => {
  const found = [], walker = document.createTreeWalker(document.querySelector("main"), NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    if (node.parentElement.closest("code, math, svg, script, a, .save")) continue;
    for (const word of node.textContent.matchAll(/[A-Za-z]{2,24}/g)) {
      const range = document.createRange();
      range.setStart(node, word.index);
      range.setEnd(node, word.index + word[0].length);
      if (new Set([...range.getClientRects()].map(box => Math.round(box.top))).size > 1) found.push(`cut: ${word[0]}`);
    }
  }
  return [...new Set(found)];
}"""
"""Words of letters that stand in two lines."""
CONTRAST = """() => {
  const canvas = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
  const rgba = colour => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = (top, below) => [0, 1, 2].map(k => top[3] * top[k] + (1 - top[3]) * below[k]);
  const behind = part => {
    const layers = [];
    for (let one = part; one; one = one.parentElement) {
      const colour = rgba(getComputedStyle(one).backgroundColor);
      if (colour[3]) layers.push(colour);
      if (colour[3] === 1) break;
    }
    return layers.reverse().reduce((below, top) => over(top, below), [255, 255, 255]);
  };
  const light = colour => colour.slice(0, 3).map(k => k / 255)
    .map(k => k <= 0.04045 ? k / 12.92 : ((k + 0.055) / 1.055) ** 2.4)
    .reduce((sum, k, i) => sum + k * [0.2126, 0.7152, 0.0722][i], 0);
  const ratio = (one, two) => {
    const [low, high] = [light(one), light(two)].sort((a, b) => a - b);
    return (high + 0.05) / (low + 0.05);
  };
  const faded = part => part && (+getComputedStyle(part).opacity < 1 || faded(part.parentElement));
  const found = [], parts = [...document.querySelectorAll("body *")].filter(part =>
    !part.closest("script, style, noscript, title, math") && part.getClientRects().length
    && [...part.childNodes].some(node => node.nodeType === 3 && node.textContent.trim()));
  for (const part of parts.filter(part => !faded(part))) {
    const look = getComputedStyle(part), paper = behind(part);
    const ink = over(rgba(part instanceof SVGElement ? look.fill : look.color), paper);
    const size = parseFloat(look.fontSize);
    const least = size >= 24 || (size >= 18.66 && +look.fontWeight >= 700) ? 3 : 4.5;
    if (ratio(ink, paper) < least)
      found.push(`${part.textContent.trim().slice(0, 30)}: ${ratio(ink, paper).toFixed(2)}, ${ink} on ${paper}`);
  }
  const drawn = [...document.querySelectorAll(
    ".plot path.js-line, .plot .bars path, .plot .legendlines path, :is(td, .legend) svg :not(.rule, .well, title)")];
  for (const part of drawn.filter(part => !faded(part))) {
    const look = getComputedStyle(part), paper = behind(part);
    const inks = [parseFloat(look.strokeWidth) ? look.stroke : "none", look.fill]
      .filter(colour => colour !== "none").map(rgba).filter(colour => colour[3]);
    if (inks.length && Math.max(...inks.map(ink => ratio(over(ink, paper), paper))) < 3)
      found.push(`${part.getAttribute("class")} in ${part.closest(".plot")?.id}: ${look.stroke} ${look.fill}`);
  }
  return [...new Set(found)];
}"""
"""Texts below 4.5 (large ones: 3) and lines, bars and marks below 3 of their background's contrast; what is faded on
purpose, as an entry of a legend that is switched off, is left out.
"""
