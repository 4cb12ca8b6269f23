// Draws the network on its canvas: positions of the nodes, their motion, and hit-testing.
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
  const spiral = turn => net.x.map((_, i) => Math.sqrt(i + 0.5) * turn(2.399963 * i)), x = spiral(Math.cos), y = spiral(Math.sin);
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
  Object.assign(net, { x, y, plane: true });
}

// Bodies are drawn by a word of their name, of their places or of the model. Lines go from
// -1 to 1 to the right and to the front; `still` ones do not move. `tall`: height by width.
const circle = Array.from({ length: 121 }, (_, i) => [Math.sin(i * Math.PI / 60), Math.cos(i * Math.PI / 60)]);
const inner = circle.map(([u, v]) => [u / 2, v / 2]);
const hull = depth => circle.slice(0, 61).map(([u, v]) => [v, depth * u]);
const slab = circle.map((_, i) => [1 - Math.abs(i % 120 / 30 - 2), i % 120 < 60 ? 1 : -1]);
const sides = width => circle.map(([u, v]) => [u, Math.sign(v) * Math.sqrt(1 - u ** 4) * width(u)]);
const neck = [[-1, -0.1], [-3, -0.07], [-3, 0.07], [-1, 0.1]], bridge = [[0.4, -0.25], [0.4, 0.25]];
const hole = side => [[0, 0.16 * side], [0.3, 0.36 * side]];
const forms = {
  bar: { words: /bar|tube|tongue|comb|reed/, tall: 0.05, lines: [slab] },
  violin: { words: /viol|cello|bassbox/, tall: 0.9, isBox: true,
    still: [neck, sides(u => 0.74 + 0.12 * u - (Math.abs(u + 0.05) < 0.28 ? 0.2 : 0)), bridge, hole(1), hole(-1)] },
  guitar: { words: /guitar|oud|sitar|bass/, tall: 0.8, isBox: true,
    still: [neck, sides(u => 0.86 + 0.14 * u - 0.2 * Math.cos(3 * u + 0.4)), bridge, circle.map(([u, v]) => [0.17 * u - 0.15, 0.2 * v])] },
  board: { words: /box|board|body/, tall: 0.8, isBox: true, still: [sides(() => 0.9), bridge] },
  bowl: { words: /bowl|glass|cup/, tall: 0.42, isRing: true, still: [hull(2.4)], lines: [circle] },
  bell: { words: /bell/, tall: 0.42, isRing: true, still: [hull(-4)], lines: [circle] },
  disc: { words: /skin|head|drum|pan|gong/, tall: 0.42, still: [hull(2)], lines: [circle, inner] },
  sheet: { words: /sheet|plate/, tall: 0.4, lines: [slab] },
};
const formOf = (...names) => names.map(name => Object.values(forms).find(form => form.words.test(name.toLowerCase()))).find(Boolean);

const spots = {
  left: [-0.65, -0.2], right: [0.65, -0.2], centre: [0, 0], half: [0, 0.5], edge: [0, 0.95], rim: [0, 1],
  tip: [-0.97, 0], cap: [-0.97, 0], bridge: [0.4, 0], bass: [0.4, 0.4], treble: [0.4, -0.4],
};

