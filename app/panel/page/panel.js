// The page of the running program. It sends OSC, and receives three streams: /describe and /network
// once per model, /events ten times a second, /motion thirty times a second.
import { NetworkView, Spectrogram, drawScope, drawSpectrum, hertz, noteName, spectrumOf } from '/draw.js';

const $ = id => document.getElementById(id);
const make = (name, text, attributes = {}) => {
  const element = document.createElement(name);
  if (text !== undefined) element.textContent = text;
  for (const key in attributes) element.setAttribute(key, attributes[key]);
  return element;
};

const on = (element, name, action) => element.addEventListener(name, action);
const box = name => make('div', undefined, { class: name });
const itemOf = (...contents) => {
  const item = make('li');
  item.append(...contents);
  return item;
};
const write = texts => Object.entries(texts).forEach(([id, text]) => { $(id).textContent = text; });
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
    parts.push(new Uint8Array(new Float32Array([value]).buffer).reverse());  // big-endian
  }
  return new Blob(parts);
}

// Sends one packet at a time, in order; of a slider only the latest waiting value.
const waiting = [];
let isSending = false;
function say(address, ...values) {
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
  desks.length = 0;
  showKnobs();
  showSliders();
  showScenes();
  $('modes').replaceChildren();
  $('find-modes').hidden = false;
  view.showMode(null);
  model.warnings.forEach(complain);
}

async function loadNetwork() {
  if (isFetching) return;
  isFetching = true;
  try {
    const net = await json('/network');
    picture = net.picture;
    const key = [model?.name, net.dots, net.x.length].join();
    if (model && key !== view.key) { view.setNetwork(net, model); view.key = key; }
    const families = new Set(net.links.map(l => net.laws[l[2]][1]));
    if (net.inputs.length) families.add('input');
    const legend = Object.entries({ spring: 'spring', pluck: 'plectrum', bow: 'bow', contact: 'contact, lit while it touches', input: 'input: drag to play' })
      .filter(([kind]) => families.has(kind));
    $('legend').replaceChildren(...legend.map(([kind, text]) => {
      return itemOf(make('i', undefined, { class: 'k-' + kind }), text);
    }));
    $('hint').textContent = net.masses > net.dots ? `${net.dots} of ${net.masses} masses are drawn` : '';
  } catch { setTimeout(loadNetwork, 500); } finally { isFetching = false; }
}

// --- streams ---------------------------------------------------------------------------------------

let serial = 0;
function listen() {
  const events = new EventSource('/events');
  on(events, 'loaded', async event => {
    const now = JSON.parse(event.data).serial;
    if (now !== serial) { serial = now; await loadModel(); await loadNetwork(); }
  });
  on(events, 'values', event => {
    for (const [name, value] of Object.entries(JSON.parse(event.data))) showValue(name, value);
  });
  on(events, 'mapping', event => { mapping = JSON.parse(event.data); showMapping(); });
  on(events, 'status', event => { status = JSON.parse(event.data); showStatus(); });
  on(events, 'news', event => complain(JSON.parse(event.data)));
  events.onerror = () => { $('description').textContent = 'the program is gone; waiting for it'; };
  events.onopen = () => { if (model) $('description').textContent = model.description; };
}

let isSlow = false, heard = null, played = 0, motionFrames = 0, watcher = null;
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
    played = Number(head.getBigUint64(0, true));
    bytes = bytes.slice(size);
  }
}
on($('slow'), 'click', () => {
  isSlow = !isSlow;
  $('slow').setAttribute('aria-pressed', isSlow);
  watcher?.abort();
  watch();
});
on(document, 'visibilitychange', () => document.hidden ? watcher?.abort() : watch());

