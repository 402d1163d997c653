"use strict";
// The page of `capsule cockpit`: asks the server for what is new, draws it, shows the state, and, with a token, steers.

const $ = id => document.getElementById(id);
const TOKEN = tokenOf();
const LATE_MS = 2000, AGAIN_MS = [300, 1000, 2000], EVENTS = 5000;
const FONT = 'Inter, "Segoe UI", system-ui, -apple-system, "Helvetica Neue", Arial, sans-serif';
const page = { socket: null, hello: null, store: null, plots: [], events: [], cursor: null, paused: null, span: 60, end: 0,
  state: null, heard: 0, tries: 0, waiting: false, again: false, playing: false, due: false };

function make(tag, name, text) {
  const one = document.createElement(tag);
  if (name) one.className = name;
  if (text !== undefined) one.textContent = text;
  return one;
}

// The token goes from the address into the memory of this tab: neither the address bar nor the history keeps it.
function tokenOf() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token") || new URLSearchParams(location.search).get("token");
  if (location.hash || location.search) history.replaceState(null, "", location.pathname);
  try {
    if (given) sessionStorage.setItem("token", given);
    return given || sessionStorage.getItem("token") || "";
  } catch { return given || ""; }
}

// ---- the connection

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = page.socket = new WebSocket(`${scheme}://${location.host}/socket?token=${encodeURIComponent(TOKEN)}`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = message => {
    page.heard = performance.now();
    if (typeof message.data === "string") take(JSON.parse(message.data));
    else takeSpans(message.data);
  };
  socket.onclose = () => {
    if (page.socket !== socket) return;
    document.dispatchEvent(new Event("cockpit-lost"));
    page.waiting = page.playing = false;
    flag();
    setTimeout(connect, AGAIN_MS[Math.min(page.tries++, AGAIN_MS.length - 1)]);
  };
}

function send(document) { if (page.socket && page.socket.readyState === WebSocket.OPEN) page.socket.send(JSON.stringify(document)); }

function connected() {
  const open = page.socket && page.socket.readyState === WebSocket.OPEN && page.hello;
  return Boolean(open) && (!page.hello.live || performance.now() - page.heard < LATE_MS);
}

function flag() {
  const trouble = page.state && page.state.trouble, ok = connected();
  const [words, grade] = !ok ? ["connection lost", "bad"] : page.hello.live ? trouble ? ["no frames", "doubt"] : ["live", "good"] : ["log", ""];
  $("link").textContent = words;
  $("link").className = `flag ${grade}`;
  document.documentElement.dataset.link = words;
  const said = ok ? trouble : page.hello ? "The cockpit does not answer; trying again. What is shown is old." : "";
  $("trouble").textContent = said || "";
  $("trouble").hidden = !said;
}

function take(message) {
  if (message.kind === "hello") greet(message);
  else if (message.kind === "state") {
    page.state = message;
    addEvents(message.events);
    show(message);
    flag();
    soon();
    document.dispatchEvent(new CustomEvent("cockpit-state", { detail: message }));
  } else if (message.kind === "refused") document.dispatchEvent(new CustomEvent("cockpit-refused", { detail: message }));
}

function greet(hello) {
  page.tries = 0;
  page.hello = hello;
  page.events = [];
  page.paused = null;
  $("title").textContent = hello.title;
  $("about").textContent = hello.about;
  document.title = `${hello.title} · capsule cockpit`;
  const lines = hello.panels.reduce((sum, panel) => sum + panel.lines.length, 0);
  page.store = new Store(lines, Math.round(hello.kept_s / hello.bin_s), 0, hello.bin_s);
  $("events").replaceChildren();
  $("events").className = hello.live ? "live" : "log";
  layPanels(hello.panels);
  layTime(hello);
  document.dispatchEvent(new Event("cockpit-hello"));
  if (!hello.live) ask();
  flag();
}

function takeSpans(data) {
  const view = new DataView(data), first = view.getUint32(0, true), count = view.getUint32(4, true);
  const values = new Float32Array(data, 24);
  if (!page.hello.live) {
    page.store = new Store(page.store.values.length, count, view.getFloat64(8, true), view.getFloat64(16, true));
    page.waiting = false;
  }
  page.store.take(first, count, values);
  if (page.again) ask();
  soon();
}

// ---- time

function layTime(hello) {
  const whole = Math.max(hello.end_s || 0, 0.1);
  const choices = hello.live ? [5, 20, 60] : [2, 10, 60].filter(one => one < whole).concat([whole]);
  if (!choices.includes(page.span)) page.span = choices[choices.length - 1];
  $("spans").replaceChildren(...choices.map(span => {
    const one = make("button", "", !hello.live && span === whole ? "whole" : `${span} s`);
    one.type = "button";
    one.onclick = () => { page.span = span; mark(); ask(); soon(); };
    one.dataset.span = span;
    return one;
  }));
  const mark = () => [...$("spans").children].forEach(one => one.classList.toggle("on", Number(one.dataset.span) === page.span));
  mark();
  $("pause").hidden = !hello.live;
  $("play").hidden = $("scrub").hidden = hello.live;
  if (!hello.live) { $("scrub").max = whole; move(page.end > 0 && page.end <= whole ? page.end : whole); }
}

