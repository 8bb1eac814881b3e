'use strict';
// Draws what the module computes; computes nothing itself but where a pixel goes.
// SVG and no plotting library: a curve has two points a pixel at most, the figure that is seen is the
// one that is saved, and its text is text.

// ---- the module ----

const imports = new Proxy({}, { get: () => () => 0 });  // it neither reads nor writes a file
const module_ = new WebAssembly.Module(Uint8Array.from(atob(wasm), (c) => c.charCodeAt(0)));
const api = new WebAssembly.Instance(module_, { wasi_snapshot_preview1: imports }).exports;
api._initialize();

function text(at) {
  const bytes = new Uint8Array(api.memory.buffer, at);
  return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
}
const doubles = (at, count) => new Float64Array(api.memory.buffer, at, count).slice();

const fields = JSON.parse(text(api.fields()));
const SIGNALS = ['t', 'r', 'y', 'measured', 'u', 'd', 'found', 'pid_y', 'pid_u'];
const NUMBERS = ['stable', 'gain_increase', 'gain_decrease', 'phase', 'modulus', 'delay', 'crossover',
  'noise', 'overshoot', 'settling', 'load_peak', 'load_area', 'largest', 'at_limit', 'refused'];
const CURVES = ['w', 'l', 'angle', 's', 'n', 'pid_l', 'pid_angle', 'pid_s', 'pid_n'];

function play(state, whole) {
  const to = new Float64Array(api.memory.buffer, api.settings(), fields.length);
  fields.forEach((field, i) => { to[i] = state[field.name]; });
  if (!api.play(whole ? 1 : 0)) return { refusal: text(api.refusal()) };
  const result = { note: text(api.pid_note()), code: text(api.code()), numbers: [] };
  SIGNALS.forEach((name, i) => { result[name] = doubles(api.signal(i), api.signal_length(i)); });
  CURVES.forEach((name, i) => { result[name] = doubles(api.curve(i), api.curve_length(i)); });
  for (const which of [0, 1]) {
    const values = doubles(api.numbers(which), NUMBERS.length);
    result.numbers.push(Object.fromEntries(NUMBERS.map((name, i) => [name, values[i]])));
  }
  result.has_pid = result.pid_y.length > 0;
  return result;
}

// ---- the state, which the address keeps ----

const standard = Object.fromEntries(fields.map((field) => [field.name, field.standard]));
let state = { ...standard };

function read(address) {
  state = { ...standard };
  for (const [name, value] of new URLSearchParams(address)) {
    if (name in standard && value.trim() !== '' && !isNaN(Number(value))) state[name] = Number(value);
  }
}
function address() {
  return fields.filter((field) => state[field.name] !== field.standard)
    .map((field) => field.name + '=' + state[field.name]).join('&');
}

// ---- numbers for a reader ----

function shown(value, digits = 3) {
  if (value === Infinity) return 'no limit';
  if (!Number.isFinite(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) {
    const [mantissa, power] = value.toExponential(digits - 1).split('e');
    const up = power.replace('+', '').replace(/./g, (c) => '⁰¹²³⁴⁵⁶⁷⁸⁹'[c] || '⁻');
    return mantissa + '·10' + up;
  }
  return value.toFixed(Math.max(0, digits - 1 - Math.floor(Math.log10(size)))).replace('-', '−');
}
const seconds = (value) => !Number.isFinite(value) ? shown(value) :
  value < 0.1 ? shown(1000 * value) + ' ms' : shown(value) + ' s';

// ---- a figure ----

const NS = 'http://www.w3.org/2000/svg';
function add(parent, tag, attributes, words) {
  const element = document.createElementNS(tag === 'p' || tag === 'span' ? 'http://www.w3.org/1999/xhtml' :
    NS, tag);
  for (const name in attributes) element.setAttribute(name, attributes[name]);
  if (words !== undefined) element.textContent = words;
  parent.append(element);
  return element;
}

function ticks(low, high, most) {
  const raw = (high - low) / most, unit = 10 ** Math.floor(Math.log10(raw));
  const step = unit * ([1, 2, 5].find((m) => m * unit >= raw) || 10);
  const all = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; ++i) all.push(i * step);
  return all;
}

