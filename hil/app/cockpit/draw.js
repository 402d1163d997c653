"use strict";
// A panel's drawing: lines as least and largest value of each span of time, on a canvas, in the colours of the style.

const GUTTER = 76, RIGHT = 12, TOP = 6, FOOT = 20, ROW = 22;

function colour(name) { return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim(); }

// Spans of time number first to head, each `span` s long, number 0 beginning at `origin`; `size` of them are kept.
class Store {
  constructor(lines, size, origin, span) {
    Object.assign(this, { size, origin, span, first: 0, head: 0 });
    this.values = Array.from({ length: lines }, () => new Float32Array(2 * size).fill(NaN));
  }

  // Take in `count` spans from number `first` on, `values` (lines, count, 2).
  take(first, count, values) {
    if (first > this.head) { this.values.forEach(one => one.fill(NaN)); this.first = first; }
    this.values.forEach((own, line) => {
      for (let k = 0; k < count; k++) {
        const to = 2 * ((first + k) % this.size), from = 2 * (line * count + k);
        own[to] = values[from]; own[to + 1] = values[from + 1];
      }
    });
    this.head = first + count;
    this.first = Math.max(this.first, this.head - this.size);
  }

  end() { return this.origin + this.head * this.span; }
  number(time) { return Math.floor((time - this.origin) / this.span); }
  low(line, k) { return this.values[line][2 * (k % this.size)]; }
  high(line, k) { return this.values[line][2 * (k % this.size) + 1]; }

  // The last value of a line at or before a time, not older than `within` s.
  at(line, time, within) {
    const last = Math.min(this.number(time), this.head - 1);
    for (let k = last; k >= Math.max(this.first, last - Math.ceil(within / this.span)); k--)
      if (!Number.isNaN(this.low(line, k))) return [this.low(line, k), this.high(line, k)];
    return null;
  }
}

