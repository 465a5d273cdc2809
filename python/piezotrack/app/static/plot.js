// Charts on a canvas: lines over time and in the plane, with units, zoom, cursor and a brush.

const PAD = { left: 66, right: 12, top: 8, bottom: 38 };
const NEAR = 8;
const charts = new Set();
let cursor = null;

const colour = (role) =>
  getComputedStyle(document.documentElement).getPropertyValue(`--${role}`).trim() || "#888";

export function unpack(text) {
  if (Uint8Array.fromBase64) return new Float64Array(Uint8Array.fromBase64(text).buffer);
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return new Float64Array(bytes.buffer);
}

function range(lines, levels, axis) {
  let low = Infinity, high = -Infinity;
  for (const line of lines) {
    for (const values of axis === "x" ? [line.x] : [line.y, line.to ?? []]) {
      for (const v of values) {
        if (v < low) low = v;
        if (v > high) high = v;
      }
    }
  }
  for (const level of levels) {
    if ((level.axis ?? "y") === axis) {
      low = Math.min(low, level.at);
      high = Math.max(high, level.at);
    }
  }
  if (!(low <= high)) return [0, 1];
  if (low === high) return [low - 1, high + 1];
  return [low, high];
}

function ticks(low, high, count, log) {
  if (log) {
    const found = [];
    for (let e = Math.floor(low); e <= Math.ceil(high); e++) {
      for (const m of high - low < 2 ? [1, 2, 5] : [1]) {
        const at = e + Math.log10(m);
        if (at >= low - 1e-9 && at <= high + 1e-9) found.push(at);
      }
    }
    return { at: found, text: (v) => String(Number(Math.pow(10, v).toPrecision(3))) };
  }
  const rough = (high - low) / Math.max(count, 1);
  const power = Math.pow(10, Math.floor(Math.log10(rough)));
  const step = power * ([1, 2, 5, 10].find((m) => m * power >= rough) ?? 10);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + step * 1e-6; k++) found.push(k * step);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const text = (v) => (Math.abs(v) >= 1e5 || digits > 5 ? v.toPrecision(4) : v.toFixed(digits)).replace("-", "\u2212");
  return { at: found, text };
}

export class Chart {
  constructor(part, send) {
    this.send = send;
    this.view = null;
    this.element = document.createElement("figure");
    this.element.className = "chart";
    this.element.innerHTML =
      '<figcaption><h3></h3><button type="button" class="all" hidden>Show all</button>' +
      '<button type="button" class="picture">Picture</button><button type="button" class="rows" aria-expanded="false">Show as table</button></figcaption>' +
      '<div class="plot"><canvas></canvas><canvas role="img" tabindex="0"></canvas></div>' +
      '<div class="legend"></div><p class="sentence"></p><div class="scroll" hidden></div>';
    this.box = this.element.querySelector(".plot");
    [this.base, this.over] = this.element.querySelectorAll("canvas");
    this.legend = this.element.querySelector(".legend");
    this.element.querySelector(".all").onclick = () => this.zoom(null);
    this.element.querySelector(".picture").onclick = () => this.send({ do: "picture", chart: this.part.id });
    this.element.querySelector(".rows").onclick = (event) => this.toggleTable(event.target);
    this.over.onpointerdown = (event) => this.press(event);
    this.over.onpointermove = (event) => this.move(event);
    this.over.onpointerup = (event) => this.release(event);
    this.over.onpointercancel = () => (this.drag = null);
    this.over.onpointerleave = () => this.point(null);
    this.over.ondblclick = () => this.zoom(null);
    this.over.onkeydown = (event) => this.key(event);
    new ResizeObserver(() => this.draw()).observe(this.box);
    charts.add(this);
    this.update(part);
  }

  remove() {
    charts.delete(this);
  }