const spectrogram = new Spectrogram;
let drawn = 0, painted = null;
const isSeen = canvas => canvas.getBoundingClientRect().bottom > 0 && canvas.getBoundingClientRect().top < innerHeight;
function paint() {
  view.draw();
  if (heard !== painted && drawn++ % 4 === 0) {
    painted = heard;
    const rate = status.rate || 48000, spectrum = spectrumOf(heard);
    if (isSeen($('scope'))) drawScope($('scope'), heard);
    const found = drawSpectrum($('spectrum'), spectrum, rate);
    if (isSeen($('spectrogram'))) spectrogram.add($('spectrogram'), spectrum, rate, played / rate);
    const { centroid_hz, spread_hz, flatness } = status, most = view.peak > 1e-6 ? view.peak.toPrecision(2) : '0';
    write({
      centroid: centroid_hz ? hertz(centroid_hz) : '–', spread: spread_hz ? hertz(spread_hz) : '–',
      flatness: flatness ? flatness < 1e-3 ? 'below 0.001' : flatness.toPrecision(2) : '–',
      loudest: found ? hertz(found.peak) : '–', 'loudest-note': found ? noteName(found.peak) : '',
      scale: view.mode ? 'a mode, slowed down' : isSlow ? 'two seconds a period' : `largest swing ${most}`,
    });
  }
  requestAnimationFrame(paint);
}

function showStatus() {
  const { cpu, energy, voices, xruns } = status, peak = status.peak_db ?? -999;
  $('peak').value = Math.max(-60, peak);
  write({
    'peak-text': peak > -120 ? peak.toFixed(1) + ' dBFS' : 'silent', voices: `${voices} of ${status.max_voices}`,
    load: cpu < 0 ? 'not running' : (100 * cpu).toFixed(0) + ' %', xruns,
    energy: energy ? energy.toPrecision(2) : status.whole || !voices ? '0' : 'in modes',
  });
  $('load').className = cpu > 0.8 ? 'alarm' : '';
  $('xruns').className = xruns > 0 ? 'alarm' : '';
}

// --- parameters --------------------------------------------------------------------------------------

const digits = value => Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-4)
  ? value.toExponential(3) : String(+value.toPrecision(5));
const sliders = new Map();

// Makes the slider of a parameter, or of an address of the preset.
function makeSlider(info) {
  const { name, minimum, maximum, lowest = 0, highest = null, address = '/param/' + name } = info;
  const id = 'p-' + name, isLog = minimum > 0 && maximum / minimum > 20, ratio = maximum / minimum;
  const to = v => isLog ? Math.log(v / minimum) / Math.log(ratio) : (v - minimum) / (maximum - minimum || 1);
  const from = s => isLog ? minimum * ratio ** s : minimum + s * (maximum - minimum);
  const row = box('slider'), track = box('track');
  const output = make('output', '', { for: id }), proved = make('span', undefined, { class: 'proved' });
  const input = make('input', undefined, { id, type: 'range', min: 0, max: 1, step: 0.001, 'aria-describedby': id + '-range' });
  input.disabled = info.audio_input > 0;
  const write = value => {
    output.textContent = digits(value);
    input.setAttribute('aria-valuetext', digits(value));
  };
  on(input, 'input', () => {
    const value = from(+input.value);
    write(value);
    say(address, value);
  });
  const clamp = v => Math.min(1, Math.max(0, v));
  const low = lowest === null ? 0 : clamp(to(lowest) || 0), high = highest === null ? 1 : clamp(to(highest));
  proved.style.left = 100 * low + '%';
  proved.style.width = 100 * Math.max(0, high - low) + '%';
  track.append(proved, input);
  const limits = [lowest > 0 ? 'above ' + digits(lowest) : '', highest !== null ? 'below ' + digits(highest) : ''].filter(Boolean).join(' and ');
  row.append(make('label', name, { for: id }), output, track,
    make('small', info.audio_input > 0 ? `given by audio input ${info.audio_input}` : limits ? 'proved stable ' + limits : 'stable anywhere', { id: id + '-range' }));
  // A control of the same name takes the controllers.
  if (!info.audio_input && !knobs.has('/control/' + name)) row.append(makeDesk(name, name));
  const show = value => {
    if (document.activeElement === input && input.matches(':active')) return;
    input.value = to(value);
    write(value);
    info.value = value;
    showLimits();
  };
  sliders.set(name, show);
  if (info.value !== undefined) show(info.value);
  return row;
}

