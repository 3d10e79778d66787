"use strict";
// Curves over time with one cursor for all: makePlots(where, panels, seek) returns { show(time), toggle(run, on) }.
const makePlots = (where, panels, duration, seek) => {
  const MARGIN = { left: 46, right: 8, top: 6, bottom: 16 };
  const decode = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const hidden = new Set();
  const element = (parent, name, text, kind) => {
    const made = document.createElement(name);
    if (text) made.textContent = text;
    if (kind) made.className = kind;
    parent.append(made);
    return made;
  };
  const power = (k) => "10" + [...String(k)].map((c) => c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]).join("");
  const short = (value) => {
    const size = Math.abs(value);
    if (!size || (size >= 1e-3 && size < 1e5)) return String(Number(value.toPrecision(3)));
    const [digits, k] = value.toExponential(1).split("e");
    return (digits === "1.0" ? "" : digits.replace(".0", "") + "·") + power(Number(k));
  };

  // The index of the last sample that is not after a time.
  const before = (times, time) => {
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= time + 1e-6) low = middle; else high = middle - 1;
    }
    return low;
  };

  const range = (panel) => {
    let low = Infinity, high = -Infinity;
    const positive = [];
    for (const curve of panel.curves) for (const value of curve.values) {
      if (!Number.isFinite(value)) continue;
      if (panel.log) { if (value > 0) positive.push(value); continue; }
      if (value < low) low = value;
      if (value > high) high = value;
    }
    if (panel.log) {
      if (!positive.length) return [1e-3, 1];
      positive.sort((a, b) => a - b);
      const top = positive[positive.length - 1];
      const least = Math.max(positive[Math.floor(positive.length / 100)], top * 1e-9);
      return [least / 1.5, top * 1.6];
    }
    if (panel.low !== null) low = Math.min(low, panel.low);
    if (panel.high !== null) high = Math.max(high, panel.high);
    if (!(high > low)) { low -= 0.5; high += 0.5; }
    const room = 0.06 * (high - low);
    return [low - room, high + room];
  };

  const ticks = (panel) => {
    const [low, high] = panel.range, found = [];
    if (panel.log) {
      const first = Math.ceil(Math.log10(low)), last = Math.floor(Math.log10(high));
      const step = Math.max(1, Math.ceil((last - first) / 4));
      for (let k = first; k <= last; k += step) found.push(10 ** k);
      if (found.length < 2) for (const base of [1, 2, 5]) {
        for (let k = first - 1; k <= last + 1; k++) {
          const value = base * 10 ** k;
          if (value >= low && value <= high && !found.includes(value)) found.push(value);
        }
      }
      return found;
    }
    const rough = (high - low) / 4, decade = 10 ** Math.floor(Math.log10(rough));
    const step = decade * [1, 2, 5, 10].find((s) => s * decade >= rough);
    for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
    return found;
  };

  const spacing = () => {
    const rough = duration / 5, decade = 10 ** Math.floor(Math.log10(rough));
    return decade * [1, 2, 5, 10].find((s) => s * decade >= rough);
  };

  const build = (panel) => {
    for (const curve of panel.curves) {
      curve.time = decode(curve.time);
      curve.values = decode(curve.values);
      curve.has = (kind) => curve.kinds.includes(kind);
    }
    panel.range = range(panel);
    const box = element(where, "section", "", "panel"), title = element(box, "h2", panel.title);
    element(title, "small", panel.unit);
    panel.output = element(title, "output");
    if (panel.note || panel.bands.length) {
      const note = element(box, "p");
      if (panel.note) element(note, "span", panel.note);
      for (const band of panel.bands) {
        const span = element(note, "span"), mark = element(span, "i");
        mark.style.background = band.color + "33";
        span.append(band.words);
      }
    }
    if (panel.legend) {
      const key = element(box, "div", "", "key");
      for (const curve of panel.curves) {
        if (!curve.label) continue;
        const entry = element(key, "span"), mark = element(entry, "i", "", curve.has("dashed") ? "dashed" : "");
        mark.style.color = curve.color;
        entry.append(curve.label);
      }
    }
    panel.canvas = element(box, "canvas");
    panel.canvas.setAttribute("role", "img");
    panel.canvas.setAttribute("aria-label", panel.title + (panel.note ? ", " + panel.note : ""));
    panel.picture = document.createElement("canvas");
    listen(panel);
  };

  const frame = (panel) => {
    const width = panel.canvas.clientWidth, height = panel.canvas.clientHeight;
    const [low, high] = panel.range;
    const level = panel.log ? (v) => Math.log(Math.max(v, 1e-30)) : (v) => v;
    const a = level(low), b = level(high);
    const w = Math.max(width - MARGIN.left - MARGIN.right, 1), h = Math.max(height - MARGIN.top - MARGIN.bottom, 1);
    return {
      width, height, w, h,
      x: (time) => MARGIN.left + w * time / duration,
      y: (value) => MARGIN.top + h * (b - level(value)) / (b - a),
      time: (x) => Math.min(Math.max((x - MARGIN.left) / w, 0), 1) * duration,
    };
  };

  // Everything but the cursor, drawn once a size.
  const paint = (panel) => {
    const at = panel.frame = frame(panel), ratio = devicePixelRatio || 1;
    for (const canvas of [panel.canvas, panel.picture]) {
      canvas.width = Math.round(at.width * ratio);
      canvas.height = Math.round(at.height * ratio);
    }
    const draw = panel.picture.getContext("2d");
    draw.scale(ratio, ratio);
    draw.font = "10px system-ui, sans-serif";
    const inside = { x: MARGIN.left, y: MARGIN.top, w: at.w, h: at.h };
    for (const band of panel.bands) {
      draw.fillStyle = band.color + "33";
      for (const [start, end] of band.spans) {
        draw.fillRect(at.x(start), inside.y, Math.max(at.x(end) - at.x(start), 1), inside.h);
      }
    }
    draw.lineWidth = 1;
    draw.textBaseline = "middle";
    draw.textAlign = "right";
    for (const value of ticks(panel)) {
      const y = Math.round(at.y(value)) + 0.5;
      draw.strokeStyle = "#e6eaee";
      draw.beginPath(); draw.moveTo(inside.x, y); draw.lineTo(inside.x + inside.w, y); draw.stroke();
      draw.fillStyle = "#566472";
      draw.fillText(short(value), inside.x - 5, y);
    }
    draw.textBaseline = "top";
    draw.textAlign = "center";
    const step = spacing();
    for (let k = 0; k * step <= duration * 1.0001; k++) {
      const x = at.x(k * step);
      draw.fillStyle = "#566472";
      draw.fillText(short(k * step) + (k ? "" : " s"), Math.min(x, at.width - 10), at.height - MARGIN.bottom + 4);
    }
    draw.save();
    draw.beginPath();
    draw.rect(inside.x, inside.y - 1, inside.w, inside.h + 2);
    draw.clip();
    for (const limit of panel.limits) {
      const y = at.y(limit);
      draw.strokeStyle = "#7a1f1f";
      draw.beginPath(); draw.moveTo(inside.x, y); draw.lineTo(inside.x + inside.w, y); draw.stroke();
    }
    const shown = panel.curves.filter((curve) => !hidden.has(curve.run));
    for (const kind of ["faint", "", "strong"]) for (const curve of shown) {
      if ((curve.has("faint") ? "faint" : curve.has("strong") ? "strong" : "") === kind) trace(draw, at, curve);
    }
    draw.restore();
  };

  const trace = (draw, at, curve) => {
    const { time, values } = curve;
    draw.strokeStyle = draw.fillStyle = curve.color;
    draw.globalAlpha = curve.has("faint") ? 0.35 : curve.has("dots") ? 0.7 : 1;
    draw.lineWidth = curve.has("strong") ? 2.2 : 1.4;
    draw.setLineDash(curve.has("dashed") ? [5, 3] : []);
    if (curve.has("dots")) {
      for (let k = 0; k < time.length; k++) draw.fillRect(at.x(time[k]) - 0.8, at.y(values[k]) - 0.8, 1.6, 1.6);
    } else {
      draw.beginPath();
      for (let k = 0; k < time.length; k++) {
        const x = at.x(time[k]), y = at.y(values[k]);
        if (k && curve.has("steps")) draw.lineTo(x, at.y(values[k - 1]));
        if (k) draw.lineTo(x, y); else draw.moveTo(x, y);
      }
      if (curve.has("steps") && time.length) draw.lineTo(at.x(duration), at.y(values[time.length - 1]));
      draw.stroke();
    }
    draw.globalAlpha = 1;
    draw.setLineDash([]);
  };

  // The picture, the cursor over it, and the value of the curve that is looked at.
  let now = 0;
  const point = (panel) => {
    const at = panel.frame;
    if (!at || !at.width) return;
    const draw = panel.canvas.getContext("2d"), ratio = devicePixelRatio || 1;
    draw.setTransform(1, 0, 0, 1, 0, 0);
    draw.clearRect(0, 0, panel.canvas.width, panel.canvas.height);
    draw.drawImage(panel.picture, 0, 0);
    draw.scale(ratio, ratio);
    const x = Math.round(at.x(now)) + 0.5;
    draw.strokeStyle = "#1b2733";
    draw.lineWidth = 1;
    draw.beginPath(); draw.moveTo(x, MARGIN.top - 4); draw.lineTo(x, at.height - MARGIN.bottom); draw.stroke();
    draw.fillStyle = "#1b2733";
    draw.beginPath(); draw.moveTo(x - 4, 0); draw.lineTo(x + 4, 0); draw.lineTo(x, 5); draw.fill();
    let chosen = null;
    for (const curve of panel.curves) {
      if (hidden.has(curve.run) || !curve.time.length) continue;
      const value = curve.values[before(curve.time, now)], y = at.y(value);
      if (!curve.has("faint")) {
        draw.fillStyle = curve.color;
        draw.beginPath(); draw.arc(x, Math.min(Math.max(y, MARGIN.top), at.height - MARGIN.bottom), 2.6, 0, 7); draw.fill();
      }
      // where nobody points: the curve of the largest value, in size
      const rank = panel.pointer === undefined ? (curve.has("faint") ? -1 : curve.has("strong") ? 1e30 : Math.abs(value))
        : -Math.abs(y - panel.pointer);
      if (!chosen || rank > chosen.rank) chosen = { rank, curve, value };
    }
    if (chosen) {
      const several = panel.curves.filter((curve) => curve.label).length > 1;
      panel.output.textContent = (several && chosen.curve.label ? chosen.curve.label + "  " : "") + short(chosen.value)
        + (panel.unit && !panel.unit.startsWith("of ") && !panel.unit.startsWith("frac") ? " " + panel.unit : "");
      panel.output.style.color = chosen.curve.color;
    } else panel.output.textContent = "";
  };

  const listen = (panel) => {
    const canvas = panel.canvas;
    const place = (event) => {
      const box = canvas.getBoundingClientRect();
      panel.pointer = event.clientY - box.top;
      return panel.frame.time(event.clientX - box.left);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      seek(place(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      const time = place(event);
      if (canvas.hasPointerCapture(event.pointerId)) seek(time); else point(panel);
    });
    canvas.addEventListener("pointerleave", () => { panel.pointer = undefined; point(panel); });
  };

  for (const panel of panels) build(panel);
  const repaint = () => { for (const panel of panels) { paint(panel); point(panel); } };
  new ResizeObserver(repaint).observe(where);
  repaint();
  return {
    show: (time) => { if (time !== now) { now = time; panels.forEach(point); } },
    toggle: (run, on) => {
      if (on) hidden.delete(run); else hidden.add(run);
      repaint();
    },
  };
};