  update(part) {
    this.part = part;
    this.element.classList.toggle("half", !part.wide);
    this.element.querySelector("h3").textContent = part.title;
    this.element.querySelector(".sentence").textContent = part.sentence;
    this.over.setAttribute("aria-label", `${part.title}. ${part.sentence}`);
    this.box.style.height = `${part.height ?? 300}px`;
    this.lines = part.lines.map((line) => ({
      ...line, x: unpack(line.x), y: unpack(line.y), to: line.to ? unpack(line.to) : null,
    }));
    for (const line of this.lines) {
      if (part.log?.includes("x")) line.x = line.x.map(Math.log10);
      if (part.log?.includes("y")) line.y = line.y.map(Math.log10);
    }
    this.levels = part.levels ?? [];
    const x = range(this.lines, this.levels, "x"), y = range(this.lines, this.levels, "y");
    const edge = 0.04 * (y[1] - y[0]);
    const side = part.x.label === "time" ? 0 : 0.02 * (x[1] - x[0]);
    this.whole = part.view ?? [x[0] - side, x[1] + side, y[0] - edge, y[1] + edge];
    if (!this.dragging) this.brush = part.brush ? [part.brush.from, part.brush.to] : null;
    this.names();
    this.draw();
    const table = this.element.querySelector(".scroll");
    if (!table.hidden) this.fill(table);
  }

  names() {
    this.legend.replaceChildren();
    const seen = new Set();
    for (const one of [...this.lines, ...(this.part.regions ?? []).map((r) => ({ ...r, name: r.label }))]) {
      if (!one.name || seen.has(one.name)) continue;
      seen.add(one.name);
      const item = document.createElement("span");
      const key = document.createElement("span");
      key.className = "key";
      key.style.borderTopColor = colour(one.role);
      if (one.dash) key.style.borderTopStyle = "dashed";
      if (one.marks) key.style.borderTopStyle = "dotted";
      item.append(key, one.name);
      this.legend.append(item);
    }
    this.reading = document.createElement("output");
    this.legend.append(this.reading);
  }

  // From data to pixels and back.
  x(v) { return PAD.left + ((v - this.shown[0]) / (this.shown[1] - this.shown[0])) * this.w; }
  y(v) { return PAD.top + (1 - (v - this.shown[2]) / (this.shown[3] - this.shown[2])) * this.h; }
  at(event) {
    const rect = this.over.getBoundingClientRect();
    const px = Math.min(Math.max(event.clientX - rect.left, PAD.left), PAD.left + this.w);
    const py = Math.min(Math.max(event.clientY - rect.top, PAD.top), PAD.top + this.h);
    return {
      px, py,
      x: this.shown[0] + ((px - PAD.left) / this.w) * (this.shown[1] - this.shown[0]),
      y: this.shown[2] + (1 - (py - PAD.top) / this.h) * (this.shown[3] - this.shown[2]),
    };
  }

  surface(canvas) {
    const scale = window.devicePixelRatio || 1;
    const { clientWidth: w, clientHeight: h } = this.box;
    canvas.width = Math.round(w * scale);
    canvas.height = Math.round(h * scale);
    const g = canvas.getContext("2d");
    g.scale(scale, scale);
    g.font = "12px system-ui, sans-serif";
    return [g, w, h];
  }

  draw() {
    if (!this.box.clientWidth) return;
    this.shown = this.view ?? this.whole;
    const [g, width, height] = this.surface(this.base);
    this.w = width - PAD.left - PAD.right;
    this.h = height - PAD.top - PAD.bottom;
    this.axes(g, width, height);
    g.save();
    g.beginPath();
    g.rect(PAD.left, PAD.top, this.w, this.h);
    g.clip();
    for (const one of this.part.regions ?? []) this.region(g, one);
    for (const line of this.lines) this.line(g, line);
    for (const level of this.levels) this.level(g, level);
    g.restore();
    this.element.querySelector(".all").hidden = !this.view;
    this.overlay();
  }