let axes_drawn = 0;
// Ends are logarithms where the axis is one; px and py take what the ends are.
function axes(svg, { width, height, x0, x1, low, high, xlog, ylog, x, y }) {
  const left = 58, right = 12, top = 10, bottom = 38;
  const px = (v) => left + (v - x0) / (x1 - x0) * (width - left - right);
  const py = (v) => height - bottom - (v - low) / (high - low) * (height - top - bottom);
  svg.replaceChildren();
  svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
  const text = (px_, py_, words, anchor) => add(svg, 'text', { x: px_, y: py_, fill: 'var(--quiet)',
    'font-size': 12, 'font-family': 'system-ui, DejaVu Sans, sans-serif', 'text-anchor': anchor }, words);
  const power = (v) => v >= -3 && v <= 4 ? String(+(10 ** v).toPrecision(1)) :
    '10' + String(v).replace(/./g, (c) => '⁰¹²³⁴⁵⁶⁷⁸⁹'[c] || '⁻');
  const minus = (v, digits) => {
    const size = Math.abs(v);
    return (size >= 1e5 || (size > 0 && size < 1e-3) ? String(+v.toPrecision(3)) : String(+v.toPrecision(digits))).replace('-', '−');
  };
  const whole = (a, b, most) => {
    const step = Math.max(1, Math.ceil((b - a) / most)), all = [];
    for (let v = Math.ceil(a / step) * step; v <= b; v += step) all.push(v);
    return all;
  };
  // Less than a decade: 1, 2, 5.
  const decades = (a, b, most) => {
    const all = whole(a, b, most);
    if (all.length > 1) return all.map((v) => [v, power(v)]);
    const between = [];
    for (let v = Math.floor(a); v <= b; ++v) for (const m of [1, 2, 5]) between.push(v + Math.log10(m));
    return between.filter((v) => v >= a && v <= b).map((v) => [v, minus(10 ** v, 1)]);
  };
  const linear = (a, b, most, digits) => ticks(a, b, most).map((v) => [v, minus(v, digits)]);
  for (const [v, words] of xlog ? decades(x0, x1, width / 60) : linear(x0, x1, Math.max(3, width / 90), 6)) {
    add(svg, 'path', { d: `M${px(v)} ${top}V${height - bottom}`, stroke: 'var(--grid)', fill: 'none' });
    text(px(v), height - bottom + 16, words, 'middle');
  }
  for (const [v, words] of ylog ? decades(low, high, height / 34) : linear(low, high, height / 45, 5)) {
    add(svg, 'path', { d: `M${left} ${py(v)}H${width - right}`, stroke: 'var(--grid)', fill: 'none' });
    text(left - 7, py(v) + 4, words, 'end');
  }
  if (x) text(width - right, height - 4, x, 'end');
  if (y) text(left, height - 4, y, 'start');
  svg.dataset.axes = svg.dataset.axes || ++axes_drawn;
  const id = 'clip-' + svg.dataset.axes;
  add(add(svg, 'clipPath', { id }), 'rect', { x: left, y: top - 2, width: width - left - right + 2,
    height: height - top - bottom + 4 });
  return { px, py, left, right, top, bottom, clip: `url(#${id})` };
}

function names_of(place, lines) {
  place.replaceChildren();
  for (const line of lines) {
    const one = add(place, 'span', {});
    const key = add(one, 'svg', { viewBox: '0 0 28 10', 'aria-hidden': 'true' });
    add(key, 'path', { d: 'M0 5H28', stroke: line.colour, 'stroke-width': line.kind === 'band' ? 9 : line.width || 1.8,
      'stroke-dasharray': line.dash || 'none', opacity: line.opacity || 1 });
    one.append(line.name);
  }
}

