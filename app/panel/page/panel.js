// The page of the running program. It sends OSC, and receives three streams: /describe and /network
// once per model, /events ten times a second, /motion thirty times a second.
import { NetworkView, drawScope, drawSpectrum, hertz, noteName, spectrumOf } from '/draw.js';

const $ = id => document.getElementById(id);
const make = (name, text, attributes = {}) => {
  const element = document.createElement(name);
  if (text !== undefined) element.textContent = text;
  for (const key in attributes) element.setAttribute(key, attributes[key]);
  return element;
};

const counted = (count, one, more) => `${count} ${count === 1 ? one : more}`;

// --- OSC ---------------------------------------------------------------------------------------

const encoder = new TextEncoder();
const padded = text => {
  const bytes = encoder.encode(text), out = new Uint8Array((bytes.length >> 2) * 4 + 4);
  out.set(bytes);
  return out;
};
function packet(address, ...values) {
  const parts = [padded(address), padded(',' + values.map(v => typeof v === 'string' ? 's' : 'f').join(''))];
  for (const value of values) {
    if (typeof value === 'string') { parts.push(padded(value)); continue; }
    const number = new DataView(new ArrayBuffer(4));
    number.setFloat32(0, value);
    parts.push(new Uint8Array(number.buffer));
  }
  return new Blob(parts);
}

// Sends one packet at a time, in order; of a slider only the latest waiting value.
const waiting = [];
let isSending = false;
export function say(address, ...values) {
  if (/^\/(param|control)\//.test(address) || address.endsWith('/position') || address.endsWith('/bow')) {
    const old = waiting.findIndex(w => w[0] === address);
    if (old >= 0) waiting.splice(old, 1);
  }
  waiting.push([address, ...values]);
  if (!isSending) send();
}
async function send() {
  isSending = true;
  while (waiting.length) {
    try {
      const answer = await fetch('/osc', {
        method: 'POST', headers: { 'Content-Type': 'application/octet-stream' }, body: packet(...waiting.shift()),
      });
      const text = new TextDecoder().decode(await answer.arrayBuffer());
      for (const error of text.matchAll(/\/error\0\0,ss\0([^\0]*)\0+([^\0]+)/g)) complain(error[2]);
      if (!answer.ok)
        complain('the program refused the command: status ' + answer.status);
    } catch { complain('the program does not answer'); waiting.length = 0; }
  }
  isSending = false;
}

function complain(text) {
  const list = $('news');
  list.querySelector('.quiet')?.remove();
  if (list.firstChild?.textContent === text) return;
  list.prepend(make('li', text));
  while (list.children.length > 30) list.lastChild.remove();
}

// --- the current model --------------------------------------------------------------------------

const view = new NetworkView($('network'));
let model = null, status = {}, picture = 0, isFetching = false;

async function json(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return answer.json();
}

async function loadModel() {
  model = await json('/describe');
  document.title = model.name + ' – ressort';
  $('name').textContent = model.name;
  $('description').textContent = model.description ||
    `${counted(model.masses, 'mass', 'masses')}, ${counted(model.link_count, 'link', 'links')}`;
  showKnobs();
  showSliders();
  showScenes();
  $('modes').replaceChildren();
  $('find-modes').hidden = false;
  view.mode = null;
  model.warnings.forEach(complain);
}

async function loadNetwork() {
  if (isFetching) return;
  isFetching = true;
  try {
    const net = await json('/network');
    const isOther = !view.net || net.dots !== view.net.dots || net.x.length !== view.net.x.length;
    picture = net.picture;
    if (isOther || view.named !== model?.name) { view.setNetwork(net); view.named = model?.name; }
    const seen = new Set(net.links.map(l => net.laws[l[2]][1]));
    const legend = ['spring', 'pluck', 'bow', 'contact'].filter(f => seen.has(f)).map(family => [family, { spring: 'spring', pluck: 'plectrum', bow: 'bow', contact: 'contact, lit while it touches' }[family]]);
    if (net.kinds.includes('o')) legend.push(['body', 'modes of a body, the lowest first']);
    if (net.inputs.length) legend.push(['input', 'input: drag to play']);
    $('legend').replaceChildren(...legend.map(([kind, text]) => {
      const item = make('li', text);
      item.prepend(make('i', undefined, { class: 'k-' + kind }));
      return item;
    }));
    if (net.masses > net.dots) $('hint').textContent = `${net.dots} of ${net.masses} masses are drawn`;
  } catch { setTimeout(loadNetwork, 500); } finally { isFetching = false; }
}

