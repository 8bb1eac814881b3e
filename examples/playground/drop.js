'use strict';
// "Your log": hands a file to the worker, and shows what from_log says of it.

const largest_file = 150e6;  // bytes; what is read takes as much again

async function unpacked(base64) {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'))).arrayBuffer();
}
const log_module = (() => {
  let promise = null;
  return () => promise || (promise = unpacked(packed.module).then((bytes) => WebAssembly.compile(bytes)));
})();

let worker = null, file = null, log_result = null;

// Fields of the form are options of the program.
function words_of_form() {
  const words = [file.name];
  for (const input of $('options').querySelectorAll('[data-option]')) {
    if (input.type === 'checkbox') {
      if (input.checked) words.push('--' + input.dataset.option);
    } else if (input.value.trim() !== '') {
      words.push(`--${input.dataset.option}=${input.value.trim()}`);
    }
  }
  const more = $('more').value.trim();
  return more ? [...words, ...more.split(/\s+/)] : words;
}

function tell_log(words, bad) {
  $('logsays').textContent = words;
  $('logsays').className = bad ? 'bad' : '';
}

function busy(on) {
  $('work').hidden = !on;
  $('study').disabled = on || !file;
  for (const one of $('logs').querySelectorAll('button')) one.disabled = on;
}

function cancel() {
  if (!worker) return;
  worker.terminate();
  worker = null;
  busy(false);
  tell_log('Cancelled.');
}

const worker_address = () => URL.createObjectURL(new Blob([$('worker').textContent], { type: 'text/javascript' }));

// Resolves when the worker is done, with what it said.
async function study() {
  if (worker) worker.terminate();
  worker = null;
  if (!file) return null;
  $('found').replaceChildren();
  $('after').hidden = true;
  log_result = null;
  if (file.size > largest_file) {
    tell_log(`${file.name} has ${Math.round(file.size / 1e6)} MB; a page takes up to ${largest_file / 1e6} MB. The program from_log reads longer files.`, true);
    return null;
  }
  busy(true);
  tell_log('');
  $('bar').removeAttribute('value');
  $('doing').textContent = 'starting';
  const url = worker_address(), mine = new Worker(url);
  worker = mine;
  URL.revokeObjectURL(url);
  const module = await log_module();
  if (worker !== mine) return null;
  return new Promise((resolve) => {
    const end = (said) => {
      if (worker !== mine) return;
      mine.terminate();
      worker = null;
      busy(false);
      show_log(said);
      resolve(said);
    };
    mine.onmessage = ({ data }) => {
      if (worker !== mine) return;
      if (!data.what) { end(data); return; }
      $('doing').textContent = data.what;
      if (data.share >= 0) $('bar').value = data.share;
      else $('bar').removeAttribute('value');
    };
    mine.onerror = (event) => end({ error: 'The worker stopped: ' + event.message });
    mine.postMessage({ module, file, words: words_of_form() });
  });
}

function take(a_file) {
  file = a_file;
  $('chosen').textContent = file.name;
  return study();
}

const ends = { 0: 'A controller was found.', 3: 'The log is refused; below is why, and what to record instead.',
  4: 'There is something to look at first: see the alarm, or why there is no design.' };

function show_log(said) {
  if (said.error) {
    tell_log(said.error, true);
    return;
  }
  log_result = said;
  tell_log(ends[said.status] || '', said.status === 3);
  const found = $('found');
  found.innerHTML = said.header.replaceAll('h1>', 'h2>') + said.main;
  const drawn = found.querySelectorAll('.drawn');
  said.drawn = said.figures.map((figure, i) => new LogFigure(drawn[i], figure,
    drawn[i].parentElement.querySelector('figcaption').textContent));
  $('after').hidden = false;
  $('copylog').hidden = $('savelog').hidden = !said.code;
  $('toplay').hidden = !said.address;
  $('taken').textContent = said.taken;
  draw_log();
  // Tables of a narrow page scroll in themselves, with a name for a screen reader.
  for (const box of found.querySelectorAll('.table')) {
    box.setAttribute('role', 'region');
    box.setAttribute('aria-label', box.parentElement.querySelector('figcaption').textContent);
  }
  for (const code of found.querySelectorAll('pre')) code.setAttribute('aria-label', 'C++ to paste');
}