function move(time) {
  page.end = Math.min(Math.max(time, Math.min(page.span, page.hello.end_s)), page.hello.end_s);
  $("scrub").value = page.end;
  ask();
}

// Ask for the window of a log; one question at a time.
function ask() {
  if (!page.hello || page.hello.live) return;
  page.again = page.waiting;
  if (page.waiting) return;
  page.waiting = true;
  const end = Math.max(page.end, page.span), pixels = Math.max(200, (page.plots[0].canvas.clientWidth || 600) - GUTTER - RIGHT);
  send({ ask: "window", begin_s: end - page.span, end_s: end, pixels: Math.round(pixels * Math.min(devicePixelRatio || 1, 2)) });
}

$("scrub").oninput = () => { page.playing = false; label(); move(Number($("scrub").value)); };
$("pause").onclick = () => { page.paused = page.paused === null ? page.store.end() : null; label(); soon(); };
$("play").onclick = () => {
  if (!page.playing && page.end >= page.hello.end_s) move(0);
  page.playing = !page.playing;
  label();
  let before = performance.now();
  const step = now => {
    if (!page.playing) return;
    move(page.end + (now - before) / 1000);
    before = now;
    if (page.end >= page.hello.end_s) page.playing = false;
    label();
    requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
};

function label() {
  $("play").textContent = page.playing ? "Stop" : "Play";
  $("pause").textContent = page.paused === null ? "Pause" : "Resume";
  $("pause").classList.toggle("on", page.paused !== null);
}

function clock(seconds) {
  if (!page.hello.live) return `${seconds.toFixed(2)} s`;
  const whole = Math.floor(seconds), tenth = Math.floor(10 * (seconds - whole));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}.${tenth}`;
}

// ---- panels

function layPanels(panels) {
  let first = 0;
  page.plots = [];
  $("panels").replaceChildren(...panels.map(panel => {
    const box = make("div", "panel"), legend = make("div", "legend"), canvas = make("canvas"), title = make("h2", "", panel.title);
    if (panel.unit) title.append(make("small", "", ` ${panel.unit}`));
    legend.append(title);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${panel.title}${panel.unit ? ` in ${panel.unit}` : ""} over time`);
    const plot = new Plot(canvas, panel, first);
    plot.outputs = panel.strips ? [] : panel.lines.map(line => {
      const part = make("span"), value = make("output");
      part.append(sample(line), line.name, value);
      legend.append(part);
      return value;
    });
    canvas.onpointermove = event => pointed(plot, event);
    canvas.onpointerleave = () => { page.cursor = null; soon(); };
    box.append(legend, canvas);
    page.plots.push(plot);
    first += panel.lines.length;
    return box;
  }));
}

function sample(line) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"), mark = document.createElementNS(svg.namespaceURI, "path");
  svg.setAttribute("viewBox", "0 0 20 9");
  mark.setAttribute("d", "M0 5H20");
  const wide = { band: 9, faint: 1 }[line.look] || 2;
  mark.setAttribute("stroke-width", wide);
  mark.style.stroke = `var(--${line.colour})`;
  if (line.look === "band") mark.setAttribute("stroke-opacity", 0.3);
  if (line.look === "dash") mark.setAttribute("stroke-dasharray", "6 3");
  svg.append(mark);
  return svg;
}

function pointed(plot, event) {
  if (!plot.box) return;
  const { left, right, begin, end } = plot.box, x = event.clientX - plot.canvas.getBoundingClientRect().left;
  page.cursor = x < left || x > right ? null : begin + (x - left) / (right - left) * (end - begin);
  soon();
}

let look = null;

function colours() {
  look = { font: FONT };
  for (const name of ["ink", "soft", "muted", "grid", "well", "chip", "teal", "amber", "red", "blue", "violet", "grey", "slate", "good", "doubt", "bad"])
    look[name] = colour(name);
  look.move = look.blue;
}

function soon() {
  if (page.due) return;
  page.due = true;
  requestAnimationFrame(() => { page.due = false; draw(); });
}

function draw() {
  if (!page.store || !page.hello) return;
  const live = page.hello.live, end = live ? (page.paused ?? page.store.end()) : Math.max(page.end, page.span);
  const seen = { ...look, live, events: page.events, cursor: page.cursor };
  for (const plot of page.plots) {
    const box = plot.canvas.getBoundingClientRect();
    if (box.bottom > -100 && box.top < innerHeight + 100) plot.draw(page.store, end - page.span, end, seen);
    plot.outputs.forEach((output, k) => {
      const found = page.store.at(plot.firstLine + k, page.cursor ?? end, 0.5), places = plot.panel.places;
      const text = !found ? "–" : plot.panel.lines[k].look === "band" ? `± ${written((found[1] - found[0]) / 2, places)}`
        : written((found[0] + found[1]) / 2, places);
      if (output.textContent !== text) output.textContent = text;
    });
  }
  $("clock").textContent = `${page.cursor !== null ? "cursor " : ""}${clock(Math.max(page.cursor ?? end, 0))}`;
  document.documentElement.dataset.drawn = Number(document.documentElement.dataset.drawn || 0) + 1;
}