// --- streams ---------------------------------------------------------------------------------------

let serial = 0;
function listen() {
  const events = new EventSource('/events');
  events.addEventListener('loaded', async event => {
    const now = JSON.parse(event.data).serial;
    if (now !== serial) { serial = now; await loadModel(); await loadNetwork(); }
  });
  events.addEventListener('values', event => {
    for (const [name, value] of Object.entries(JSON.parse(event.data))) showValue(name, value);
  });
  events.addEventListener('status', event => { status = JSON.parse(event.data); showStatus(); });
  events.addEventListener('news', event => complain(JSON.parse(event.data)));
  events.onerror = () => { $('description').textContent = 'the program is gone; waiting for it'; };
  events.onopen = () => { if (model) $('description').textContent = model.description; };
}

let isSlow = false, heard = null, motionFrames = 0, watcher = null;
async function watch() {
  while (!document.hidden) {
    watcher = new AbortController();
    try {
      const answer = await fetch('/motion?hz=30' + (isSlow ? '&slow=1' : ''), { signal: watcher.signal });
      if (!answer.ok) throw new Error(await answer.text());
      const reader = answer.body.getReader();
      let held = new Uint8Array(0);
      for (;;) {
        const { value, done } = await reader.read();
        if (done) break;
        const all = new Uint8Array(held.length + value.length);
        all.set(held); all.set(value, held.length);
        held = takeFrames(all);
      }
    } catch (error) { if (error.name === 'AbortError') return; }
    await new Promise(done => setTimeout(done, 1000));
  }
}
function takeFrames(bytes) {
  for (;;) {
    if (bytes.length < 24) return bytes;
    const head = new DataView(bytes.buffer, bytes.byteOffset, 24);
    const dots = head.getUint32(12, true), samples = head.getUint32(16, true), size = 24 + 4 * (dots + samples);
    if (bytes.length < size) return bytes;
    const floats = new Float32Array(bytes.slice(24, size).buffer), number = head.getUint32(8, true);
    motionFrames++;
    if (number !== picture) loadNetwork();
    else if (view.net && dots === view.net.dots) view.move(floats.subarray(0, dots));
    heard = floats.subarray(dots);
    bytes = bytes.slice(size);
  }
}
$('slow').addEventListener('click', () => {
  isSlow = !isSlow;
  $('slow').setAttribute('aria-pressed', isSlow);
  watcher?.abort();
  watch();
});
document.addEventListener('visibilitychange', () => document.hidden ? watcher?.abort() : watch());

let drawn = 0;
function paint() {
  view.draw();
  if (heard && drawn++ % 4 === 0) {
    drawScope($('scope'), heard);
    const found = drawSpectrum($('spectrum'), spectrumOf(heard), status.rate || 48000);
    $('centroid').textContent = status.centroid_hz ? hertz(status.centroid_hz) : '–';
    $('spread').textContent = status.spread_hz ? hertz(status.spread_hz) : '–';
    $('flatness').textContent = status.flatness ? status.flatness < 1e-3 ? 'below 0.001' : status.flatness.toPrecision(2) : '–';
    $('loudest').textContent = found ? hertz(found.peak) : '–';
    $('loudest-note').textContent = found ? noteName(found.peak) : '';
    const most = view.peak > 1e-6 ? view.peak.toPrecision(2) : '0';
    $('scale').textContent = view.mode ? 'a mode, slowed down' : isSlow ? 'two seconds a period' : `largest swing ${most}`;
  }
  requestAnimationFrame(paint);
}