function showSliders() {
  sliders.clear();
  const rows = [...model.parameters, ...model.controls.map(name => ({ name, address: name, minimum: 0, maximum: 1 }))].map(makeSlider);
  $('sliders').replaceChildren(...rows.length ? rows : [make('p', 'This model has no parameters.', { class: 'quiet' })]);
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

// --- controllers ---------------------------------------------------------------------------------

let mapping = { waiting: '', rows: [] };
const desks = [];  // Functions that show the controller of a knob or slider.
const showMapping = () => desks.forEach(show => show());

// Shows which controllers move a target, and a button that assigns the next one that moves, or
// takes the assigned one away. `cc`: the preset's controller.
function makeDesk(target, name, cc) {
  const text = make('small'), button = make('button'), desk = box('desk');
  const isOf = row => row.to.toLowerCase().replaceAll(' ', '-') === target.toLowerCase() || row.to === 'cc' + cc;
  desks.push(() => {
    const rows = mapping.rows.filter(isOf), isLearnt = rows.some(row => row.learned), waits = mapping.waiting === target;
    const all = rows.map(row => (row.learned ? 'learnt: ' : '') + row.from.replace('cc', 'CC ') + (row.relative ? ', relative' : ''));
    if (cc !== undefined && !mapping.rows.some(row => row.from === 'cc' + cc)) all.push('CC ' + cc);
    text.textContent = waits ? 'move a knob…' : all.join('; ');
    button.textContent = waits ? 'Cancel' : isLearnt ? 'Forget' : 'Learn';
    button.setAttribute('aria-label', `${button.textContent} the controller of ${name}`);
    button.onclick = () => say(waits || isLearnt ? '/unlearn' : '/learn', target);
  });
  desks.at(-1)();
  desk.append(text, button);
  return desk;
}

// --- the named controls --------------------------------------------------------------------------

const knobs = new Map();  // Maps each address to the function that shows its position.

let grip = null;  // The knob that a pointer holds.
on(window, 'pointermove', event => { if (grip?.id === event.pointerId) grip.move(event); });
for (const end of ['pointerup', 'pointercancel']) on(window, end, event => { if (grip?.id === event.pointerId) grip = null; });

// Makes a knob: drag it up or to the right, turn the wheel, or use the keys of a slider.
function makeKnob({ name, address, help, controller, value: start }) {
  const step = { ArrowUp: 0.01, ArrowRight: 0.01, ArrowDown: -0.01, ArrowLeft: -0.01, PageUp: 0.1, PageDown: -0.1, Home: -1, End: 1 };
  const dial = make('div', undefined, {
    class: 'dial', role: 'slider', tabindex: 0, 'aria-label': name, title: help,
    'aria-valuemin': 0, 'aria-valuemax': 100,
  });
  const output = make('output');
  let value = start, told = start, waits = 0;
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
    waits = setTimeout(() => { waits = 0; if (grip?.dial !== dial) show(told); }, 600);
  };
  on(dial, 'keydown', event => {
    if (!(event.key in step)) return;
    turn(value + step[event.key]);
    event.preventDefault();
  });
  const way = at => at.clientX - at.clientY;
  on(dial, 'pointerdown', event => {
    const from = value, start = way(event);
    grip = { id: event.pointerId, dial, move: at => turn(from + (way(at) - start) / 200) };
  });
  on(dial, 'wheel', event => {
    turn(value - Math.sign(event.deltaY) * 0.02);
    event.preventDefault();
  });
  show(start);
  knobs.set(address, to => {
    told = to;
    if (grip?.dial !== dial && !waits) show(to);
  });
  const knob = box('knob');
  knob.append(dial, make('span', name), output, makeDesk(address.slice(9), name, controller));
  return knob;
}

function showKnobs() {
  knobs.clear();
  $('controls').hidden = !model.knobs.length;
  $('knobs').replaceChildren(...model.knobs.map(makeKnob));
}

// --- modes ---------------------------------------------------------------------------------------------