  axes(g, width, height) {
    const text = colour("quiet"), grid = colour("line");
    const { x: xa, y: ya, log } = this.part;
    const xs = ticks(this.shown[0], this.shown[1], this.w / 90, log?.includes("x"));
    const ys = ticks(this.shown[2], this.shown[3], this.h / 45, log?.includes("y"));
    g.strokeStyle = grid;
    g.fillStyle = text;
    g.lineWidth = 1;
    g.beginPath();
    g.textAlign = "center";
    for (const v of xs.at) {
      const px = Math.round(this.x(v)) + 0.5;
      g.moveTo(px, PAD.top);
      g.lineTo(px, PAD.top + this.h);
      g.fillText(xs.text(v), px, PAD.top + this.h + 15);
    }
    g.textAlign = "right";
    for (const v of ys.at) {
      const py = Math.round(this.y(v)) + 0.5;
      g.moveTo(PAD.left, py);
      g.lineTo(PAD.left + this.w, py);
      g.fillText(ys.text(v), PAD.left - 6, py + 4);
    }
    g.stroke();
    const named = (a) => (a.unit ? `${a.label} [${a.unit}]` : a.label);
    g.textAlign = "center";
    g.fillText(named(xa), PAD.left + this.w / 2, height - 5);
    g.save();
    g.translate(13, PAD.top + this.h / 2);
    g.rotate(-Math.PI / 2);
    g.fillText(named(ya), 0, 0);
    g.restore();
  }

  region(g, one) {
    const along = one.axis !== "y";
    const a = along ? this.x(one.from) : this.y(one.to), b = along ? this.x(one.to) : this.y(one.from);
    const size = Math.max(b - a, 2);
    const box = along ? [a, PAD.top, size, this.h] : [PAD.left, a, this.w, size];
    g.save();
    g.globalAlpha = 0.16;
    g.fillStyle = colour(one.role);
    g.fillRect(...box);
    if (one.hatched) {
      g.globalAlpha = 0.5;
      g.strokeStyle = colour(one.role);
      g.beginPath();
      g.rect(...box);
      g.clip();
      g.beginPath();
      for (let p = box[0] - box[3]; p < box[0] + box[2]; p += 9) {
        g.moveTo(p, box[1] + box[3]);
        g.lineTo(p + box[3], box[1]);
      }
      g.stroke();
    }
    g.restore();
  }

  level(g, level) {
    const along = (level.axis ?? "y") === "y";
    const at = Math.round(along ? this.y(level.at) : this.x(level.at)) + 0.5;
    g.save();
    g.strokeStyle = g.fillStyle = colour(level.role ?? "noise");
    g.setLineDash([2, 3]);
    g.beginPath();
    g.moveTo(along ? PAD.left : at, along ? at : PAD.top);
    g.lineTo(along ? PAD.left + this.w : at, along ? at : PAD.top + this.h);
    g.stroke();
    g.textAlign = along ? "right" : "left";
    const above = at > PAD.top + 16 ? at - 4 : at + 13;
    if (level.label) g.fillText(level.label, along ? PAD.left + this.w - 4 : at + 4, along ? above : PAD.top + 12);
    g.restore();
  }

  line(g, line) {
    g.strokeStyle = g.fillStyle = colour(line.role);
    if (line.to) {
      g.save();
      g.globalAlpha = 0.22;
      g.beginPath();
      line.x.forEach((v, i) => g[i ? "lineTo" : "moveTo"](this.x(v), this.y(line.y[i])));
      for (let i = line.x.length - 1; i >= 0; i--) g.lineTo(this.x(line.x[i]), this.y(line.to[i]));
      g.fill();
      g.restore();
      return;
    }
    if (line.dots) {
      for (let i = 0; i < line.x.length; i++) g.fillRect(this.x(line.x[i]) - 0.7, this.y(line.y[i]) - 0.7, 1.4, 1.4);
      return;
    }
    if (line.marks) {
      for (let i = 0; i < line.x.length; i++) {
        g.beginPath();
        g.arc(this.x(line.x[i]), this.y(line.y[i]), 4, 0, 7);
        g.fill();
      }
      return;
    }
    g.save();
    g.lineWidth = line.wide ? 2.4 : 1.3;
    g.setLineDash(line.dash ? [6, 4] : []);
    g.lineJoin = "round";
    g.beginPath();
    let begun = false;
    for (let i = 0; i < line.x.length; i++) {
      const px = this.x(line.x[i]), py = this.y(line.y[i]);
      if (!Number.isFinite(px + py)) begun = false;
      else if (begun) {
        if (line.steps) g.lineTo(px, this.y(line.y[i - 1]));
        g.lineTo(px, py);
      } else {
        g.moveTo(px, py);
        begun = true;
      }
    }
    g.stroke();
    g.restore();
  }