function showStatus() {
  const peak = status.peak_db ?? -999;
  $('peak').value = Math.max(-60, peak);
  $('peak-text').textContent = peak > -120 ? peak.toFixed(1) + ' dBFS' : 'silent';
  $('voices').textContent = `${status.voices} of ${status.max_voices}`;
  $('load').textContent = status.cpu < 0 ? 'not running' : (100 * status.cpu).toFixed(0) + ' %';
  $('load').className = status.cpu > 0.8 ? 'alarm' : '';
  $('xruns').textContent = status.xruns;
  $('xruns').className = status.xruns > 0 ? 'alarm' : '';
  $('energy').textContent = status.energy ? status.energy.toPrecision(2) : status.whole || !status.voices ? '0' : 'in modes';
}

// --- parameters --------------------------------------------------------------------------------------

const digits = value => Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-4)
  ? value.toExponential(3) : String(+value.toPrecision(5));
const sliders = new Map();

function showSliders() {
  sliders.clear();
  const rows = model.parameters.map(info => {
    const row = make('div', undefined, { class: 'slider' });
    const id = 'p-' + info.name, isLog = info.minimum > 0 && info.maximum / info.minimum > 20;
    const to = v => isLog ? Math.log(v / info.minimum) / Math.log(info.maximum / info.minimum)
      : (v - info.minimum) / (info.maximum - info.minimum || 1);
    const from = s => isLog ? info.minimum * (info.maximum / info.minimum) ** s
      : info.minimum + s * (info.maximum - info.minimum);
    const output = make('output', '', { for: id });
    const input = make('input', undefined, {
      id, type: 'range', min: 0, max: 1, step: 0.001, 'aria-describedby': id + '-range',
    });
    input.disabled = info.audio_input > 0;
    input.addEventListener('input', () => {
      const value = from(+input.value);
      output.textContent = digits(value);
      input.setAttribute('aria-valuetext', digits(value));
      say('/param/' + info.name, value);
    });
    const track = make('div', undefined, { class: 'track' });
    const proved = make('span', undefined, { class: 'proved' });
    const clamp = v => Math.min(1, Math.max(0, v));
    const low = info.lowest === null ? 0 : clamp(to(info.lowest) || 0);
    const high = info.highest === null ? 1 : clamp(to(info.highest));
    proved.style.left = 100 * low + '%';
    proved.style.width = 100 * Math.max(0, high - low) + '%';
    track.append(proved, input);
    const limits = info.lowest > 0 || info.highest !== null
      ? 'proved stable ' + [info.lowest > 0 ? 'above ' + digits(info.lowest) : '',
        info.highest !== null ? 'below ' + digits(info.highest) : ''].filter(Boolean).join(' and ')
      : 'stable anywhere';
    row.append(make('label', info.name, { for: id }), output, track,
      make('small', info.audio_input > 0 ? `given by audio input ${info.audio_input}` : limits, { id: id + '-range' }));
    const show = value => {
      if (document.activeElement === input && input.matches(':active')) return;
      input.value = to(value);
      output.textContent = digits(value);
      input.setAttribute('aria-valuetext', digits(value));
      info.value = value;
      showLimits();
    };
    sliders.set(info.name, show);
    show(info.value);
    return row;
  });
  for (const address of model.controls) {
    const row = make('div', undefined, { class: 'slider' }), id = 'c' + address.replaceAll('/', '-');
    const input = make('input', undefined, { id, type: 'range', min: 0, max: 1, step: 0.001 });
    const output = make('output', '', { for: id });
    input.addEventListener('input', () => { output.textContent = (+input.value).toFixed(2); say(address, +input.value); });
    const track = make('div', undefined, { class: 'track' });
    track.append(input);
    row.append(make('label', address, { for: id }), output, track);
    rows.push(row);
  }
  if (!rows.length)
    rows.push(make('p', 'This model has no parameters.', {class: 'quiet'}));
  $('sliders').replaceChildren(...rows);
}
function showValue(name, value) { (knobs.get(name) ?? sliders.get(name))?.(value); }