// Round numbers between low and high, about `count` of them.
function ticks(low, high, count) {
  const rough = (high - low) / Math.max(count, 1), size = 10 ** Math.floor(Math.log10(rough));
  const step = size * ([1, 2, 5, 10].find(one => one * size >= rough) || 10);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { found, places: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

function written(value, places) {
  const text = value.toFixed(places);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}

class Plot {
  constructor(canvas, panel, firstLine) {
    Object.assign(this, { canvas, panel, firstLine, range: null });
    this.height = panel.strips ? ROW * panel.lines.length + FOOT + TOP : panel.title === "Position" ? 230 : 132;
    canvas.style.height = `${this.height}px`;
    this.context = canvas.getContext("2d");
  }

  // Draw the time from `begin` to `end`; `look` has the colours, the cursor's time, the events and how times read.
  draw(store, begin, end, look) {
    const ratio = devicePixelRatio || 1, width = this.canvas.clientWidth;
    if (!width) return;
    const [w, h] = [Math.round(width * ratio), Math.round(this.height * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) { this.canvas.width = w; this.canvas.height = h; }
    const c = this.context;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, this.height);
    c.font = `12px ${look.font}`;
    this.box = { left: GUTTER, right: width - RIGHT, top: TOP, bottom: this.height - FOOT, begin, end };
    this.x = time => GUTTER + (time - begin) / (end - begin) * (width - RIGHT - GUTTER);
    this.times(look);
    if (this.panel.strips) this.panel.lines.forEach((line, row) => this.strip(store, line, row, look));
    else this.lines(store, look);
    this.marks(look);
  }

  times(look) {
    const c = this.context, { left, right, top, bottom, begin, end } = this.box;
    const shift = look.live ? end : 0;
    const { found, places } = ticks(begin - shift, end - shift, (right - left) / 80);
    c.textBaseline = "top";
    for (const time of found) {
      const x = Math.round(this.x(time + shift)) + 0.5;
      c.strokeStyle = look.grid; c.lineWidth = 1;
      c.beginPath(); c.moveTo(x, top); c.lineTo(x, bottom); c.stroke();
      const text = look.live && Math.abs(time) < 1e-9 ? "now" : `${written(time, places)} s`;
      const wide = c.measureText(text).width;
      c.fillStyle = look.muted; c.textAlign = "left";
      c.fillText(text, Math.min(Math.max(x - wide / 2, left - 10), right + RIGHT - wide), bottom + 5);
    }
  }

  // The range of the values in sight; kept while they fill half of it.
  extent(store) {
    const { begin, end } = this.box;
    let low = Math.min(...this.panel.marks), high = Math.max(...this.panel.marks);
    const from = Math.max(store.number(begin), store.first), to = Math.min(store.number(end) + 1, store.head);
    this.panel.lines.forEach((_, k) => {
      for (let n = from; n < to; n++) {
        const a = store.low(this.firstLine + k, n), b = store.high(this.firstLine + k, n);
        if (a < low) low = a;
        if (b > high) high = b;
      }
    });
    if (low > high) [low, high] = [0, 0];
    if (this.panel.places === 0) low = Math.min(low, 0);
    const missing = this.panel.span - (high - low);
    if (missing > 0) {
      if (low >= 0 && this.panel.places === 0) high += missing;
      else { low -= missing / 2; high += missing / 2; }
    }
    const before = this.range;
    if (before && before[0] <= low && before[1] >= high && high - low > 0.5 * (before[1] - before[0])) return before;
    const room = 0.09 * (high - low);
    this.range = [this.panel.places === 0 && low === 0 ? 0 : low - room, high + room];
    return this.range;
  }

  lines(store, look) {
    const c = this.context, { left, right, top, bottom } = this.box, [low, high] = this.extent(store);
    const y = value => bottom - (value - low) / (high - low) * (bottom - top);
    const { found, places } = ticks(low, high, (bottom - top) / 26);
    c.textAlign = "right"; c.textBaseline = "middle";
    for (const value of found) {
      const at = Math.round(y(value)) + 0.5;
      c.strokeStyle = look.grid; c.lineWidth = 1;
      c.beginPath(); c.moveTo(left, at); c.lineTo(right, at); c.stroke();
      c.fillStyle = look.muted; c.fillText(written(value, places), left - 8, at);
    }
    c.save();
    c.beginPath(); c.rect(left, top - 2, right - left, bottom - top + 4); c.clip();
    for (const value of this.panel.marks) {
      c.strokeStyle = look.muted; c.lineWidth = 1; c.setLineDash(value === 0 ? [] : [3, 4]); c.globalAlpha = 0.7;
      c.beginPath(); c.moveTo(left, y(value)); c.lineTo(right, y(value)); c.stroke();
      c.setLineDash([]); c.globalAlpha = 1;
    }
    this.panel.lines.forEach((line, k) => this.line(store, this.firstLine + k, line, y, look));
    c.restore();
  }

  line(store, number, line, y, look) {
    const c = this.context, { begin, end } = this.box, parts = [[]];
    const from = Math.max(store.number(begin), store.first), to = Math.min(store.number(end) + 1, store.head);
    let column = -1;
    for (let n = from; n < to; n++) {
      const a = store.low(number, n), b = store.high(number, n);
      if (Number.isNaN(a)) { if (parts[parts.length - 1].length) parts.push([]); column = -1; continue; }
      const x = this.x(store.origin + (n + 0.5) * store.span), part = parts[parts.length - 1];
      if (Math.floor(x) === column) {
        const last = part[part.length - 1];
        last[1] = Math.min(last[1], a); last[2] = Math.max(last[2], b);
      } else { part.push([x, a, b]); column = Math.floor(x); }
    }
    c.strokeStyle = c.fillStyle = look[line.colour]; c.lineJoin = "round";
    for (const part of parts.filter(one => one.length)) {
      if (line.look === "band") {
        c.globalAlpha = 0.2; c.beginPath();
        part.forEach(([x, , b]) => c.lineTo(x, y(b)));
        for (const [x, a] of part.slice().reverse()) c.lineTo(x, y(a));
        c.fill(); c.globalAlpha = 1;
        continue;
      }
      c.lineWidth = line.look === "faint" ? 1 : 1.7; c.globalAlpha = line.look === "faint" ? 0.75 : 1;
      c.setLineDash(line.look === "dash" ? [6, 4] : []);
      c.beginPath();
      let up = true;
      for (const [x, a, b] of part) {
        if (y(a) - y(b) < 1) c.lineTo(x, y(b));
        else { c.lineTo(x, y(up ? a : b)); c.lineTo(x, y(up ? b : a)); up = !up; }
      }
      if (part.length === 1) c.lineTo(part[0][0] + 1, y(part[0][2]));
      c.stroke(); c.setLineDash([]); c.globalAlpha = 1;
    }
  }

  strip(store, line, row, look) {
    const c = this.context, { left, right, begin, end } = this.box, number = this.firstLine + row;
    const top = TOP + row * ROW + 2, height = ROW - 4;
    c.textBaseline = "middle"; c.textAlign = "right"; c.fillStyle = look.muted;
    c.fillText(line.name, left - 8, top + height / 2 + 0.5);
    const from = Math.max(store.number(begin), store.first), to = Math.min(store.number(end) + 1, store.head);
    for (let n = from; n < to;) {
      const value = store.high(number, n);
      let last = n + 1;
      while (last < to && store.high(number, last) === value) last++;
      const [name, grade] = line.names[value] || ["", ""];
      if (name) {
        const x = Math.max(this.x(store.origin + n * store.span), left);
        const wide = Math.min(this.x(store.origin + last * store.span), right) - x;
        c.fillStyle = look[grade] || look.well; c.globalAlpha = grade === "note" ? 1 : 0.85;
        c.fillRect(x, top, Math.max(wide - 0.5, 1), height);
        c.globalAlpha = 1;
        if (c.measureText(name).width + 10 < wide) {
          c.fillStyle = grade === "note" ? look.soft : look.chip; c.textAlign = "left";
          c.fillText(name, x + 6, top + height / 2 + 0.5);
        }
      }
      n = Math.max(last, n + 1);
    }
  }

  // Events and the cursor.
  marks(look) {
    const c = this.context, { top, bottom, begin, end } = this.box;
    for (const [time, , grade] of look.events) {
      if (grade === "note" || time < begin || time > end) continue;
      c.strokeStyle = look[grade]; c.globalAlpha = 0.6; c.lineWidth = 1; c.setLineDash([2, 3]);
      c.beginPath(); c.moveTo(this.x(time), top); c.lineTo(this.x(time), bottom); c.stroke();
      c.setLineDash([]); c.globalAlpha = 1;
    }
    if (look.cursor === null || look.cursor < begin || look.cursor > end) return;
    c.strokeStyle = look.ink; c.lineWidth = 1;
    c.beginPath(); c.moveTo(this.x(look.cursor), top); c.lineTo(this.x(look.cursor), bottom); c.stroke();
  }
}