class Plot {
  constructor(section, about) {
    this.about = about;
    this.names = add(section, 'p', { class: 'names' });
    this.svg = add(section, 'svg', { class: 'axes', role: 'img' });
    this.seen = '';
  }
  measure() {
    this.width = this.svg.clientWidth || 600;
    this.height = this.svg.clientHeight || 240;
  }
  // lines: {name, values, colour, dash, step, ylog}; x: values
  draw(x, lines, { xlog = false, ylog = false, at = [], bounds = null } = {}) {
    const { width, height } = this;
    const log10 = Math.log10;
    const xs = xlog ? Array.from(x, log10) : x;
    const x0 = xs[0], x1 = xlog ? xs[xs.length - 1] : 2 * xs[xs.length - 1] - xs[xs.length - 2];
    let low = Infinity, high = -Infinity;
    for (const line of lines) {
      if (line.aside) continue;
      for (const value of line.values) {
        const v = ylog ? log10(value) : value;
        if (v < low) low = v;
        if (v > high) high = v;
      }
    }
    if (bounds) [low, high] = [Math.max(low, bounds[0]), Math.min(high, bounds[1])];
    if (!(high > low)) [low, high] = Number.isFinite(low) ? [low - 1, high + 1] : [0, 1];
    const pad = 0.06 * (high - low);
    low -= pad; high += pad;
    const clipped = (v) => Math.min(Math.max(v, -height), 2 * height);
    const axis = axes(this.svg, { width, height, x0, x1, low, high, xlog, ylog, x: this.about.x, y: this.about.y });
    const { px, py, left, right, top, bottom, clip } = axis;
    for (const mark of at) {
      add(this.svg, 'path', { d: `M${left} ${py(mark)}H${width - right}`, stroke: 'var(--quiet)',
        'stroke-dasharray': '2 4', fill: 'none' });
    }
    const most = 2 * (width - left - right);
    for (const line of lines) {
      // Of many samples in a pixel the least and the largest: what is drawn is what there is.
      const bin = Math.max(1, Math.floor(2 * xs.length / most));
      let d = '', down = false;
      const point = (i) => {
        const v = ylog ? log10(line.values[i]) : line.values[i];
        if (!Number.isFinite(v)) { down = false; return; }
        const a = px(xs[i]).toFixed(1), b = clipped(py(v)).toFixed(1);
        d += !down ? `M${a} ${b}` : line.step ? `H${a}V${b}` : `L${a} ${b}`;
        down = true;
      };
      for (let i = 0; i < xs.length; i += bin) {
        if (bin === 1) { point(i); continue; }
        let a = i, b = i;
        for (let j = i; j < Math.min(i + bin, xs.length); ++j) {
          if (line.values[j] < line.values[a]) a = j;
          if (line.values[j] > line.values[b]) b = j;
          if (!Number.isFinite(line.values[j])) { a = Math.min(i, a); }
        }
        point(Math.min(a, b));
        if (a !== b) point(Math.max(a, b));
      }
      add(this.svg, 'path', { d, 'clip-path': clip, fill: 'none', stroke: line.colour, 'stroke-width': line.width || 1.8,
        'stroke-dasharray': line.dash || 'none', 'stroke-linejoin': 'round' });
    }
    const names = lines.map((line) => line.name).join('|');
    if (names !== this.seen) {
      this.seen = names;
      names_of(this.names, lines);
    }
    this.svg.setAttribute('aria-label', this.about.says(lines));
  }
}

const first = 'var(--first)', second = 'var(--second)', third = 'var(--third)', plain = 'var(--plain)';
const $ = (id) => document.getElementById(id);
const last_of = (line) => shown(line.values[line.values.length - 1]);
const says = (what) => (lines) => what + lines.map((line) => `${line.name} ends at ${last_of(line)}`).join('; ');
// What the disturbance is for a few samples, while u is still on its way, must not hide the rest.
function bulk(...all) {
  const values = all.flatMap((one) => Array.from(one)).filter(Number.isFinite).sort((a, b) => a - b);
  return [values[Math.floor(0.005 * values.length)], values[Math.ceil(0.995 * values.length) - 1]];
}