// Returns for example " of 'r1' and 2 more".
function users(name) {
  const [first, count] = view.net?.users[name] ?? [];
  return first ? ` of '${first}'${count > 1 ? ` and ${count - 1} more` : ''}` : '';
}

// Shows the parameter that is closest to its stability limit.
function showLimits() {
  let nearest = null, share = 0;
  for (const info of model.parameters) {
    const part = Math.max(info.highest ? info.value / info.highest : 0,
      info.lowest > 0 ? info.lowest / info.value : 0);
    if (part > share) { share = part; nearest = info.name; }
  }
  $('limits').textContent = share < 0.05 ?
      'All parameters are far from their limits of stability.' :
      `Nearest to its limit of stability: ${nearest}${users(nearest)}, at ${
          (100 * share).toFixed(0)} % of it.`;
}

// --- the named controls --------------------------------------------------------------------------

const knobs = new Map();  // Maps each address to the function that shows its position.

// Makes a knob: drag it up or to the right, turn the wheel, or use the keys of a slider.
function makeKnob({ name, address, help, value: start }) {
  const step = { ArrowUp: 0.01, ArrowRight: 0.01, ArrowDown: -0.01, ArrowLeft: -0.01, PageUp: 0.1, PageDown: -0.1, Home: -1, End: 1 };
  const dial = make('div', undefined, {
    class: 'dial', role: 'slider', tabindex: 0, 'aria-label': name, title: help,
    'aria-valuemin': 0, 'aria-valuemax': 100,
  });
  const output = make('output');
  let value = start, told = start, isHeld = false, waits = 0;
  const show = to => {
    value = Math.min(1, Math.max(0, to));
    dial.style.setProperty('--turn', value);
    output.textContent = Math.round(100 * value);
    dial.setAttribute('aria-valuenow', Math.round(100 * value));
  };
  // The program's answers are late while the knob moves, so the last one is shown at rest.
  const turn = to => {
    show(to);
    say(address, value);
    clearTimeout(waits);
    waits = setTimeout(() => { waits = 0; if (!isHeld) show(told); }, 600);
  };
  dial.addEventListener('keydown', event => {
    if (!(event.key in step)) return;
    turn(value + step[event.key]);
    event.preventDefault();
  });
  dial.addEventListener('pointerdown', event => {
    const from = value, way = at => at.clientX - at.clientY, ends = new AbortController();
    const follow = (name, action) => addEventListener(name, at => {
      if (at.pointerId === event.pointerId) action(at);
    }, { signal: ends.signal });
    const release = () => { isHeld = false; ends.abort(); };
    isHeld = true;
    follow('pointermove', at => turn(from + (way(at) - way(event)) / 200));
    follow('pointerup', release);
    follow('pointercancel', release);
  });
  dial.addEventListener('wheel', event => {
    turn(value - Math.sign(event.deltaY) * 0.02);
    event.preventDefault();
  }, { passive: false });
  show(start);
  knobs.set(address, to => {
    told = to;
    if (!isHeld && !waits) show(to);
  });
  const knob = make('div', undefined, { class: 'knob' });
  knob.append(dial, make('span', name), output);
  return knob;
}

function showKnobs() {
  knobs.clear();
  $('controls').hidden = !model.knobs.length;
  $('knobs').replaceChildren(...model.knobs.map(makeKnob));
}

// --- modes ---------------------------------------------------------------------------------------------