// Superscripts of gnuplot's text.
const plain_marks = (words) => words.replace(/\^\{([^}]*)\}/g, (all, inside) => inside.replace(/[0-9()n-]/g,
  (c) => ({ '(': '⁽', ')': '⁾', n: 'ⁿ', '-': '⁻' }[c] || '⁰¹²³⁴⁵⁶⁷⁸⁹'[c]))).replace(/_\{?([0-9a-z]+)\}?/g, '$1');

// ---- the figures of from_log: their description is that which draw_figure.py reads ----

function csv_fields(line) {
  const all = [];
  for (const found of line.matchAll(/(?:^|,)(?:"((?:[^"]|"")*)"|([^,]*))/g)) {
    all.push(found[1] === undefined ? found[2] : found[1].replaceAll('""', '"'));
  }
  return all;
}

const log_colours = ['--text', '--first', '--second', '--third', '--fourth', '--fifth', '--sixth', '--text', '--plain'];
const log_dashes = ['none', '9 4', '2 3', '10 3 2 3'];

class LogFigure {
  constructor(place, { description, numbers }, caption) {
    const blocks = numbers.split('\n\n\n').slice(1).map((block) => {
      const x = [], y = [], z = [];
      for (const row of block.split('\n')) {
        const last = row.split(',').slice(-3);
        x.push(last.length < 3 ? NaN : Number(last[0]));
        y.push(last.length < 3 || last[1] === 'nan' ? NaN : Number(last[1]));
        z.push(Number(last[2]));
      }
      return { x, y, z };
    });
    this.place = place;
    this.caption = caption;
    this.panels = [];
    let panel = null, next = 0;
    for (const line of description.trimEnd().split('\n')) {
      const [key, ...values] = csv_fields(line);
      if (key === 'figure') [this.columns, this.height] = [Number(values[4]), Number(values[5])];
      else if (key === 'panel') this.panels.push(panel = { drawn: [], notes: [], set: {} });
      else if (key === 'draw') {
        const [kind, at, name, colour, dash, width, marker, size, opacity] = values;
        panel.drawn.push({ kind, at: Number(at), name, colour: `var(${log_colours[colour]})`, dash: log_dashes[dash],
          width: Number(width), marker: Number(marker), size: Number(size), opacity: Number(opacity),
          ...(kind === 'vertical' || kind === 'horizontal' ? {} : blocks[next++]) });
      } else if (key === 'note') panel.notes.push([Number(values[0]), Number(values[1]), values[2]]);
      else panel.set[key] = values;
    }
    for (const one of this.panels) {
      one.box = document.createElement('div');
      one.box.className = 'plot';
      place.append(one.box);
      const label = (axis) => plain_marks((one.set[axis + '_label'] || [''])[0]);
      add(one.box, 'p', { class: 'names quiet' }, label('y'));
      names_of(add(one.box, 'p', { class: 'names' }), one.drawn.filter((line) => line.name && one.set.legend));
      one.svg = add(one.box, 'svg', { class: 'axes', role: 'img' });
      one.svg.setAttribute('aria-label', `${label('y')} over ${label('x') || 'the same axis as below'}`);
    }
  }

  draw() {
    const room = Math.max(1, Math.min(this.columns, Math.floor(this.place.clientWidth / 270)));
    this.place.style.gridTemplateColumns = `repeat(${room}, minmax(0, 1fr))`;
    for (const one of this.panels) one.size = [one.svg.clientWidth || 400, one.svg.clientHeight || 240];
    for (const one of this.panels) this.draw_panel(one);
  }