const plots = {
  y: new Plot($('first'), { id: 'y', x: 't / s', y: 'unit of y', says: says('Output over time: ') }),
  u: new Plot($('input'), { id: 'u', x: 't / s', y: 'unit of u', says: says('Input over time: ') }),
  d: new Plot($('disturbance'), { id: 'd', x: 't / s', y: 'unit of y⁽ⁿ⁾', says: says('Disturbance over time: ') }),
  l: new Plot($('bode'), { id: 'l', x: 'ω / (rad/s)', y: 'abs L', says: () => 'Magnitude of the loop gain over frequency' }),
  a: new Plot($('bode'), { id: 'a', x: 'ω / (rad/s)', y: 'phase of L / degrees', says: () => 'Phase of the loop gain over frequency' }),
  s: new Plot($('phase'), { id: 's', x: 'ω / (rad/s)', y: 'abs S', says: () => 'Sensitivity over frequency' }),
  n: new Plot($('phase'), { id: 'n', x: 'ω / (rad/s)', y: 'from noise to u', says: () => 'Gain from the noise of y to u over frequency' }),
};

function draw(result) {
  // All before the first changes: else the page is laid out anew for each.
  for (const name in plots) plots[name].measure();
  const pid = result.has_pid;
  const dots = '6 4';
  const with_pid = (lines, values, name) => pid ?
    [...lines, { name, values, colour: second, dash: dots }] : lines;
  const t = result.t;
  plots.y.draw(t, with_pid([{ name: 'reference', values: result.r, colour: plain, dash: '2 3', step: true },
    { name: pid ? 'y, ADRC' : 'y', values: result.y, colour: first }], result.pid_y, 'y, PID'));
  plots.u.draw(t, with_pid([{ name: pid ? 'u, ADRC' : 'u', values: result.u, colour: first, step: true,
    width: 1.4 }], result.pid_u, 'u, PID'));
  plots.d.draw(t, [{ name: 'disturbance', values: result.d, colour: plain, width: 1.4 },
    { name: 'its estimate', values: result.found, colour: third, dash: '7 3' }],
    { bounds: bulk(result.d, result.found) });
  const w = result.w, log = { xlog: true, ylog: true };
  const degrees = (values) => values.map((v) => v * 180 / Math.PI);
  const adrc = pid ? 'ADRC' : 'L';
  plots.l.draw(w, with_pid([{ name: adrc, values: result.l, colour: first }], result.pid_l, 'PID'),
    { ...log, at: [0], bounds: [-4, 4] });
  plots.a.draw(w, with_pid([{ name: adrc, values: degrees(result.angle), colour: first }],
    degrees(result.pid_angle), 'PID'), { xlog: true, at: [-180], bounds: [-720, 90] });
  plots.s.draw(w, with_pid([{ name: pid ? 'S, ADRC' : 'S: what is left of a disturbance of y',
    values: result.s, colour: first }], result.pid_s, 'S, PID'), { ...log, at: [0], bounds: [-4, 2] });
  plots.n.draw(w, with_pid([{ name: pid ? 'noise to u, ADRC' : 'noise of y to u', values: result.n, colour: first }],
    result.pid_n, 'noise to u, PID'), log);
}

// ---- numbers ----

const rows = [
  ['stable', (n) => n.stable ? 'yes' : 'no'],
  ['gain margin', (n) => '× ' + shown(n.gain_increase)],
  ['and downwards', (n) => Number.isFinite(n.gain_decrease) && n.gain_decrease > 0 ?
    '× ' + shown(n.gain_decrease) : n.gain_decrease === 0 ? 'no limit' : '–'],
  ['phase margin', (n) => Number.isFinite(n.phase) ? shown(180 / Math.PI * n.phase) + '°' : shown(n.phase)],
  ['least abs(1 + L)', (n) => shown(n.modulus)],
  ['more delay until it oscillates', (n) => seconds(n.delay)],
  ['crossover', (n) => shown(n.crossover), 'rad/s'],
  ['noise in u, standard deviation', (n) => shown(n.noise), 'u'],
  ['overshoot', (n) => shown(100 * n.overshoot) + ' %'],
  ['within 2 % after', (n) => seconds(n.settling)],
  ['off after the load, at most', (n) => shown(n.load_peak), 'y'],
  ['area of this error', (n) => shown(n.load_area), 'y s'],
  ['largest u', (n) => shown(n.largest), 'u'],
  ['samples at the limits of u', (n) => shown(100 * n.at_limit) + ' %'],
  ['measurements refused', (n) => String(n.refused)],
];

