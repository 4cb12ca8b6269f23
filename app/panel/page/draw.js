// Draws the network on its canvas: positions of the nodes, their motion, and hit-testing.
const families = ['spring', 'pluck', 'bow', 'contact'];
const css = name => getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim();

function mixed(a, b, share) {
  const parse = c => [1, 3, 5].map(i => parseInt(c.slice(i, i + 2), 16));
  const from = parse(a), to = parse(b);
  return `rgb(${from.map((v, i) => Math.round(v + (to[i] - v) * share)).join(' ')})`;
}

// Force-directed layout for models without positions: links attract, all nodes repel;
// deterministic.
function forceLayout(net) {
  const n = net.x.length;
  const golden = 2.399963;
  const x = new Float64Array(n), y = new Float64Array(n);
  for (let i = 0; i < n; i++) {
    const r = Math.sqrt(i + 0.5);
    x[i] = r * Math.cos(golden * i); y[i] = r * Math.sin(golden * i);
  }
  const steps = n > 600 ? 40 : n > 200 ? 120 : 300;
  for (let step = 0; step < steps; step++) {
    const heat = 1.5 * (1 - step / steps) + 0.02;
    const dx = new Float64Array(n), dy = new Float64Array(n);
    for (let i = 0; i < n; i++) for (let j = i + 1; j < n; j++) {
      const ex = x[i] - x[j], ey = y[i] - y[j], d2 = ex * ex + ey * ey + 0.01;
      dx[i] += ex / d2; dy[i] += ey / d2; dx[j] -= ex / d2; dy[j] -= ey / d2;
    }
    for (const [a, b] of net.links) {
      const ex = x[a] - x[b], ey = y[a] - y[b], d = Math.hypot(ex, ey);
      dx[a] -= ex * d * 0.5; dy[a] -= ey * d * 0.5; dx[b] += ex * d * 0.5; dy[b] += ey * d * 0.5;
    }
    for (let i = 0; i < n; i++) {
      dx[i] -= 0.02 * x[i]; dy[i] -= 0.02 * y[i];
      const d = Math.hypot(dx[i], dy[i]) || 1, go = Math.min(d, heat);
      x[i] += dx[i] / d * go; y[i] += dy[i] / d * go;
    }
  }
  net.x = [...x]; net.y = [...y];
  net.plane = true;
}

export class NetworkView {
  constructor(canvas) {
    this.canvas = canvas;
    this.net = null;
    this.positions = null;
    this.peak = 1e-6;
    this.mode = null;
    this.chosen = -1;  // The played target: an input, or a node (numbered after the inputs).
    this.pull = null;  // {from, to}: the gesture in progress.
    new ResizeObserver(() => this.fit()).observe(canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.colours());
    this.colours();
  }

  colours() {
    this.colour = {};
    for (const name of ['card', 'ink', 'quiet', 'line', 'mass', 'held', 'up', 'down', 'accent', ...families])
      this.colour[name] = css(name);
    const tint = Math.max(...[1, 3, 5].map(i => parseInt(this.colour.spring.slice(i, i + 2), 16))) > 0;
    this.tints = [];
    for (let i = -6; i <= 6; i++)
      this.tints.push(tint ? mixed(this.colour.spring, i < 0 ? this.colour.down : this.colour.up, Math.abs(i) / 6) : this.colour.spring);
  }

  setNetwork(net) {
    if (!net.drawn && net.x.length <= 1500) forceLayout(net);
    const last = { x: 0, y: 0 };
    for (let i = 0; i < net.x.length; i++) {  // Unconnected nodes are drawn at the side.
      if (net.x[i] === null) { net.x[i] = last.x - 1; net.y[i] = last.y; }
    }
    this.net = net;
    this.positions = Float32Array.from(net.start);
    this.peak = 1e-6;
    this.mode = null;
    this.trail = [];
    this.sx = new Float32Array(net.x.length);
    this.sy = new Float32Array(net.x.length);
    this.fit();
  }