// Adds the lines of modal strings and the figures of bodies. `rules` says how the modes, which are
// not drawn, move the nodes.
function addBodies(net, model) {
  net.rules = []; net.figures = []; net.hidden = new Set();
  // The box that all voices sound through, or else that of the model, does not move.
  const [box, boxName] = [...model.through, model.name].map(name => [formOf(name), name]).find(([form]) => form?.isBox) ?? [];
  if (box && !net.plane && net.bodies.every(body => body.strings) && (boxName !== model.name || box !== forms.board))
    net.figures.push(net.box = { form: box, nodes: [], spots: [], names: [], name: boxName === model.name ? '' : boxName.replace('.mdl', '') });
  // A string is played near its bridge. Its ends are alike, so the played one is drawn there.
  const isTurned = net.box && /:0\.[0-4]/.test(net.names.join(' '));
  const along = u => net.wide * (isTurned ? 1 - u : u);
  const spring = net.laws.findIndex(law => law[1] === 'spring');
  const add = (x, y) => {
    net.kinds += 'w';
    net.y.push(y); net.start.push(0); net.names.push('');
    return net.x.push(x) - 1;
  };
  for (const { name, strings, places, modes } of net.bodies) {
    const own = [], taps = [];  // [node, number of the mode or name of the place]
    net.names.forEach((full, i) => {
      if (full.startsWith(name + ':')) (net.kinds[i] === 'o' ? own : taps).push([i, full.slice(name.length + 1)]);
    });
    own.forEach(([i]) => net.hidden.add(i));
    const by = weight => own.map(([i, k]) => [i, weight(k - 1)]);
    const sine = (u, k) => Math.sin(Math.PI * (Math.floor(k / strings) + 1) * u);
    for (let string = 0; string < strings && own.length; string++) for (let i = 0; i <= 48; i++) {
      const node = add(along(i / 48), net.y[own[string][0]]);
      net.rules.push([node, by(k => k % strings === string ? sine(i / 48, k) : 0)]);
      if (i) net.links.push([node - 1, node, spring]);
    }
    if (strings) {
      for (const [i, place] of taps) {
        const u = net.x[i] / net.wide, isBridge = place === 'bridge';
        net.x[i] = isBridge ? net.wide : along(u);
        net.rules.push([i, isBridge ? [] : by(k => sine(u, k) / strings)]);
      }
      continue;
    }
    const form = formOf(name, ...places, model.name) ?? forms.bar, figure = { form, nodes: [], spots: [], names: [] };
    let free = 0;
    const at = places.map(place => spots[place] ?? [0.4 * Math.ceil(free / 2) * (-1) ** free++ - 0.06, 0.6]);
    // A place between two named ones has a number from 0 to 1.
    const mixed = (values, place) => {
      const on = place * (values.length - 1), low = Math.min(Math.floor(on), values.length - 2);
      return values[low] + (on - low) * (values[low + 1] - values[low]);
    };
    for (const place of new Set([...places, ...taps.map(tap => tap[1])])) {
      const p = places.indexOf(place), value = p < 0 ? values => mixed(values, +place) : values => values[p];
      const node = taps.find(tap => tap[1] === place)?.[0] ?? add(0, 0), spot = [0, 1].map(side => value(at.map(a => a[side])));
      figure.nodes.push(node);
      figure.names.push(p < 0 ? '' : place);
      figure.spots.push(form.isRing ? spot.map(x => x / Math.hypot(...spot)) : spot);
      net.rules.push([node, by(k => value(modes[k]))]);
    }
    net.figures.push(figure);
  }
}

// Finds the nodes beside the instrument: what touches a place, such as a bow or a hammer, and the
// small parts that are not connected to it, such as a frame with its noise.
function partBodies(net) {
  const part = net.x.map((_, i) => i), root = i => part[i] === i ? i : part[i] = root(part[i]);
  const partners = net.x.map(() => []), ruled = new Set(net.rules.map(rule => rule[0]));
  for (const [a, b] of net.links) { part[root(a)] = root(b); partners[a].push(b); partners[b].push(a); }
  const isOf = i => ruled.has(i) || net.hidden.has(i), isFixed = i => 'hg'.includes(net.kinds[i]);
  net.hanging = [];  // [node, the node that it touches]
  const heavy = new Set(), parts = net.x.map(() => 0);
  net.x.forEach((_, i) => {
    const place = partners[i].find(isOf);
    if (place !== undefined && !isOf(i) && partners[i].every(other => isOf(other) || isFixed(other))) net.hanging.push([i, place]);
    if (isOf(i) || (!isFixed(i) && parts[root(i)]++)) heavy.add(root(i));
  });
  const hangs = new Set(net.hanging.map(pair => pair[0])), inFigure = new Set(net.figures.flatMap(figure => figure.nodes));
  const free = net.x.map((_, i) => i).filter(i => !hangs.has(i) && !inFigure.has(i) && !net.hidden.has(i));
  net.loose = net.plane || !heavy.size ? [] : free.filter(i => !heavy.has(root(i)));
  net.rows = free.filter(i => !net.loose.includes(i));
}

export class NetworkView {
  constructor(canvas) {
    this.canvas = canvas;
    this.chosen = -1;  // The played target: an input, or a node (numbered after the inputs).
    new ResizeObserver(() => this.fit()).observe(canvas);
  }