// ---- cards

function show(state) {
  const { readings, model, nodes, bus } = state;
  const drive = nodes.find(one => one.role === "drive"), controller = nodes.find(one => one.node === "controller");
  const facts = [
    ["Position", readings.position, readings.band, ""],
    ["Reference", readings.reference, readings.speed, ""],
    ["Estimate less reference", readings.error, "", ""],
    ["Model", model.state || "–", model.short, model.grade],
    [drive ? `Drive: ${drive.node}` : "Drive", drive ? drive.state : "–", drive ? drive.more.join(", ") : "not heard", drive ? drive.grade : ""],
    ["Controller", controller ? controller.state : "–", controller ? `up ${controller.up}` : "not heard", controller ? controller.grade : ""],
  ];
  if (!$("facts").children.length)
    $("facts").replaceChildren(...facts.map(() => { const box = make("div", "fact"); box.append(make("label"), make("b"), make("small")); return box; }));
  facts.forEach(([name, value, more, grade], k) => {
    const box = $("facts").children[k];
    box.className = `fact ${grade}`;
    [name, value, more].forEach((text, n) => { if (box.children[n].textContent !== text) box.children[n].textContent = text; });
    box.children[1].title = value;
  });
  showModel(model);
  $("nodes").replaceChildren(table(["node", "state", "up"], nodes.map(one => [one.node, dotted(one.state, one.grade, one.more), one.up])));
  const counts = [["frames", bus.rate], ["load", bus.load], ["good", bus.good], ["lost", bus.lost], ["unknown", bus.unknown], ["refused", bus.refused]];
  const rows = [table(["", ""], counts.map(([name, value]) => [name, String(value)]))];
  if (state.refused.length) rows.push(table(["refused frame", "reason", ""], state.refused.map(one => one.map(String))));
  $("bus").replaceChildren(...rows);
}

function showModel(model) {
  const parts = [];
  const head = make("p");
  head.append(dotted(model.state || "not heard", model.grade, []));
  parts.push(head);
  if (model.words) parts.push(make("p", "muted", model.words));
  page.hello.models.forEach((one, k) => {
    const box = make("div", k === model.number ? "used" : "");
    const name = make("p", "made", `${k + 1}. ${one.made}`);
    box.append(name, make("p", "muted", `${one.kind}, ${k === model.number ? "in use" : k < model.number ? "used before" : "offered"}`));
    if (one.rows.length && k === model.number) box.append(table(["parameter", "in use", "rig file"], one.rows));
    parts.push(box);
  });
  if (model.number >= page.hello.models.length && page.hello.models.length) parts.push(make("p", "", `Model ${model.number + 1}, learned in this run, is in use.`));
  $("model").replaceChildren(...parts);
}

function dotted(text, grade, more) {
  const span = make("span");
  span.append(make("span", `dot ${grade}`), text);
  if (more.length) span.append(make("span", "muted", ` ${more.join(", ")}`));
  return span;
}

function table(head, rows) {
  const one = make("table"), body = make("tbody");
  if (head.some(Boolean)) {
    const top = make("thead"), row = make("tr");
    head.forEach((text, k) => row.append(make("th", k < 2 && head.length > 2 || !k ? "word" : "", text)));
    top.append(row);
    one.append(top);
  }
  for (const cells of rows) {
    const row = make("tr");
    cells.forEach((cell, k) => { const td = make("td", k < 2 && cells.length > 2 || !k ? "word" : ""); td.append(cell); row.append(td); });
    body.append(row);
  }
  one.append(body);
  return one;
}

function addEvents(events) {
  if (!events.length) return;
  page.events = page.events.concat(events).slice(-EVENTS);
  for (const [time, words, grade] of events) {
    const item = make("li"), when = make("time", "", clock(time));
    item.append(when, make("span", grade, words));
    if (page.hello.live) $("events").prepend(item);
    else { item.onclick = () => move(time + 0.1 * page.span); $("events").append(item); }
  }
  while ($("events").children.length > 500) (page.hello.live ? $("events").lastChild : $("events").firstChild).remove();
}

// ---- begin

// Scripts that follow this one listen, too: the connection begins once they do.
addEventListener("DOMContentLoaded", connect);
colours();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours(); soon(); });
addEventListener("resize", () => { ask(); soon(); });
addEventListener("scroll", soon, { passive: true });
setInterval(flag, 500);