  fit() {
    const ratio = devicePixelRatio || 1, box = this.canvas.getBoundingClientRect();
    this.width = box.width; this.height = box.height;
    this.canvas.width = Math.round(box.width * ratio);
    this.canvas.height = Math.round(box.height * ratio);
    this.context = this.canvas.getContext('2d');
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const net = this.net;
    if (!net || !net.x.length) return;
    // A planar network is seen from above at an angle, so that motion has room.
    const turn = net.plane ? 0.38 : 0, tilt = net.plane ? 0.58 : 1;
    const c = Math.cos(turn), s = Math.sin(turn);
    let left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
    this.flat = net.x.map((x, i) => {
      const y = net.y[i], u = x * c - y * s, v = (x * s + y * c) * tilt;
      left = Math.min(left, u); right = Math.max(right, u); top = Math.min(top, v); bottom = Math.max(bottom, v);
      return [u, v];
    });
    const margin = Math.min(56, this.width * 0.08), wide = right - left || 1, high = bottom - top || 1;
    const room = this.height - 2 * margin - 30;
    this.reach = Math.min(this.height, this.width) * (net.plane ? 0.13 : 0.24);
    let k = (this.width - 2 * margin) / wide, kv = k;
    if (net.plane) k = kv = Math.min(k, room / high);
    // Rows need room to vibrate.
    else kv = Math.min(Math.max(k, 1.3 * this.reach), room * 0.6 / high);
    if (!net.plane && net.x.length < 3) k = kv = Math.min(k, 120);
    this.flat = this.flat.map(([u, v]) =>
      [this.width / 2 + (u - (left + right) / 2) * k, this.height / 2 + (v - (top + bottom) / 2) * kv]);
  }

  // Converts positions in model units to heights; the recent maximum sets the scale.
  move(positions) {
    this.positions = positions;
    const start = this.net.start;
    let most = 0;
    for (let i = 0; i < positions.length; i++)
      if (this.net.kinds[i] !== 'h') most = Math.max(most, Math.abs(positions[i] - start[i]));
    this.peak = Math.max(most, this.peak * 0.992, 1e-6);
  }

  heights() {
    const net = this.net, n = net.dots, up = new Float32Array(net.x.length);
    if (this.mode) {
      // Shows the mode's shape, slowed down to one period in 1.5 seconds.
      const swing = Math.sin(performance.now() / 240);
      for (let i = 0; i < n; i++) up[i] = this.mode[i] * swing;
    } else {
      for (let i = 0; i < n; i++) up[i] = (this.positions[i] - net.start[i]) / this.peak;
    }
    // A driven input may be far away.
    for (let i = 0; i < up.length; i++) up[i] = Math.max(-1.6, Math.min(1.6, up[i]));
    return up;
  }

  draw() {
    const net = this.net, c = this.context;
    if (!c) return;
    c.clearRect(0, 0, this.width, this.height);
    if (!net || !this.flat) return;
    const up = this.heights(), { sx, sy } = this;
    for (let i = 0; i < sx.length; i++) { sx[i] = this.flat[i][0]; sy[i] = this.flat[i][1] - up[i] * this.reach; }
    this.afterglow(c);
    this.links(c, up);
    this.nodes(c);
    this.handles(c);
  }

  // Draws recent positions as an afterglow, like the blur of a sounding string.
  afterglow(c) {
    if (this.net.dots > 700 || this.mode) { this.trail.length = 0; return; }
    c.strokeStyle = this.colour.up; c.lineWidth = 1;
    this.trail.forEach((old, age) => {
      c.globalAlpha = 0.05 + 0.13 * age / this.trail.length;
      c.beginPath();
      for (const [a, b] of this.net.links) {
        if (a < this.net.dots || b < this.net.dots) { c.moveTo(this.sx[a], old[a]); c.lineTo(this.sx[b], old[b]); }
      }
      c.stroke();
    });
    c.globalAlpha = 1;
    this.trail.push(Float32Array.from(this.sy));
    if (this.trail.length > 6) this.trail.shift();
  }

  touches(link) {
    const [a, b, , zone, reach] = link, at = i => i < this.net.dots ? this.positions[i] : this.net.start[i];
    const d = at(a) - at(b);
    return zone === 1 ? -reach - d <= 0 : Math.abs(d) - reach <= 0;
  }