  overlay() {
    const [g] = this.surface(this.over);
    if (this.brush) {
      const a = this.x(this.brush[0]), b = this.x(this.brush[1]);
      g.fillStyle = colour("back");
      g.globalAlpha = 0.62;
      g.fillRect(PAD.left, PAD.top, Math.max(a - PAD.left, 0), this.h);
      g.fillRect(b, PAD.top, Math.max(PAD.left + this.w - b, 0), this.h);
      g.globalAlpha = 1;
      g.strokeStyle = colour("accent");
      g.lineWidth = 2;
      g.strokeRect(a, PAD.top, b - a, this.h);
    }
    if (this.drag?.kind === "zoom") {
      const { from, to } = this.drag;
      g.strokeStyle = colour("accent");
      g.setLineDash([4, 3]);
      g.strokeRect(from.px, from.py, to.px - from.px, to.py - from.py);
      g.setLineDash([]);
    }
    const shared = cursor && cursor.label === this.part.x.label && cursor.unit === this.part.x.unit;
    this.reading.textContent = "";
    if (!shared || cursor.x < this.shown[0] || cursor.x > this.shown[1]) return;
    const px = Math.round(this.x(cursor.x)) + 0.5;
    g.strokeStyle = colour("quiet");
    g.lineWidth = 1;
    g.beginPath();
    g.moveTo(px, PAD.top);
    g.lineTo(px, PAD.top + this.h);
    if (cursor.chart === this && cursor.y !== null) {
      const py = Math.round(this.y(cursor.y)) + 0.5;
      g.moveTo(PAD.left, py);
      g.lineTo(PAD.left + this.w, py);
    }
    g.stroke();
    this.reading.textContent = this.values();
  }

  values() {
    const show = (v, log) => String(Number((log ? Math.pow(10, v) : v).toPrecision(4))).replace("-", "\u2212");
    const { x, y, log } = this.part;
    const words = [`${show(cursor.x, log?.includes("x"))} ${x.unit}`];
    if (x.label === "time" || log?.includes("x")) {
      const line = this.lines.find((one) => !one.to && !one.marks);
      let low = 0, high = (line?.x.length ?? 0) - 1;
      while (low < high) {
        const middle = (low + high) >> 1;
        if (line.x[middle] < cursor.x) low = middle + 1;
        else high = middle;
      }
      if (line && high >= 0) words.push(`${show(line.y[high], log?.includes("y"))} ${y.unit}`);
    } else if (cursor.y !== null && cursor.chart === this) words.push(`${show(cursor.y)} ${y.unit}`);
    return words.join(", ");
  }

  point(at) {
    const { label, unit } = this.part.x;
    cursor = at && { chart: this, label, unit, x: at.x, y: at.y };
    for (const one of charts) if (one.w) one.overlay();
  }

  press(event) {
    if (event.button) return;
    this.over.setPointerCapture(event.pointerId);
    const at = this.at(event);
    if (!this.brush) {
      this.drag = { kind: "zoom", from: at, to: at };
      return;
    }
    const [a, b] = this.brush.map((v) => this.x(v));
    const kind = Math.abs(at.px - a) < NEAR ? "left" : Math.abs(at.px - b) < NEAR ? "right"
      : at.px > a && at.px < b && b - a < 0.95 * this.w ? "both" : "new";
    this.drag = { kind, from: at, before: [...this.brush] };
    this.dragging = true;
  }

  move(event) {
    const at = this.at(event);
    if (this.drag?.kind === "zoom") this.drag.to = at;
    else if (this.drag) this.pull(at, true);
    this.point(at);
  }