function tell_numbers(result) {
  const cell = (tag, words, attributes = {}) => {
    const one = document.createElement(tag);
    one.textContent = words;
    for (const name in attributes) one.setAttribute(name, attributes[name]);
    return one;
  };
  const heading = (name, unit) => {
    const one = cell('th', name + (unit ? ' ' : ''), { scope: 'row' });
    if (unit) one.append(cell('span', unit, { class: 'quiet' }));
    return one;
  };
  const row = (cells) => { const one = document.createElement('tr'); one.append(...cells); return one; };
  const shown_ones = result.has_pid ? [0, 1] : [0];
  $('numbers').querySelector('thead').replaceChildren(row([cell('th', '', { scope: 'col' }),
    ...shown_ones.map((i) => cell('th', ['ADRC', 'PID'][i], { scope: 'col' }))]));
  $('numbers').querySelector('tbody').replaceChildren(...rows.map(([name, says_, unit]) =>
    row([heading(name, unit), ...shown_ones.map((i) => {
      const one = cell('td', says_(result.numbers[i]));
      if (name === 'stable') one.className = result.numbers[i].stable ? 'pass' : 'fail';
      return one;
    })])));
  const margins = 'Margins and noise are of the linear loop, without friction, limits and quantum.';
  $('pidnote').textContent = state.pid ? (result.has_pid ?
    'PID with the same least abs(1 + L): ' : '') + result.note + (result.has_pid ? '. ' : ' ') + margins : margins;
}

// ---- what one sees ----

function sentences(now) {
  const [n, p] = now.numbers, told = [];
  const without = (name) => play({ ...state, [name]: 0 }, false);
  const both = (a, b) => `${shown(a)} instead of ${shown(b)}`;
  if (state.wrong) {
    const w = without('wrong').numbers[0];
    told.push(`b₀ is given twice as large: the observer counts what u does not do as disturbance; after the load y is off by up to ${both(n.load_peak, w.load_peak)}, and the loop is ${n.stable ? 'stable' : 'not stable'}.`);
  }
  if (state.lose) {
    const w = without('lose').numbers[0];
    told.push(`Of ${state.samples} measurements ${n.refused} do not arrive: the observer bridges each gap, and after the load y is off by up to ${both(n.load_peak, w.load_peak)}.`);
  }
  if (state.nan) {
    const w = without('nan');
    let change = 0;
    if (w.y) w.y.forEach((y, i) => { change = Math.max(change, Math.abs(y - now.y[i])); });
    told.push(`One measurement, a quarter into the run, is NaN: it does not get into the estimate, u stays finite, and y differs from the run without it by ${shown(change)} at most.`);
  }
  if (state.saturate) {
    told.push(`The step is now ${shown(now.r[0])}, for which the law asks for three times the limit. So u is at its limits in ${shown(100 * n.at_limit)} % of the samples, and y overshoots by ${shown(100 * n.overshoot)} %. The observer gets the u that was applied, so there is no integral to wind up.`);
  }
  if (state.noisy) {
    const w = without('noisy').numbers[0];
    told.push(Number.isFinite(n.noise) ? `Twice the noise is twice the noise in u: its standard deviation is ${both(n.noise, w.noise)}; move the observer bandwidth to see what it costs.` :
      'Twice the noise: the loop is not stable, so there is no standard deviation of u to tell.');
  }
  if (state.pid) {
    told.push(now.has_pid ? `Tuned to the same least abs(1 + L) = ${shown(n.modulus)}, the PID is off by up to ${shown(p.load_peak)} after the load, the ADRC by ${shown(n.load_peak)}; noise in u ${shown(p.noise)} and ${shown(n.noise)}.` : now.note);
  }
  return told;
}

// ---- controls ----

const STEPS = 1000;
// A bandwidth above 1 / T is of no use: the slider ends there, the field beside it does not.
const high_of = (field) => field.name.endsWith('_bandwidth') && state.sample_time > 0 ?
  Math.min(field.high, Math.max(10 * field.low, 1 / state.sample_time)) : field.high;