  setNetwork(net, model) {
    if (!net.drawn && net.x.length <= 1500) forceLayout(net);
    addBodies(net, model);
    partBodies(net);
    net.x = net.x.map(x => x ?? -1);  // Unconnected nodes are drawn at the side.
    net.y = net.y.map(y => y ?? 0);
    Object.assign(this, { net, mode: null, peak: 1e-6, trail: [], sx: new Float32Array(net.x.length), sy: new Float32Array(net.x.length) });
    this.move(Float32Array.from(net.start.slice(0, net.dots)));
    this.fit();
  }

  fit() {
    const { c, width, height } = prepared(this.canvas);
    Object.assign(this, { context: c, width, height });
    const net = this.net;
    if (!net || !net.x.length) return;
    const margin = Math.min(56, this.width * 0.08), room = this.height - 2 * margin - 30;
    this.flat = net.x.map(() => [0, 0]);
    this.way = net.x.map(() => [0, 0]);  // Displacement on the canvas of a height of 1.
    net.figures.forEach((figure, i) => this.fitFigure(figure, i, margin, room));
    this.fitRows(margin, room);
    const beside = {};
    net.hanging.forEach(([node, place]) => {
      const count = beside[place] = (beside[place] ?? -1) + 1, [x, y] = this.flat[place];
      this.flat[node] = [x + 32 * count, y + 60 - 10 * count];
      this.way[node] = [0, -12];
    });
    net.loose.forEach((node, i) => { this.flat[node] = [margin + 44 * i, 50]; this.way[node] = [0, -12]; });
  }

  fitRows(margin, room) {
    const net = this.net, { width, height } = this;
    // A planar network is seen from above at an angle, so that motion has room.
    const turn = net.plane ? 0.38 : 0, tilt = net.plane ? 0.58 : 1;
    const c = Math.cos(turn), s = Math.sin(turn);
    let left = 1e9, right = -1e9, top = 1e9, bottom = -1e9;
    const flat = net.rows.map(i => {
      const x = net.x[i], y = net.y[i], u = x * c - y * s, v = (x * s + y * c) * tilt;
      left = Math.min(left, u); right = Math.max(right, u); top = Math.min(top, v); bottom = Math.max(bottom, v);
      return [u, v];
    });
    const wide = right - left || 1, high = bottom - top || 1;
    const reach = Math.min(height, width) * (net.plane ? 0.13 : 0.24);
    // A string goes from the end of the neck to the bridge.
    const { x, y, rx } = net.box ?? {}, [middle, length] = rx ? [x - 1.3 * rx, 3.4 * rx] : [width / 2, width - 2 * margin];
    let k = length / wide, kv = k;
    if (net.plane) k = kv = Math.min(k, room / high);
    // Rows need room to vibrate.
    else kv = Math.min(Math.max(k, 1.3 * reach), (net.box ? 0.3 * net.box.ry : room * 0.6) / high);
    if (!net.plane && net.x.length < 3) k = kv = Math.min(k, 120);
    net.rows.forEach((node, i) => {
      const [u, v] = flat[i];
      this.flat[node] = [middle + (u - (left + right) / 2) * k, (y ?? height / (net.figures.length ? 6 : 2)) + (v - (top + bottom) / 2) * kv];
      this.way[node] = [0, -reach];
    });
  }

  // Puts a figure on its share of the width.
  fitFigure(figure, i, margin, room) {
    const { form } = figure, share = (this.width - 2 * margin) / this.net.figures.length, { isBox, tall } = form;
    const rx = Math.min(share * (isBox ? 0.25 : 0.42), room * (isBox ? 0.62 : form === forms.bar ? 2 : 0.58));
    Object.assign(figure, {
      rx, ry: rx * tall, x: margin + share * (i + 0.5) + (isBox ? rx : 0), lift: room * 0.16,
      y: this.height / 2 - 16 - (form === forms.bell ? -0.6 : form.still && !isBox ? 0.4 : 0) * rx,
    });
    figure.nodes.forEach((node, p) => {
      const [x, y] = this.flat[node] = this.onFigure(figure, figure.spots[p], 0), moved = this.onFigure(figure, figure.spots[p], 1);
      this.way[node] = [moved[0] - x, moved[1] - y];
    });
  }