  draw_panel({ svg, drawn, notes, set, size: [width, height] }) {
    const xlog = 'x_log' in set, ylog = 'y_log' in set;
    const at = (log) => (v) => log ? Math.log10(v) : v;
    const X = at(xlog), Y = at(ylog);
    const range = (axis, to, values) => {
      let low = Infinity, high = -Infinity;
      for (const one of values) {
        for (const v of one) {
          const w = to(v);
          if (!Number.isFinite(w)) continue;
          if (w < low) low = w;
          if (w > high) high = w;
        }
      }
      if (!(high >= low)) [low, high] = [0, 1];
      if (high === low) [low, high] = [low - 1, high + 1];
      const pad = axis === 'y' || drawn.some((one) => one.kind === 'points') ? 0.05 * (high - low) : 0;
      const [from, until] = (set[axis + '_range'] || ['*', '*']).map((v) => v === '*' ? NaN : to(Number(v)));
      return [Number.isFinite(from) ? from : low - pad, Number.isFinite(until) ? until : high + pad];
    };
    const data = drawn.filter((one) => one.x);
    const flat = drawn.filter((one) => one.kind === 'horizontal').map((one) => [one.at]);
    const [x0, x1] = range('x', X, data.map((one) => one.x));
    const [low, high] = range('y', Y, [...data.map((one) => one.y), ...flat,
      ...data.filter((one) => one.kind === 'band').map((one) => one.z)]);
    const { px, py, left, right, top, bottom, clip } = axes(svg, { width, height, x0, x1, low, high, xlog, ylog,
      x: plain_marks((set.x_label || [''])[0]) });
    const near = (v) => Math.min(Math.max(v, -4 * height), 5 * height);
    for (const one of drawn) {
      const ink = { stroke: one.colour, 'stroke-width': one.width, 'stroke-dasharray': one.dash, fill: 'none',
        'stroke-linejoin': 'round', 'clip-path': clip, opacity: one.opacity };
      if (one.kind === 'vertical') {
        add(svg, 'path', { ...ink, d: `M${px(X(one.at))} ${top}V${height - bottom}` });
      } else if (one.kind === 'horizontal') {
        add(svg, 'path', { ...ink, d: `M${left} ${py(Y(one.at))}H${width - right}` });
      } else if (one.kind === 'band') {
        const upper = [], lower = [];
        one.x.forEach((v, i) => {
          const a = px(X(v)), b = py(Y(one.y[i])), c = py(Y(one.z[i]));
          if (![a, b, c].every(Number.isFinite)) return;
          upper.push(`${a.toFixed(1)} ${near(c).toFixed(1)}`);
          lower.unshift(`${a.toFixed(1)} ${near(b).toFixed(1)}`);
        });
        if (upper.length) add(svg, 'path', { ...ink, stroke: 'none', fill: one.colour, d: `M${[...upper, ...lower].join('L')}Z` });
      } else if (one.kind === 'points') {
        const r = one.marker ? 3.4 * one.size : 1.3 * one.size;
        let d = '';
        one.x.forEach((v, i) => {
          const a = px(X(v)), b = py(Y(one.y[i]));
          if (!Number.isFinite(a) || !Number.isFinite(b)) return;
          d += one.marker === 3 ? `M${a - r} ${b - r}h${2 * r}v${2 * r}h${-2 * r}z` :
            one.marker === 4 ? `M${a} ${b - r}l${r} ${1.8 * r}h${-2 * r}z` :
              one.marker === 5 ? `M${a - r} ${b - r}l${2 * r} ${2 * r}m0 ${-2 * r}l${-2 * r} ${2 * r}` :
                `M${a - r} ${b}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`;
        });
        add(svg, 'path', { ...ink, 'stroke-dasharray': 'none', d, fill: one.marker === 2 || one.marker === 5 ? 'none' : one.colour });
      } else {
        let d = '', down = false;
        one.x.forEach((v, i) => {
          const a = px(X(v)), b = py(Y(one.y[i]));
          if (!Number.isFinite(a) || !Number.isFinite(b)) { down = false; return; }
          d += `${down ? 'L' : 'M'}${a.toFixed(1)} ${near(b).toFixed(1)}`;
          down = true;
        });
        add(svg, 'path', { ...ink, d });
      }
    }
    for (const [x, y, words] of notes) {
      add(svg, 'text', { x: px(X(x)), y: py(Y(y)) + 4, fill: 'var(--text)', 'font-size': 11, 'font-family': 'system-ui, DejaVu Sans, sans-serif' }, words);
    }
  }
}

function draw_log() {
  if (log_result && !$('log').hidden) for (const figure of log_result.drawn) figure.draw();
}

// ---- the C of what is set: from the module of the logs, which is there when it is asked for ----