// What a load acts on, in words.
const acts_on = () => [['the rate of y', 'y/s'], ['acceleration', 'y/s²'], ['jerk', 'y/s³']][state.order - 1] || ['y⁽ⁿ⁾', ''];
function to_slider(field, value) {
  if (field.kind === 1 && !(value > 0)) return 0;
  const share = Math.log(value / field.low) / Math.log(high_of(field) / field.low);
  return Math.round(Math.min(Math.max(share, 0), 1) * (STEPS - 1)) + 1;
}
function from_slider(field, at) {
  if (field.kind === 1 && at === 0) return 0;
  const value = field.low * (high_of(field) / field.low) ** ((Math.max(at, 1) - 1) / (STEPS - 1));
  return field.name === 'samples' ? Math.round(value) : Number(value.toPrecision(3));
}

const controls = {};
function build() {
  const groups = {};
  for (const field of fields) {
    if (field.group === 'What happens' || field.kind === 4) continue;
    if (!groups[field.group]) {
      groups[field.group] = document.createElement('fieldset');
      const legend = document.createElement('legend');
      legend.textContent = field.group;
      groups[field.group].append(legend);
      $('controls').querySelector('.groups').append(groups[field.group]);
    }
    const box = document.createElement('div'), label = document.createElement('label');
    box.className = 'field';
    label.textContent = field.label + ' ';
    const unit = document.createElement('span');
    unit.className = 'quiet';
    unit.textContent = field.unit;
    box.title = field.hint;
    label.append(unit);
    const name = field.label + (field.unit ? ', ' + field.unit : '');
    const id = 'f-' + field.name;
    label.htmlFor = id;
    const change = (value) => { state[field.name] = value; changed(); };
    if (field.kind === 2) {
      const select = document.createElement('select');
      select.id = id;
      field.choices.split(';').forEach((words, i) => select.add(new Option(words, field.low + i)));
      select.onchange = () => change(Number(select.value));
      box.append(label, select);
      controls[field.name] = () => { select.value = state[field.name]; };
    } else if (field.kind === 3) {
      const tick = document.createElement('input');
      tick.type = 'checkbox';
      tick.id = id;
      box.classList.add('tick');
      tick.onchange = () => change(tick.checked ? 1 : 0);
      box.append(tick, label);
      controls[field.name] = () => { tick.checked = state[field.name] > 0; };
    } else {
      const slider = document.createElement('input'), number = document.createElement('input');
      slider.type = 'range';
      slider.min = field.kind === 1 ? 0 : 1;
      slider.max = STEPS;
      slider.setAttribute('aria-label', name + ', slider');
      number.type = 'number';
      number.step = 'any';
      number.id = id;
      number.setAttribute('aria-label', name);
      slider.oninput = () => change(from_slider(field, Number(slider.value)));
      number.oninput = () => { if (number.value !== '' && number.validity.valid) change(Number(number.value)); };
      box.append(label, slider, number);
      controls[field.name] = () => {
        if (document.activeElement !== slider) slider.value = to_slider(field, state[field.name]);
        slider.setAttribute('aria-valuetext', shown(state[field.name]) + ' ' + field.unit);
        if (document.activeElement !== number) number.value = state[field.name];
        if (field.name === 'load') [label.firstChild.textContent, unit.textContent] = [`load on ${acts_on()[0]} `, acts_on()[1]];
      };
      slider.setAttribute('aria-description', field.hint);
      controls[field.name].bad = (bad) => number.setAttribute('aria-invalid', bad);
    }
    groups[field.group].append(box);
  }
  const names = ['wrong', 'lose', 'nan', 'saturate', 'noisy', 'pid'];
  for (const name of names) {
    const field = fields.find((one) => one.name === name);
    const button = document.createElement('button');
    button.textContent = field.label;
    button.onclick = () => { state[name] = 1 - state[name]; changed(true); };
    $('happens').append(button);
    controls[name] = () => button.setAttribute('aria-pressed', state[name] > 0);
  }
  const again = document.createElement('button');
  again.textContent = 'Start over';
  again.onclick = () => { state = { ...standard }; $('brought').textContent = ''; changed(true); };
  $('happens').append(again);
}

