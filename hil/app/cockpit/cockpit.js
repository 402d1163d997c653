"use strict";
// The page of `capsule cockpit`: asks the server for what is new, draws it, shows the state, and, with a token, steers.

const $ = id => document.getElementById(id);
const TOKEN = tokenOf();
const STRIPS = [["good", "works"], ["doubt", "take care"], ["bad", "stopped or lost"], ["blue", "slips"], ["well", "at rest"]];
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
  if (!ok) document.dispatchEvent(new Event("cockpit-lost"));
  const [words, grade] = !ok ? ["connection lost", "bad"] : page.hello.live ? trouble ? ["no frames", "doubt"] : ["live", "good"] : ["log", ""];
  $("link").textContent = words;
  $("link").className = `flag ${grade}`;
  document.documentElement.dataset.link = words;
  const said = ok ? trouble : page.hello ? "The cockpit does not answer, what is shown is old: see whether 'capsule cockpit' still runs in its terminal. This page tries again; until then use the rig's own switch to stop." : "";
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
  $("clock").title = hello.tips.clock;
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
    one.title = "how much time the panels show";
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
    const box = make("div", "panel"), legend = make("div", "legend"), canvas = make("canvas"), title = tipped(make("h2", "", panel.title), panel.tip);
    if (panel.unit) title.append(make("small", "", ` ${panel.unit}`));
    legend.append(title);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${panel.title}${panel.unit ? ` in ${panel.unit}` : ""} over time`);
    const plot = new Plot(canvas, panel, first);
    plot.outputs = panel.lines.map(line => {
      const part = tipped(make("span"), line.tip), value = make("output");
      part.append(...(panel.strips ? [] : [sample(line)]), line.name, value);
      legend.append(part);
      return value;
    });
    if (panel.marked) keyed(legend, { colour: "muted", look: "mark" }, panel.marked, panel.tip);
    if (panel.strips) for (const [colour, means] of STRIPS) keyed(legend, { colour, look: "block" }, means, panel.tip);
    else if (!page.plots.length) keyed(legend, { colour: "doubt", look: "event" }, "event", page.hello.tips.event);
    canvas.onpointermove = event => pointed(plot, event);
    canvas.onpointerleave = () => { page.cursor = null; soon(); };
    box.append(legend, canvas);
    page.plots.push(plot);
    first += panel.lines.length;
    return box;
  }));
}

function tipped(part, tip) { part.title = tip; return part; }

function keyed(legend, line, means, tip) {
  const part = tipped(make("span"), tip);
  part.append(sample(line), means);
  legend.append(part);
}

function sample(line) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"), mark = document.createElementNS(svg.namespaceURI, "path");
  svg.setAttribute("viewBox", "0 0 20 9");
  mark.setAttribute("d", line.look === "event" ? "M10 -2V11" : "M0 5H20");
  const wide = { band: 9, block: 9, faint: 1, mark: 1, event: 1 }[line.look] || 2;
  mark.setAttribute("stroke-width", wide);
  mark.style.stroke = `var(--${line.colour})`;
  if (line.look === "band") mark.setAttribute("stroke-opacity", 0.3);
  if (line.look === "dash") mark.setAttribute("stroke-dasharray", "6 3");
  if (line.look === "mark" || line.look === "event") mark.setAttribute("stroke-dasharray", "3 3");
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
      const { look, names } = plot.panel.lines[k];
      const text = !found ? "–" : names ? (names[found[1]] || ["–"])[0] : look === "band" ? `± ${written((found[1] - found[0]) / 2, places)}`
        : written((found[0] + found[1]) / 2, places);
      if (output.textContent !== text) output.textContent = text;
    });
  }
  $("clock").textContent = `${page.cursor !== null ? "cursor " : ""}${clock(Math.max(page.cursor ?? end, 0))}`;
  document.documentElement.dataset.drawn = Number(document.documentElement.dataset.drawn || 0) + 1;
}

// ---- cards

function show(state) {
  const { readings, model, nodes, bus } = state, tips = page.hello.tips;
  const drive = nodes.find(one => one.role === "drive"), controller = nodes.find(one => one.role === "controller");
  const unheard = { state: "–", why: "not heard", grade: "" };
  const heard = (name, node, tip) => [name, node.state, node.warm ? `${node.warm}, ${node.why}` : node.why, node.grade, tip];
  const facts = [
    ["Position", readings.position, readings.band, "", tips.position],
    ["Reference", readings.reference, readings.speed, "", tips.reference],
    ["Estimate minus reference", readings.error, "", "", tips.error],
    ["Model", model.state, model.why, model.grade, tips.model],
    heard(drive ? `Drive: ${drive.node}` : "Drive", drive || unheard, tips.drive),
    heard("Controller", controller || unheard, tips.controller),
  ];
  if (!$("facts").children.length)
    $("facts").replaceChildren(...facts.map(() => { const box = make("div", "fact"); box.append(make("label"), make("b"), make("small")); return box; }));
  facts.forEach(([name, value, more, grade, tip], k) => {
    const box = $("facts").children[k];
    box.className = `fact ${grade}`;
    box.title = tip;
    [name, value, more].forEach((text, n) => { if (box.children[n].textContent !== text) box.children[n].textContent = text; });
  });
  showModel(model, tips);
  fill("nodes", table(["node", "state", "up"], nodes.map(one => [one.node, stated(one, tips), one.up]), ["", "", tips.up]));
  const counts = ["rate", "load", "good", "lost", "unknown", "refused"];
  const rows = [table(["", ""], counts.map(name => [name === "rate" ? "frames" : name, String(bus[name])]), counts.map(name => tips[name]), true)];
  if (state.refused.length) rows.push(table(["refused", "count"], state.refused.map(refused), ["", tips.refused_frame]));
  fill("bus", ...rows);
}

// New contents, but only where they differ: a tooltip that is open stays.
function fill(id, ...parts) {
  const box = make("div");
  box.append(...parts);
  if (box.innerHTML !== $(id).innerHTML) $(id).replaceChildren(...parts);
}

function showModel(model, tips) {
  const parts = [make("p")];
  parts[0].append(make("span", `dot ${model.grade}`), model.state);
  parts.push(make("p", "muted", model.why));
  for (const [name, text] of model.facts) parts.push(tipped(make("p", "muted", text), tips[name]));
  page.hello.models.forEach((one, k) => {
    const box = make("div", k === model.number ? "used" : "");
    box.append(tipped(make("p", "made", `${k + 1}. ${one.made}`), tips.number));
    box.append(make("p", "muted", `${one.kind}, ${k === model.number ? "in use" : k < model.number ? "used before" : "offered"}`));
    if (one.rows.length && k === model.number) box.append(table(["parameter", "in use", "rig file"], one.rows, ["", tips.parameter, tips.rig_file]));
    parts.push(box);
  });
  if (model.number >= page.hello.models.length && page.hello.models.length)
    parts.push(tipped(make("p", "", `Model ${model.number + 1}, learned in this run, is in use.`), tips.number));
  fill("model", ...parts);
}

// A node's state; its cause and remedy stand beside it where something is wrong, else in the tooltip.
function stated(one, tips) {
  const span = tipped(make("span"), one.why);
  span.append(make("span", `dot ${one.grade}`), one.state);
  if (one.warm) span.append(tipped(make("span", "muted", ` ${one.warm}`), tips.temperature));
  if (one.grade === "bad" || one.grade === "doubt") span.append(make("small", "muted", one.why));
  return span;
}

function refused([frame, reason, count]) {
  const cell = make("span", "", frame);
  cell.append(make("small", "muted", reason));
  return [cell, String(count)];
}

// `tips` are those of the columns or, `byRow`, of the rows.
function table(head, rows, tips, byRow) {
  const one = make("table"), body = make("tbody"), word = (k, count) => (k < 2 && count > 2 || !k ? "word" : "");
  if (head.some(Boolean)) {
    const top = make("thead"), row = make("tr");
    head.forEach((text, k) => row.append(tipped(make("th", word(k, head.length), text), tips[k])));
    top.append(row);
    one.append(top);
  }
  rows.forEach((cells, n) => {
    const row = make("tr");
    cells.forEach((cell, k) => { const td = tipped(make("td", word(k, cells.length)), tips[byRow ? n : k]); td.append(cell); row.append(td); });
    body.append(row);
  });
  one.append(body);
  return one;
}

function addEvents(events) {
  if (!events.length) return;
  page.events = page.events.concat(events).slice(-EVENTS);
  for (const [time, words, grade] of events) {
    const item = tipped(make("li"), page.hello.tips.event), when = make("time", "", clock(time));
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