$('find-modes').addEventListener('click', async () => {
  $('modes-text').textContent = 'Searching for the modes…';
  try {
    const found = await json('/modes?count=24');
    const of = serial;
    $('find-modes').hidden = true;
    $('modes-text').textContent = (found.linear ? '' : 'Without contacts, bows and plectra. ') +
        'Choose one to see its shape, again to see it play.';
    $('modes').replaceChildren(...found.modes.map((mode, i) => {
      const button = make('button', hertz(mode.hz), { 'aria-pressed': 'false' });
      button.append(make('small', `${noteName(mode.hz)}, ${mode.t60_s === null ? 'never decays' : 'T60 ' + mode.t60_s.toPrecision(2) + ' s'}`));
      const by = mode.inputs.map(([number, db]) => `input ${number} ${db === null ? 'not at all' : db + ' dB'}`).slice(0, 3).join(', ');
      if (by)
        button.append(make('small', by, {
          title:
              'Level at which each input excites this mode, relative to the mode that it excites most'
        }));
      button.setAttribute('aria-label', `Mode ${i + 1}, ${hertz(mode.hz)}; ${by}`);
      button.addEventListener('click', () => {
        const on = button.getAttribute('aria-pressed') === 'true';
        document.querySelectorAll('#modes button').forEach(b => b.setAttribute('aria-pressed', 'false'));
        if (!on && of === serial) button.setAttribute('aria-pressed', 'true');
        view.mode = on || mode.shape.length !== view.net?.dots ? null : mode.shape;
      });
      const item = make('li');
      item.append(button);
      return item;
    }));
    if (!found.modes.length)
      $('modes-text').textContent = 'This network has no modes.';
  } catch (error) {
    $('modes-text').textContent = error.message;
  }
});

// --- the library ---------------------------------------------------------------------------------------

const favourites = new Set(JSON.parse(localStorage.getItem('favourites') ?? '[]'));

function makeStar(name) {
  const star = make('button', '\u2605', { class: 'star', 'aria-label': `Favourite: ${name}`, 'aria-pressed': favourites.has(name) });
  star.addEventListener('click', () => {
    if (!favourites.delete(name)) favourites.add(name);
    star.setAttribute('aria-pressed', favourites.has(name));
    localStorage.setItem('favourites', JSON.stringify([...favourites]));
  });
  return star;
}

// Lists all instruments that fit the search, the favourites first.
function showScenes() {
  const wanted = $('filter').value.toLowerCase();
  const rows = [...model.presets.map(([name, line]) => [name, line, '/preset/load']),
    ...model.models.filter(name => !model.presets.some(p => p[0] === name)).map(name => [name, 'a model without a preset', '/model/load'])];
  $('scenes').replaceChildren(...rows.filter(([name, line]) => (name + ' ' + line).toLowerCase().includes(wanted))
    .sort((a, b) => favourites.has(b[0]) - favourites.has(a[0]))
    .map(([name, line, address]) => {
      const button = make('button', name);
      if (name === model.name) button.setAttribute('aria-current', 'true');
      button.append(make('small', line));
      button.addEventListener('click', () => {
        $('library').close();
        $('description').textContent = `loading ${name}…`;
        say(address, name);
      });
      const item = make('li');
      item.append(button, makeStar(name));
      return item;
    }));
}
$('filter').addEventListener('input', showScenes);
$('choose').addEventListener('click', () => { showScenes(); $('library').showModal(); $('filter').focus(); });
$('panic').addEventListener('click', () => say('/panic'));

// --- keys ------------------------------------------------------------------------------------------------