async function c_of_state() {
  const none = new Proxy({}, { get: () => () => 8 });
  const { exports } = await WebAssembly.instantiate(await log_module(), { page: none, wasi_snapshot_preview1: none });
  exports._initialize();
  const to = new Float64Array(exports.memory.buffer, exports.settings(), fields.length);
  fields.forEach((field, i) => { to[i] = state[field.name]; });
  const text_at = (at) => {
    const bytes = new Uint8Array(exports.memory.buffer, at);
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
  };
  const header = text_at(exports.c_header());
  return header && { header, source: text_at(exports.c_source()) };
}
$('savec').onclick = async () => {
  const code = await c_of_state();
  if (!code) {
    done('to_c writes C of LinearEso and CascadeEso without a known dead time; of this controller not yet.');
    return;
  }
  save('controller.h', 'text/x-chdr', code.header);
  save('controller.c', 'text/x-csrc', code.source);
  done('controller.h and controller.c saved.');
};

// ---- the two parts of the page ----

function view(which) {
  for (const name of ['play', 'log']) {
    $(name).hidden = name !== which;
    $('tab-' + name).setAttribute('aria-selected', name === which);
    $('tab-' + name).tabIndex = name === which ? 0 : -1;
  }
  if (which === 'log') draw_log();
  else if (result) draw(result);
}
for (const [name, other] of [['play', 'log'], ['log', 'play']]) {
  $('tab-' + name).onclick = () => view(name);
  $('tab-' + name).onkeydown = (event) => {
    if (!['ArrowLeft', 'ArrowRight'].includes(event.key)) return;
    view(other);
    $('tab-' + other).focus();
  };
}

// ---- the form ----

$('file').onchange = () => { if ($('file').files.length) take($('file').files[0]); };
$('study').onclick = study;
$('cancel').onclick = cancel;
$('options').onsubmit = (event) => { event.preventDefault(); study(); };
addEventListener('dragover', (event) => { event.preventDefault(); document.body.classList.add('over'); });
addEventListener('dragleave', (event) => { if (!event.relatedTarget) document.body.classList.remove('over'); });
addEventListener('drop', (event) => {
  event.preventDefault();
  document.body.classList.remove('over');
  if (!event.dataTransfer.files.length) return;
  view('log');
  take(event.dataTransfer.files[0]);
});
$('copylog').onclick = async () => {
  try {
    await navigator.clipboard.writeText(log_result.code);
    $('logdone').textContent = 'The C++ is copied.';
  } catch {
    $('logdone').textContent = 'This browser does not copy from a file: save it.';
  }
};
const stem = () => file.name.replace(/\.[^.]*$/, '');
$('savelog').onclick = () => save(stem() + '.cpp', 'text/x-c++src', log_result.code);
$('savelogsvg').onclick = () => save(stem() + '.svg', 'image/svg+xml',
  stacked(log_result.drawn.flatMap((figure) => figure.panels.map((one) => [one.svg, one.svg.getAttribute('aria-label')]))));
$('savelogcsv').onclick = () => save(stem() + '-figures.csv', 'text/csv', log_result.figures.map((one) => one.numbers).join(''));
$('toplay').onclick = () => {
  read(log_result.address);
  $('brought').textContent = log_result.taken;
  view('play');
  update(true);
  $('tab-play').focus();
  scrollTo(0, 0);
};

let shipped = null;
async function with_shipped(name) {
  if (!shipped) shipped = JSON.parse(new TextDecoder().decode(await unpacked(packed.logs)));
  const one = shipped.find((log) => log.name === name);
  for (const input of $('options').querySelectorAll('[data-option]')) {
    if (input.type === 'checkbox') input.checked = false;
    else input.value = one.options[input.dataset.option] || '';
  }
  $('more').value = '';
  $('source').hidden = false;
  $('source').querySelector('summary').textContent = one.source;
  $('source').querySelector('pre').textContent = one.licence;
  return take(new File([one.text], one.name.split('/').pop()));
}
for (const one of $('logs').querySelectorAll('button')) one.onclick = () => with_shipped(one.dataset.log);
new ResizeObserver(draw_log).observe($('found'));
busy(false);