  links(c, up) {
    const { net, sx, sy } = this, thin = net.links.length > 800 ? 1 : 1.6;
    const bins = this.tints.map(() => new Path2D());
    const others = {};
    for (const link of net.links) {
      const [a, b, law] = link, family = net.laws[law][1];
      let path;
      if (family === 'spring') {
        path = bins[Math.max(0, Math.min(12, Math.round(6 + 3.4 * (up[a] + up[b]))))];
      } else {
        const key = family + (link.length > 3 && this.touches(link) ? '+' : '');
        path = others[key] ??= new Path2D();
      }
      path.moveTo(sx[a], sy[a]); path.lineTo(sx[b], sy[b]);
    }
    bins.forEach((path, i) => { c.strokeStyle = this.tints[i]; c.lineWidth = thin + Math.abs(i - 6) * 0.12; c.stroke(path); });
    for (const key in others) {
      const lit = key.endsWith('+');
      c.strokeStyle = this.colour[lit ? key.slice(0, -1) : key];
      c.globalAlpha = lit || key === 'bow' ? 1 : 0.5;
      c.lineWidth = lit ? 4 : 1.5;
      c.setLineDash(lit || key === 'bow' ? [] : [4, 4]);
      if (lit) { c.shadowColor = c.strokeStyle; c.shadowBlur = 10; }
      c.stroke(others[key]);
      c.shadowBlur = 0; c.globalAlpha = 1; c.setLineDash([]);
    }
  }

  nodes(c) {
    const { net, sx, sy } = this, n = net.x.length;
    const size = n > 1200 ? 1.1 : n > 300 ? 1.7 : n > 80 ? 2.4 : n > 20 ? 3.4 : 6;
    const moving = new Path2D(), still = new Path2D(), stems = new Path2D();
    for (let i = 0; i < n; i++) {
      const kind = net.kinds[i];
      if (kind === 'o') { stems.moveTo(sx[i], this.flat[i][1]); stems.lineTo(sx[i], sy[i]); }
      if (kind === 'g') still.rect(sx[i] - size, sy[i] - size, 2 * size, 2 * size);
      else if (kind !== 'h' && kind !== 'w') { moving.moveTo(sx[i] + size, sy[i]); moving.arc(sx[i], sy[i], size, 0, 7); }
    }
    c.strokeStyle = this.colour.up; c.lineWidth = 3; c.stroke(stems);
    c.fillStyle = this.colour.held; c.fill(still);
    c.globalAlpha = n > 300 ? 0.55 : 1;
    c.fillStyle = this.colour.mass; c.fill(moving);
    c.globalAlpha = 1;
  }

  handles(c) {
    const { net, sx, sy } = this;
    net.inputs.forEach(([number, node], i) => {
      if (node === null) return;
      const is = i === this.chosen;
      c.beginPath(); c.arc(sx[node], sy[node], is ? 10 : 7, 0, 7);
      c.lineWidth = is ? 3 : 2; c.strokeStyle = this.colour.accent; c.fillStyle = this.colour.card;
      c.globalAlpha = 0.85; c.fill(); c.globalAlpha = 1; c.stroke();
      c.fillStyle = this.colour.accent; c.font = '600 10px system-ui, sans-serif';
      c.textAlign = 'center'; c.textBaseline = 'middle';
      c.fillText(number, sx[node], sy[node] + 0.5);
    });
    const node = this.chosen - net.inputs.length;
    if (node >= 0 && node < net.x.length) {
      c.beginPath(); c.arc(sx[node], sy[node], 9, 0, 7);
      c.lineWidth = 3; c.strokeStyle = this.colour.accent; c.stroke();
    }
    if (this.pull) {
      c.beginPath(); c.moveTo(this.pull.from.x, this.pull.from.y); c.lineTo(this.pull.to.x, this.pull.to.y);
      c.strokeStyle = this.colour.accent; c.lineWidth = 2; c.setLineDash([2, 5]); c.stroke(); c.setLineDash([]);
    }
  }

  nodeOf(chosen) {
    const inputs = this.net.inputs;
    return chosen < inputs.length ? inputs[chosen][1] : chosen - inputs.length;
  }
  isMass(node) { return node < this.net.dots && this.net.kinds[node] === 'm' && this.net.names[node] !== ''; }

  // Returns the target at a point of the canvas: an input under the pointer, else the mass under
  // it, else the nearest input.
  targetAt(x, y) {
    if (!this.net) return -1;
    let best = -1, distance = 1e9;
    this.net.inputs.forEach(([, node], i) => {
      if (node === null) return;
      const d = Math.hypot(this.sx[node] - x, this.sy[node] - y);
      if (d < distance) { best = i; distance = d; }
    });
    const node = distance > 12 ? this.nearestNode(x, y) : -1;
    return node >= 0 && this.isMass(node) ? this.net.inputs.length + node : best;
  }

  nearestNode(x, y) {
    let best = -1, distance = 24;
    for (let i = 0; this.net && i < this.net.x.length; i++) {
      const d = Math.hypot(this.sx[i] - x, this.sy[i] - y);
      if (d < distance) { best = i; distance = d; }
    }
    return best;
  }
}