const letters = 'awsedftgyhujkolp';
const down = new Map();  // Maps each pressed letter or pointer to its key.
const keyButtons = new Map();
let octave = 48;
function press(by, key, velocity = 96) {
  if (down.has(by) || key < 0 || key > 127) return;
  down.set(by, key);
  keyButtons.get(key)?.classList.add('down');
  say('/note/on', key, velocity);
}
function lift(by) {
  if (!down.has(by)) return;
  const key = down.get(by);
  down.delete(by);
  keyButtons.get(key)?.classList.remove('down');
  say('/note/off', key);
}
function showKeys() {
  const wide = innerWidth > 820, first = octave, last = octave + (wide ? 36 : 16);
  keyButtons.clear();
  $('keyboard').replaceChildren(...Array.from({ length: last - first + 1 }, (_, i) => {
    const key = first + i, sharp = [1, 3, 6, 8, 10].includes(key % 12);
    const button = make('button', key % 12 === 0 ? 'C' + (key / 12 - 1) : '', {
      tabindex: i === 0 ? 0 : -1, 'data-key': key, 'aria-label': noteName(440 * 2 ** ((key - 69) / 12)),
    });
    if (sharp) button.classList.add('sharp');
    keyButtons.set(key, button);
    return button;
  }));
}
const keyAt = event => document.elementFromPoint(event.clientX, event.clientY)?.closest('[data-key]')?.dataset.key;
$('keyboard').addEventListener('pointerdown', event => {
  const key = keyAt(event);
  if (key === undefined) return;
  event.target.releasePointerCapture?.(event.pointerId);
  press('pointer' + event.pointerId, +key, 60 + Math.round(60 * Math.min(1, event.offsetY / 80)));
});
$('keyboard').addEventListener('pointermove', event => {
  const by = 'pointer' + event.pointerId;
  if (!down.has(by)) return;
  const key = keyAt(event);
  if (key !== undefined && +key !== down.get(by)) { lift(by); press(by, +key); }
});
for (const end of ['pointerup', 'pointercancel']) addEventListener(end, event => lift('pointer' + event.pointerId));
$('keyboard').addEventListener('keydown', event => {
  const at = event.target.closest('[data-key]'), step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (step && at) {
    const next = keyButtons.get(+at.dataset.key + step);
    if (next) { at.tabIndex = -1; next.tabIndex = 0; next.focus(); }
    event.preventDefault();
  } else if ((event.key === ' ' || event.key === 'Enter') && at && !event.repeat) {
    press('focus', +at.dataset.key);
    event.preventDefault();
  }
});
$('keyboard').addEventListener('keyup', event => { if (event.key === ' ' || event.key === 'Enter') lift('focus'); });
const isTyping = event => /^(INPUT|TEXTAREA)$/.test(event.target.tagName) && event.target.type === 'search';
addEventListener('keydown', event => {
  if (event.key === 'Escape' && !$('library').open) return say('/panic');
  if (isTyping(event) || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
  const at = letters.indexOf(event.key.toLowerCase());
  if (at >= 0) press('letter' + event.code, octave + 12 + at);
  if (event.key === 'z' || event.key === 'x') {
    octave = Math.min(84, Math.max(0, octave + (event.key === 'z' ? -12 : 12)));
    showKeys();
  }
});
addEventListener('keyup', event => lift('letter' + event.code));
addEventListener('blur', () => [...down.keys()].forEach(lift));
addEventListener('resize', showKeys);

// --- playing on the picture ------------------------------------------------------------------------------

// Returns the gesture of an input under the pointer: strike, pluck, bow or move; a mass is struck.
function wayOf(chosen) {
  const node = chosen - view.net.inputs.length;
  if (node >= 0) return view.isMass(node) ? { info: { name: view.net.names[node] }, way: 'hit' } : null;
  const info = model?.inputs.find(i => i.number === view.net.inputs[chosen][0]);
  if (!info) return null;
  const known = info.gestures;
  return { info, way: info.is_force ? 'strike' : known.includes('pluck') ? 'pluck' : known.includes('bow') ? 'bow' : 'move' };
}
const restOf = info => {
  const node = view.net.inputs.find(i => i[0] === info.number)?.[1];
  return node === null || node === undefined ? 0 : view.net.start[node];
};
const saidOf = { hit: 'drag and let go to strike', strike: 'drag and let go to strike', pluck: 'drag and let go to pluck', bow: 'drag to bow', move: 'drag to move' };
let held = null;

function hint(chosen) {
  const way = chosen < 0 ? null : wayOf(chosen);
  const what = way?.way === 'hit' ? way.info.name : `input ${way?.info.number}${way?.info.attached_to ? ' at ' + way.info.attached_to : ''}`;
  $('hint').textContent = way ? `${what}: ${saidOf[way.way]}` : '';
}
function release(chosen, strength) {
  const { info, way } = wayOf(chosen) ?? {};
  if (way === 'hit') say(`/mass/${info.name}/strike`, strength);
  if (way === 'strike') say(`/in/${info.number}/force`, info.blow * strength, 0);
  if (way === 'pluck') say(`/in/${info.number}/pluck`, strength);
  if (way === 'bow') say(`/in/${info.number}/bow`, 0, 0.5);
  if (way === 'move') say(`/in/${info.number}/position`, restOf(info));
}
const canvas = $('network');
const point = event => ({ x: event.offsetX, y: event.offsetY });
canvas.addEventListener('pointerdown', event => {
  const at = point(event), chosen = view.targetAt(at.x, at.y);
  if (chosen < 0) return;
  canvas.setPointerCapture(event.pointerId);
  held = { id: event.pointerId, chosen, from: at, last: at, time: event.timeStamp };
  view.chosen = chosen;
  const node = view.nodeOf(chosen);
  view.pull = { from: { x: view.sx[node], y: view.sy[node] }, to: at };
});
canvas.addEventListener('pointermove', event => {
  const at = point(event);
  if (!held) {
    const chosen = view.targetAt(at.x, at.y), node = chosen < 0 ? -1 : view.nodeOf(chosen);
    view.chosen = node >= 0 && Math.hypot(view.sx[node] - at.x, view.sy[node] - at.y) < 60 ? chosen : -1;
    hint(view.chosen);
    return;
  }
  if (event.pointerId !== held.id) return;
  view.pull.to = at;
  const { info, way } = wayOf(held.chosen) ?? {};
  if (way === 'bow') {
    const speed = (at.x - held.last.x) / Math.max(1, event.timeStamp - held.time);
    const drawn = Math.max(-1, Math.min(1, speed * 0.8)) || 0.02;
    const pressure = Math.max(0.05, Math.min(1, 0.4 + (at.y - held.from.y) / 300));
    say(`/in/${info.number}/bow`, drawn, pressure);
  } else if (way === 'move') {
    say(`/in/${info.number}/position`, (restOf(info)) - (at.y - held.from.y) / 100 * info.blow);
  }
  held.last = at; held.time = event.timeStamp;
});
const letGo = event => {
  if (!held || event.pointerId !== held.id) return;
  const far = Math.hypot(held.last.x - held.from.x, held.last.y - held.from.y);
  if (event.type === 'pointerup') release(held.chosen, far < 6 ? 0.6 : Math.min(1, 0.15 + far / 140));
  held = null;
  view.pull = null;
};
canvas.addEventListener('pointerup', letGo);
canvas.addEventListener('pointercancel', letGo);
canvas.addEventListener('pointerleave', () => { if (!held) { view.chosen = -1; $('hint').textContent = ''; } });
canvas.addEventListener('keydown', event => {
  const count = view.net ? view.net.inputs.length + view.net.dots : 0, step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
  if (!count) return;
  if (step) {
    do view.chosen = (view.chosen + step + count) % count; while (!wayOf(view.chosen) && view.chosen > 0);
    hint(view.chosen);
    event.preventDefault();
  }
  if ((event.key === 'Enter' || event.key === ' ') && !event.repeat && view.chosen >= 0) {
    const { info, way } = wayOf(view.chosen) ?? {};
    if (way === 'bow') say(`/in/${info.number}/bow`, 0.6, 0.5);
    else if (way === 'move') { say(`/in/${info.number}/position`, (restOf(info)) + info.blow); setTimeout(() => release(view.chosen, 0), 120); }
    else release(view.chosen, 0.6);
    event.preventDefault();
  }
});
canvas.addEventListener('keyup', event => {
  if ((event.key === 'Enter' || event.key === ' ') && view.chosen >= 0 && wayOf(view.chosen)?.way === 'bow') release(view.chosen, 0);
});

// Exposes received data to the tests.
globalThis.panel = { view, say, get frames() { return motionFrames; }, get status() { return status; }, get heard() { return heard; } };

showKeys();
listen();
watch();
requestAnimationFrame(paint);