  // Returns the point of a figure on the canvas. A ring moves outwards, anything else upwards.
  onFigure({ form, x, y, rx, ry, lift }, [u, v], up) {
    const grown = form.isRing ? 1 + 0.14 * up : 1, shear = form.lines?.[0] === slab ? -0.6 * ry * v : 0;
    return [x + u * rx * grown + shear, y + v * ry * grown - (form.isRing ? 0 : lift * up)];
  }

  // Converts positions in model units to heights; the recent maximum sets the scale.
  move(positions) {
    this.positions = positions;
    this.moved = this.displacements(positions.map((x, i) => x - this.net.start[i]));
    let most = 0;
    for (let i = 0; i < this.moved.length; i++) if (this.net.kinds[i] !== 'h') most = Math.max(most, Math.abs(this.moved[i]));
    this.peak = Math.max(most, this.peak * 0.992, 1e-6);
  }

  // Returns the displacement of each node. Modes move what the dots do not show.
  displacements(dots, isMode) {
    const { net } = this, up = new Float32Array(net.x.length);
    up.set(dots);
    for (const [node, terms] of net.rules)
      if (node >= net.dots || isMode || !terms.length) up[node] = terms.reduce((sum, [mode, weight]) => sum + weight * dots[mode], 0);
    for (const node of net.hidden) up[node] = 0;
    return up;
  }

  heights() {
    // Shows the mode's shape, slowed down to one period in 1.5 seconds.
    const factor = this.mode ? Math.sin(performance.now() / 240) / (Math.max(...this.mode.map(Math.abs)) || 1) : 1 / this.peak;
    // A driven input may be far away.
    return (this.mode ?? this.moved).map(x => Math.max(-1.6, Math.min(1.6, x * factor)));
  }

  // Shows the shape of a mode, or the motion.
  showMode(shape) { this.mode = shape && this.displacements(shape, true); }

  draw() {
    const net = this.net, c = this.context;
    if (!c) return;
    c.clearRect(0, 0, this.width, this.height);
    if (!net || !this.flat) return;
    const up = this.heights(), { sx, sy } = this;
    for (let i = 0; i < sx.length; i++) { sx[i] = this.flat[i][0] + up[i] * this.way[i][0]; sy[i] = this.flat[i][1] + up[i] * this.way[i][1]; }
    for (const figure of net.figures) this.figure(c, figure, up);
    this.afterglow(c);
    this.links(c, up);
    this.nodes(c);
    this.labels(c);
    this.handles(c);
  }

  // Draws a figure as its places move it.
  figure(c, figure, up) {
    const { lines = [], still = [] } = figure.form;
    c.lineWidth = 1.5;
    [...still, ...lines].forEach((line, i) => {
      const isStill = i < still.length;
      c.beginPath();
      for (const spot of line) {
        let all = isStill ? 1 : 0, sum = 0;
        figure.spots.forEach((place, p) => {
          const weight = isStill ? 0 : 1 / ((spot[0] - place[0]) ** 2 + (spot[1] - place[1]) ** 2 + 0.02);
          all += weight; sum += weight * up[figure.nodes[p]];
        });
        c.lineTo(...this.onFigure(figure, spot, sum / all));
      }
      c.strokeStyle = css(isStill ? 'held' : 'up'); c.fillStyle = css(isStill ? 'ground' : 'proved');
      c.globalAlpha = isStill ? 1 : 0.3;
      if (line.length > 10 && line !== inner) c.fill();
      c.globalAlpha = 1; c.stroke();
    });
  }

  // Names the places of figures, the box and the small parts.
  labels(c) {
    const { net, flat } = this, write = (text, x, y) => c.fillText(text, x, y);
    c.fillStyle = css('quiet'); c.font = '12px system-ui, sans-serif'; c.textAlign = 'center'; c.textBaseline = 'top';
    for (const { form, name = '', names, nodes, spots, x, y, rx, ry, lift } of net.figures) {
      write(name, x, y + ry + 20);
      names.forEach((place, p) => {
        const [u, v] = spots[p], [px, py] = flat[nodes[p]], out = form.isRing ? 0.28 : 0;
        write(place, px + out * (rx * u + 110 * (v > 0.5)), form === forms.bar ? y + ry + lift : py + out * ry * v + 14 - 16 * (out && v < 0));
      });
    }
    for (const node of net.loose) if (net.kinds[node] !== 'h') write(net.names[node], flat[node][0], flat[node][1] + 12);
  }