on($('find-modes'), 'click', async () => {
  $('modes-text').textContent = 'Searching for the modes…';
  try {
    const found = await json('/modes?count=24');
    const of = serial;
    $('find-modes').hidden = true;
    $('modes-text').textContent = (found.linear ? '' : 'Without contacts, bows and plectra. ') +
        'Choose one to see its shape, again to see it play.';
    $('modes').replaceChildren(...found.modes.map(mode => {
      const by = mode.inputs.filter(([, db]) => db !== null).map(([number, db]) => `input ${number} ${db} dB`).slice(0, 3).join(', ');
      const button = make('button', hertz(mode.hz), { 'aria-pressed': 'false' });
      button.append(make('small', `${noteName(mode.hz)}, ${mode.t60_s === null ? 'never decays' : 'T60 ' + mode.t60_s.toPrecision(2) + ' s'}`),
        make('small', by || 'not excited by any input', { title: 'Level at which each input excites this mode, relative to the mode that it excites most' }));
      on(button, 'click', () => {
        const on = button.getAttribute('aria-pressed') === 'true';
        document.querySelectorAll('#modes button').forEach(b => b.setAttribute('aria-pressed', 'false'));
        if (!on && of === serial) button.setAttribute('aria-pressed', 'true');
        view.showMode(on || mode.shape.length !== view.net?.dots ? null : mode.shape);
      });
      return itemOf(button);
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
  on(star, 'click', () => {
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
      on(button, 'click', () => {
        $('library').close();
        $('description').textContent = `loading ${name}…`;
        say(address, name);
      });
      return itemOf(button, makeStar(name));
    }));
}
on($('filter'), 'input', showScenes);
on($('choose'), 'click', () => { showScenes(); $('library').showModal(); $('filter').focus(); });
on($('panic'), 'click', () => say('/panic'));

// --- keys ------------------------------------------------------------------------------------------------

const isEnter = event => event.key === 'Enter' || event.key === ' ';
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
on($('keyboard'), 'pointerdown', event => {
  const key = keyAt(event);
  if (key === undefined) return;
  event.target.releasePointerCapture?.(event.pointerId);
  press('pointer' + event.pointerId, +key, 60 + Math.round(60 * Math.min(1, event.offsetY / 80)));
});
on($('keyboard'), 'pointermove', event => {
  const by = 'pointer' + event.pointerId;
  if (!down.has(by)) return;
  const key = keyAt(event);
  if (key !== undefined && +key !== down.get(by)) { lift(by); press(by, +key); }
});
for (const end of ['pointerup', 'pointercancel']) on(window, end, event => lift('pointer' + event.pointerId));
on($('keyboard'), 'keydown', event => {
  const at = event.target.closest('[data-key]'), step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (step && at) {
    const next = keyButtons.get(+at.dataset.key + step);
    if (next) { at.tabIndex = -1; next.tabIndex = 0; next.focus(); }
    event.preventDefault();
  } else if (isEnter(event) && at && !event.repeat) {
    press('focus', +at.dataset.key);
    event.preventDefault();
  }
});
on($('keyboard'), 'keyup', event => { if (isEnter(event)) lift('focus'); });
on(window, 'keydown', event => {
  if (event.key === 'Escape' && !$('library').open) return say('/panic');
  if (event.target.type === 'search' || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
  const at = letters.indexOf(event.key.toLowerCase());
  if (at >= 0) press('letter' + event.code, octave + 12 + at);
  if (event.key === 'z' || event.key === 'x') {
    octave = Math.min(84, Math.max(0, octave + (event.key === 'z' ? -12 : 12)));
    showKeys();
  }
});
on(window, 'keyup', event => lift('letter' + event.code));
on(window, 'blur', () => [...down.keys()].forEach(lift));
on(window, 'resize', showKeys);

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
const restOf = info => view.net.start[view.net.inputs.find(i => i[0] === info.number)?.[1]] ?? 0;
const saidOf = { pluck: 'drag and let go to pluck', bow: 'drag to bow', move: 'drag to move' };
let held = null;

function choose(chosen) {
  const { info, way } = (chosen >= 0 && wayOf(chosen)) || {};
  view.chosen = chosen;
  $('hint').textContent = !way ? '' : `${way === 'hit' ? info.name : `input ${info.number}${info.attached_to ? ' at ' + info.attached_to : ''}`}: ${saidOf[way] ?? 'drag and let go to strike'}`;
}
const play = (info, gesture, ...values) => say(`/in/${info.number}/${gesture}`, ...values);
function release(chosen, strength) {
  const { info, way } = wayOf(chosen) ?? {};
  if (way === 'hit') say(`/mass/${info.name}/strike`, strength);
  if (way === 'strike') play(info, 'force', info.blow * strength, 0);
  if (way === 'pluck') play(info, 'pluck', strength);
  if (way === 'bow') play(info, 'bow', 0, 0.5);
  if (way === 'move') play(info, 'position', restOf(info));
}
const canvas = $('network');
const point = event => ({ x: event.offsetX, y: event.offsetY });
on(canvas, 'pointerdown', event => {
  const at = point(event), chosen = view.targetAt(at.x, at.y);
  if (chosen < 0) return;
  canvas.setPointerCapture(event.pointerId);
  held = { id: event.pointerId, chosen, from: at, last: at, time: event.timeStamp };
  view.chosen = chosen;
  const node = view.nodeOf(chosen);
  view.pull = { from: { x: view.sx[node], y: view.sy[node] }, to: at };
});
on(canvas, 'pointermove', event => {
  const at = point(event);
  if (!held) {
    const chosen = view.targetAt(at.x, at.y), node = chosen < 0 ? -1 : view.nodeOf(chosen);
    return choose(node >= 0 && Math.hypot(view.sx[node] - at.x, view.sy[node] - at.y) < 60 ? chosen : -1);
  }
  if (event.pointerId !== held.id) return;
  view.pull.to = at;
  const { info, way } = wayOf(held.chosen) ?? {};
  if (way === 'bow') {
    const speed = (at.x - held.last.x) / Math.max(1, event.timeStamp - held.time);
    play(info, 'bow', Math.max(-1, Math.min(1, speed * 0.8)) || 0.02, Math.max(0.05, Math.min(1, 0.4 + (at.y - held.from.y) / 300)));
  }
  if (way === 'move') play(info, 'position', restOf(info) - (at.y - held.from.y) / 100 * info.blow);
  held.last = at; held.time = event.timeStamp;
});
for (const end of ['pointerup', 'pointercancel']) on(canvas, end, event => {
  if (event.pointerId !== held?.id) return;
  const far = Math.hypot(held.last.x - held.from.x, held.last.y - held.from.y);
  if (end === 'pointerup') release(held.chosen, far < 6 ? 0.6 : Math.min(1, 0.15 + far / 140));
  held = view.pull = null;
});
on(canvas, 'pointerleave', () => { if (!held) choose(-1); });
on(canvas, 'keydown', event => {
  const count = view.net ? view.net.inputs.length + view.net.dots : 0, step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
  if (!count || !(step || isEnter(event))) return;
  event.preventDefault();
  let { chosen } = view;
  if (step) {
    do chosen = (chosen + step + count) % count; while (!wayOf(chosen) && chosen > 0);
    choose(chosen);
  } else if (!event.repeat && chosen >= 0) {
    const { info, way } = wayOf(chosen) ?? {};
    if (way === 'bow') play(info, 'bow', 0.6, 0.5);
    else if (way === 'move') { play(info, 'position', restOf(info) + info.blow); setTimeout(() => release(chosen, 0), 120); }
    else release(chosen, 0.6);
  }
});
on(canvas, 'keyup', event => {
  if (isEnter(event) && view.chosen >= 0 && wayOf(view.chosen)?.way === 'bow') release(view.chosen, 0);
});

// Exposes received data to the tests.
globalThis.panel = { view, spectrogram, say, get frames() { return motionFrames; }, get status() { return status; }, get heard() { return heard; } };

showKeys();
listen();
watch();
requestAnimationFrame(paint);