let result = null, waiting = 0, later = 0;
function update(whole) {
  for (const name in controls) controls[name]();
  const now = play(state, whole);
  for (const field of fields) {
    if (controls[field.name] && controls[field.name].bad) controls[field.name].bad(Boolean(now.refusal) && now.refusal.startsWith(field.name + ' '));
  }
  $('refusal').textContent = now.refusal ? 'Refused: ' + now.refusal + '. The figures show what was before.' : '';
  if (now.refusal) return;
  if (!whole && result) for (const i of [0, 1]) now.numbers[i].delay = result.numbers[i].delay;
  result = now;
  draw(result);
  tell_numbers(result);
  if (whole) {
    $('code').textContent = result.code;
    const told = sentences(result);
    const items = told.map((words) => { const one = document.createElement('li'); one.textContent = words; return one; });
    if (told.join() !== Array.from($('said').children, (one) => one.textContent).join()) $('said').replaceChildren(...items);
    // Not history.replaceState: a page from a disk may do this.
    const there = '#' + address();
    if (location.hash !== there && (location.hash || there !== '#')) {
      ignored = there;
      location.replace(there);
    }
  }
}
let ignored = null;
function changed(at_once) {
  cancelAnimationFrame(waiting);
  waiting = requestAnimationFrame(() => update(Boolean(at_once)));
  clearTimeout(later);
  if (!at_once) later = setTimeout(() => update(true), 250);
}

// ---- take it home ----

function done(words) { $('done').textContent = words; }
async function copy(words, what) {
  try {
    await navigator.clipboard.writeText(words);
    done(what + ' copied.');
  } catch {
    const range = document.createRange();
    range.selectNodeContents($('code'));
    getSelection().removeAllRanges();
    getSelection().addRange(range);
    done('This browser does not copy from a file; press Ctrl C.');
  }
}
function save(name, kind, words) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([words], { type: kind }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  done(name + ' saved.');
}
function csv() {
  const heads = ['t', 'reference', 'y', 'measured', 'u', 'disturbance', 'estimate'];
  const columns = [result.t, result.r, result.y, result.measured, result.u, result.d, result.found];
  if (result.has_pid) { heads.push('y_pid', 'u_pid'); columns.push(result.pid_y, result.pid_u); }
  const lines = [heads.join(',')];
  for (let k = 0; k < result.t.length; ++k) lines.push(columns.map((c) => Number.isNaN(c[k]) ? '' : c[k]).join(','));
  return lines.join('\n') + '\n';
}
// Figures below each other, each with its title, in the colours of the page.
function stacked(figures) {
  const style = getComputedStyle(document.documentElement);
  let height = 0, width = 0, parts = '';
  for (const [one, title] of figures) {
    const h = one.clientHeight;
    parts += `<text x="58" y="${height + 16}" font-size="13" font-family="sans-serif" fill="var(--text)">${title.replace(/[&<]/g, (c) => c === '&' ? '&amp;' : '&lt;')}</text>` +
      `<g transform="translate(0 ${height + 22})">${one.innerHTML}</g>`;
    height += h + 30;
    width = Math.max(width, one.clientWidth);
  }
  parts = parts.replace(/var\((--[a-z]+)\)/g, (all, name) => style.getPropertyValue(name).trim());
  return `<svg xmlns="${NS}" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}">` +
    `<rect width="100%" height="100%" fill="${style.getPropertyValue('--back').trim()}"/>${parts}</svg>\n`;
}
const svg = () => stacked(Object.values(plots).map((plot) => [plot.svg, plot.seen.replace(/\|/g, ', ')]));

// ---- the test of examples/playground/check.sh: every number of some settings ----