  // Draws recent positions as an afterglow, like the blur of a sounding string.
  afterglow(c) {
    if (this.net.dots > 700 || this.mode) { this.trail.length = 0; return; }
    c.strokeStyle = css('up'); c.lineWidth = 1;
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
    const bins = Array.from({ length: 13 }, () => new Path2D()), [spring, down, above] = ['spring', 'down', 'up'].map(css);
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
    bins.forEach((path, i) => { c.strokeStyle = mixed(spring, i < 6 ? down : above, Math.abs(i - 6) / 6); c.lineWidth = thin + Math.abs(i - 6) * 0.12; c.stroke(path); });
    for (const key in others) {
      const lit = key.endsWith('+');
      c.strokeStyle = css(lit ? key.slice(0, -1) : key);
      c.globalAlpha = lit || key === 'bow' ? 1 : 0.5;
      c.lineWidth = lit ? 4 : 1.5;
      c.setLineDash(lit || key === 'bow' ? [] : [4, 4]);
      if (lit) { c.shadowColor = c.strokeStyle; c.shadowBlur = 10; }
      c.stroke(others[key]);
      c.shadowBlur = 0; c.globalAlpha = 1; c.setLineDash([]);
    }
  }

  nodes(c) {
    const { net, sx, sy } = this, n = net.x.length - net.hidden.size;
    const size = n > 1200 ? 1.1 : n > 300 ? 1.7 : n > 80 ? 2.4 : n > 20 ? 3.4 : 6;
    const moving = new Path2D(), still = new Path2D();
    for (let i = 0; i < sx.length; i++) {
      const kind = net.kinds[i];
      if (kind === 'g') still.rect(sx[i] - size, sy[i] - size, 2 * size, 2 * size);
      else if (kind === 'm') { moving.moveTo(sx[i] + size, sy[i]); moving.arc(sx[i], sy[i], size, 0, 7); }
    }
    c.fillStyle = css('held'); c.fill(still);
    c.globalAlpha = n > 300 ? 0.55 : 1;
    c.fillStyle = css('mass'); c.fill(moving);
    c.globalAlpha = 1;
  }