  pull(at, live) {
    const { kind, from, before } = this.drag, [low, high] = this.whole;
    let [a, b] = before;
    if (kind === "left") a = at.x;
    else if (kind === "right") b = at.x;
    else if (kind === "new") [a, b] = [from.x, at.x];
    else {
      const by = Math.min(Math.max(at.x - from.x, low - a), high - b);
      [a, b] = [a + by, b + by];
    }
    [a, b] = [Math.min(a, b), Math.max(a, b)];
    const digits = Math.max(0, 3 - Math.floor(Math.log10(high - low)));
    const found = [Number(a.toFixed(digits)), Number(b.toFixed(digits))];
    if (!(found[1] - found[0] > 0.005 * (high - low))) return;
    this.brush = found;
    this.sendBrush(live);
  }

  sendBrush(live) {
    const { step, name } = this.part.brush;
    this.send({ do: "set", step, values: { [name]: this.brush }, live });
  }

  release(event) {
    const drag = this.drag;
    this.drag = null;
    this.dragging = false;
    if (!drag) return;
    if (drag.kind !== "zoom") {
      this.sendBrush(false);
      return;
    }
    const to = this.at(event), { from } = drag;
    if (Math.abs(to.px - from.px) > 8 && Math.abs(to.py - from.py) > 8) {
      const sorted = (a, b) => (a < b ? [a, b] : [b, a]);
      this.zoom([...sorted(from.x, to.x), ...sorted(from.y, to.y)]);
    } else this.overlay();
  }

  zoom(box) {
    this.view = box;
    const { log } = this.part;
    const power = (v, axis) => (log?.includes(axis) ? Math.pow(10, v) : v);
    const sent = box && box.map((v, i) => power(v, i < 2 ? "x" : "y"));
    this.send({ do: "zoom", chart: this.part.id, box: sent });
    this.draw();
  }

  key(event) {
    const [x0, x1, y0, y1] = this.shown;
    const inside = cursor?.chart === this ? cursor.x : (x0 + x1) / 2;
    if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
      const by = ((event.key === "ArrowLeft" ? -1 : 1) * (x1 - x0)) / (event.shiftKey ? 20 : 200);
      this.point({ x: Math.min(Math.max(inside + by, x0), x1), y: null });
    } else if (event.key === "+" || event.key === "-") {
      const half = ((x1 - x0) / 2) * (event.key === "+" ? 0.5 : 2);
      const a = Math.max(inside - half, this.whole[0]), b = Math.min(inside + half, this.whole[1]);
      this.zoom(a <= this.whole[0] && b >= this.whole[1] ? null : [a, b, y0, y1]);
    } else if (event.key === "0") this.zoom(null);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  toggleTable(button) {
    const table = this.element.querySelector(".scroll");
    table.hidden = !table.hidden;
    button.setAttribute("aria-expanded", String(!table.hidden));
    button.textContent = table.hidden ? "Show as table" : "Hide table";
    if (!table.hidden) this.fill(table);
  }

  fill(place) {
    const { x, y, log } = this.part;
    const show = (v, axis) => String(Number((log?.includes(axis) ? Math.pow(10, v) : v).toPrecision(5)));
    const table = document.createElement("table");
    const head = table.createTHead().insertRow();
    for (const title of ["line", `${x.label} ${x.unit}`, `${y.label} ${y.unit}`]) {
      const cell = document.createElement("th");
      cell.textContent = title;
      head.append(cell);
    }
    const body = table.createTBody();
    for (const line of this.lines) {
      const every = Math.max(1, Math.ceil(line.x.length / 100));
      for (let i = 0; i < line.x.length; i += every) {
        if (Number.isNaN(line.x[i])) continue;
        const row = body.insertRow();
        for (const text of [line.name, show(line.x[i], "x"), show(line.y[i], "y")]) row.insertCell().textContent = text;
      }
    }
    place.replaceChildren(table);
  }
}

export function redraw() {
  for (const one of charts) {
    one.names();
    one.draw();
  }
}