// What a visitor does: each control has a name, each button says a sentence and can be taken back. A
// slider and a field change the figures, what is refused is said, and the page lives on.
function visit() {
  const problems = [];
  const expect = (good, words) => { if (!good) problems.push(words); };
  for (const one of document.querySelectorAll('button, input, select')) {
    const name = one.getAttribute('aria-label') || (one.labels && one.labels[0] || one).textContent;
    expect(name && name.trim(), `${one.outerHTML} has no name`);
    expect(one.tabIndex >= 0 || one.role === 'tab', `${name} cannot be reached by keyboard`);
  }
  for (const one of document.querySelectorAll('svg.axes')) expect(one.getAttribute('aria-label'), 'a figure without a name');
  read('');
  for (const button of $('happens').querySelectorAll('button[aria-pressed]')) {
    button.click();
    update(true);
    const told = $('said').children;
    expect(told.length === 1 && /\d/.test(told[0].textContent) && !/undefined|–/.test(told[0].textContent),
      `${button.textContent} tells: ${$('said').textContent}`);
    expect(button.getAttribute('aria-pressed') === 'true', `${button.textContent} does not look pressed`);
    expect(location.hash.includes('=1'), `${button.textContent} is not in the address`);
    button.click();
    update(true);
    expect($('said').children.length === 0, `${button.textContent} cannot be taken back`);
  }
  for (const field of fields) {
    const number = $('f-' + field.name);
    if (!number || number.type !== 'number') continue;
    read('');
    update(true);
    const slider = number.parentElement.querySelector('input[type=range]');
    const before = state[field.name];
    slider.value = Number(slider.value) + 30;
    slider.dispatchEvent(new Event('input'));
    update(true);
    expect(state[field.name] > before, `the slider of ${field.name} does nothing`);
    number.value = -1;
    number.dispatchEvent(new Event('input'));
    update(true);
    expect($('refusal').textContent.includes(field.name), `-1 for ${field.name} is not refused`);
    expect(number.getAttribute('aria-invalid') === 'true', `${field.name} is not marked`);
    number.value = before;
    number.dispatchEvent(new Event('input'));
    update(true);
    expect($('refusal').textContent === '', `${field.name} does not take back what was refused`);
  }
  read('order=7&samples=1e9&gain=x&other=3');
  update(true);
  expect($('refusal').textContent.includes('order'), 'an address that is wrong is not refused');
  read('');
  update(true);
  expect(csv().split('\n').length === state.samples + 2, 'the CSV has other rows');
  expect(new DOMParser().parseFromString(svg(), 'image/svg+xml').querySelectorAll('path').length > 50 &&
    !svg().includes('var('), 'the SVG is not whole');
  return problems;
}

function selftest(lines) {
  const all = [];
  for (const line of lines) {
    read(line);
    update(true);
    const numbers = [...SIGNALS.map((name) => result[name]),
      ...result.numbers.map((one) => Float64Array.from(NUMBERS, (name) => one[name])),
      ...CURVES.map((name) => result[name])];
    for (const values of numbers) all.push(Float64Array.of(values.length), values);
  }
  const bytes = new Uint8Array(8 * all.reduce((sum, values) => sum + values.length, 0));
  let at = 0;
  for (const values of all) {
    bytes.set(new Uint8Array(values.buffer), at);
    at += 8 * values.length;
  }
  let written = '';
  for (let i = 0; i < bytes.length; i += 3000) written += btoa(String.fromCharCode(...bytes.subarray(i, i + 3000)));
  let least = Infinity;
  read('');
  for (let i = 0; i < 20; ++i) {
    const began = performance.now();
    state.gain_factor = 1 + i / 20;
    update(false);
    least = Math.min(least, performance.now() - began);
  }
  return { numbers: written, frame: least, problems: visit() };
}

build();
$('copycode').onclick = () => copy(result.code, 'The C++ is');
$('copyaddress').onclick = () => copy(location.href, 'The address is');
$('savecsv').onclick = () => save('esokit.csv', 'text/csv', csv());
$('savesvg').onclick = () => save('esokit.svg', 'image/svg+xml', svg());
addEventListener('hashchange', () => {
  if (location.hash === ignored) return;
  read(location.hash.slice(1));
  update(true);
});
new ResizeObserver(() => { if (result && !$('play').hidden) draw(result); }).observe($('desk'));
read(location.hash.slice(1));
update(true);