  handles(c) {
    const { net, sx, sy, pull } = this, accent = css('accent');
    const ring = (node, radius, line, fill) => {
      c.beginPath(); c.arc(sx[node], sy[node], radius, 0, 7);
      c.fillStyle = css('card'); c.globalAlpha = fill; c.fill(); c.globalAlpha = 1;
      c.lineWidth = line; c.strokeStyle = accent; c.stroke();
    };
    c.font = '600 10px system-ui, sans-serif'; c.textAlign = 'center'; c.textBaseline = 'middle';
    net.inputs.forEach(([number, node], i) => {
      if (node === null) return;
      const is = i === this.chosen;
      ring(node, is ? 10 : 7, is ? 3 : 2, 0.85);
      c.fillStyle = accent; c.fillText(number, sx[node], sy[node] + 0.5);
    });
    const node = this.chosen - net.inputs.length;
    if (node >= 0 && node < net.x.length) ring(node, 9, 3, 0);
    if (pull) {
      c.beginPath(); c.moveTo(pull.from.x, pull.from.y); c.lineTo(pull.to.x, pull.to.y);
      c.lineWidth = 2; c.strokeStyle = accent; c.setLineDash([2, 5]); c.stroke(); c.setLineDash([]);
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
    const nearest = (nodes, best, within) => {
      nodes.forEach((node, i) => {
        const far = node === null ? within : Math.hypot(this.sx[node] - x, this.sy[node] - y);
        if (far < within) { best = i; within = far; }
      });
      return [best, within];
    };
    const [input, far] = nearest(this.net.inputs.map(i => i[1]), -1, 1e9), [node] = nearest(this.net.names.map((_, i) => this.isMass(i) ? i : null), -1, 24);
    return far > 12 && node >= 0 ? this.net.inputs.length + node : input;
  }
}

export const noteName = hz => {
  const key = 69 + 12 * Math.log2(hz / 440), k = Math.round(key), cents = Math.round(100 * (key - k));
  return ['C', 'C♯', 'D', 'E♭', 'E', 'F', 'F♯', 'G', 'A♭', 'A', 'B♭', 'B'][((k % 12) + 12) % 12] +
    (Math.floor(k / 12) - 1) + (cents ? (cents > 0 ? ' +' : ' −') + Math.abs(cents) : '');
};
export const hertz = hz => hz >= 1000 ? (hz / 1000).toFixed(2) + ' kHz' : hz.toFixed(hz < 100 ? 2 : 1) + ' Hz';

function prepared(canvas) {
  const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  const wide = Math.round(width * ratio), high = Math.round(height * ratio);
  if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
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

// Frequencies from 30 Hz to half the rate, as shares of an axis.
const shareOf = (hz, rate) => Math.log(hz / 30) / Math.log(rate / 60);
const ticks = { 100: '100 Hz', 1000: '1 kHz', 10000: '10 kHz' };

// The spectra of the last 10 s, from left to right. Another canvas keeps them without the axes.
export class Spectrogram {
  time = 0;   // Time of the last column, s.
  heard = 0;  // Time of the last sound, s.
  past = document.createElement('canvas').getContext('2d');

  // Adds the spectrum at a time in s. A gap of a second stays empty.
  add(canvas, magnitudes, rate, now) {
    const { past } = this, left = 40, seconds = 10, size = past.canvas;
    const wide = canvas.clientWidth - left, high = canvas.clientHeight - 14, colours = ['card', 'up', 'ink'].map(css);
    const isOther = size.width !== wide || size.height !== high || this.colour !== colours[0];
    if (magnitudes.some(m => m > 1e-5)) this.heard = now;
    if (!isOther && now - this.heard > seconds + 1) return;
    const gap = isOther || now < this.time ? seconds : Math.min(seconds, now - this.time);
    const columns = Math.floor(gap * wide / seconds), drawn = gap < 1 ? columns : 1;
    if (!columns) return;
    this.time = gap < seconds ? this.time + columns * seconds / wide : now;
    if (isOther) {
      Object.assign(size, { width: wide, height: high });
      [this.colour] = colours;
      this.palette = Array.from({ length: 64 }, (_, i) => mixed(colours[i >> 5], colours[(i >> 5) + 1], i % 32 / 31));
    }
    past.drawImage(size, -columns, 0);
    past.fillStyle = this.colour;
    past.fillRect(wide - columns, 0, columns, high);
    const last = magnitudes.length - 1, bin = y => 60 * magnitudes.length / rate * (rate / 60) ** (1 - y / high);
    for (let y = 0; y < high; y++) {
      let most = magnitudes[Math.min(last, Math.round(bin(y + 0.5)))];
      for (let i = Math.ceil(bin(y + 1)); i < Math.min(last, bin(y)); i++) most = Math.max(most, magnitudes[i]);
      past.fillStyle = this.palette[Math.max(0, Math.min(63, Math.round(75 + 16 * Math.log10(most + 1e-12))))];
      past.fillRect(wide - drawn, y, drawn, 1);
    }
    const { c, width } = prepared(canvas);
    c.drawImage(size, left, 0);
    c.font = '10px system-ui, sans-serif'; c.fillStyle = css('quiet');
    c.textAlign = 'right';
    c.fillText('\u221210 s', left, high + 12);
    c.fillText('0 s', width, high + 12);
    for (const hz in ticks) c.fillText(ticks[hz], left - 4, high * (1 - shareOf(hz, rate)) + 3);
  }
}

export function drawSpectrum(canvas, magnitudes, rate) {
  const { c, width, height } = prepared(canvas), bin = rate / 2 / magnitudes.length;
  const x = hz => shareOf(hz, rate) * width, floor = -100;
  c.font = '10px system-ui, sans-serif'; c.fillStyle = css('quiet'); c.strokeStyle = css('line'); c.lineWidth = 1;
  for (const hz in ticks) {
    c.beginPath(); c.moveTo(x(hz), 0); c.lineTo(x(hz), height - 12); c.stroke();
    c.fillText(ticks[hz], x(hz) + 3, height - 2);
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