const note = hz => {
  const key = 69 + 12 * Math.log2(hz / 440), k = Math.round(key), cents = Math.round(100 * (key - k));
  return ['C', 'C♯', 'D', 'E♭', 'E', 'F', 'F♯', 'G', 'A♭', 'A', 'B♭', 'B'][((k % 12) + 12) % 12] +
    (Math.floor(k / 12) - 1) + (cents ? (cents > 0 ? ' +' : ' −') + Math.abs(cents) : '');
};
export const noteName = note;
export const hertz = hz => hz >= 1000 ? (hz / 1000).toFixed(2) + ' kHz' : hz.toFixed(hz < 100 ? 2 : 1) + ' Hz';

function prepared(canvas) {
  const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
  const c = canvas.getContext('2d');
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, width, height);
  return { c, width, height };
}

export function drawScope(canvas, heard) {
  const { c, width, height } = prepared(canvas);
  const shown = 1024;
  let from = 0, most = 1e-4;
  for (let i = 1; i < heard.length - shown; i++) if (heard[i - 1] < 0 && heard[i] >= 0) { from = i; break; }
  for (const s of heard) most = Math.max(most, Math.abs(s));
  c.strokeStyle = css('line'); c.beginPath(); c.moveTo(0, height / 2); c.lineTo(width, height / 2); c.stroke();
  c.strokeStyle = css('up'); c.lineWidth = 1.4; c.beginPath();
  for (let i = 0; i < shown; i++) c.lineTo(i / shown * width, height / 2 - heard[from + i] / most * height * 0.44);
  c.stroke();
}

// Returns the magnitude spectrum of the recent output, under a Hann window.
export function spectrumOf(heard) {
  const n = heard.length, re = new Float64Array(n), im = new Float64Array(n);
  for (let i = 0, j = 0; i < n; i++) {
    re[j] = heard[i] * (0.5 - 0.5 * Math.cos(2 * Math.PI * i / n));
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j |= bit;
  }
  for (let size = 2; size <= n; size *= 2) {
    const half = size / 2;
    for (let k = 0; k < half; k++) {
      const angle = -2 * Math.PI * k / size, c = Math.cos(angle), s = Math.sin(angle);
      for (let i = k; i < n; i += size) {
        const a = re[i + half] * c - im[i + half] * s, b = re[i + half] * s + im[i + half] * c;
        re[i + half] = re[i] - a; im[i + half] = im[i] - b; re[i] += a; im[i] += b;
      }
    }
  }
  return Float64Array.from({ length: n / 2 }, (_, i) => Math.hypot(re[i], im[i]) * 4 / n);
}

export function drawSpectrum(canvas, magnitudes, rate) {
  const { c, width, height } = prepared(canvas), bin = rate / 2 / magnitudes.length;
  const x = hz => Math.log(hz / 30) / Math.log(rate / 2 / 30) * width, floor = -100;
  c.font = '10px system-ui, sans-serif'; c.fillStyle = css('quiet'); c.strokeStyle = css('line'); c.lineWidth = 1;
  for (const hz of [100, 1000, 10000]) {
    c.beginPath(); c.moveTo(x(hz), 0); c.lineTo(x(hz), height - 12); c.stroke();
    c.fillText(hz < 1000 ? hz + ' Hz' : hz / 1000 + ' kHz', x(hz) + 3, height - 2);
  }
  c.strokeStyle = css('up'); c.fillStyle = css('proved'); c.lineWidth = 1.3; c.beginPath(); c.moveTo(0, height - 12);
  let sum = 0, best = 0;
  for (let i = 1; i < magnitudes.length; i++) {
    const db = 20 * Math.log10(magnitudes[i] + 1e-12), p = magnitudes[i] ** 2;
    c.lineTo(Math.max(0, x(i * bin)), (height - 12) * Math.min(1, Math.max(0, db / floor)));
    sum += p;
    if (magnitudes[i] > magnitudes[best]) best = i;
  }
  c.stroke(); c.lineTo(width, height - 12); c.closePath(); c.globalAlpha = 0.55; c.fill(); c.globalAlpha = 1;
  if (sum < 1e-10) return null;
  const [a, b, d] = [best - 1, best, best + 1].map(i => Math.log(magnitudes[i] + 1e-12));
  const shift = best > 1 && a - 2 * b + d !== 0 ? 0.5 * (a - d) / (a - 2 * b + d) : 0;
  return { peak: (best + shift) * bin };
}
