'use strict';
// A log, away from the page: the page draws and answers meanwhile, and to cancel is to end this worker.

onmessage = async ({ data: { module, file, words } }) => {
  let api = null, told = 0;
  const text = (at) => {
    const bytes = new Uint8Array(api.memory.buffer, at);
    return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
  };
  const put = (at, bytes) => new Uint8Array(api.memory.buffer, at >>> 0, bytes.length).set(bytes);
  // It has no files; what it says on stderr beside the page goes nowhere.
  const system = { fd_write: (file_, parts, count, written) => {
    const view = new DataView(api.memory.buffer);
    let all = 0;
    for (let i = 0; i < count; ++i) all += view.getUint32(parts + 8 * i + 4, true);
    view.setUint32(written, all, true);
    return 0;
  } };
  const refusal = class extends Error {};
  const page = {
    refuse: (why) => { throw new refusal(text(why)); },
    progress: (what, share) => {
      if (share > 0 && share < 1 && performance.now() - told < 50) return;
      told = performance.now();
      postMessage({ what: text(what), share });
    },
  };
  try {
    api = (await WebAssembly.instantiate(module, { page,
      wasi_snapshot_preview1: new Proxy(system, { get: (all, name) => all[name] || (() => 8) }) })).exports;
    api._initialize();
    const bytes = new Uint8Array(await file.arrayBuffer());
    put(api.file(bytes.length), bytes);
    const given = new TextEncoder().encode(words.join('\0'));
    put(api.arguments(given.length), given);
    const status = api.study();
    const figures = [];
    for (let i = 0; i < api.figures(); ++i) figures.push({ description: text(api.description(i)), numbers: text(api.points(i)) });
    postMessage({ status, figures, header: text(api.header()), main: text(api.main_text()),
      code: text(api.code()), address: text(api.address()), taken: text(api.taken()) });
  } catch (problem) {
    // Without memory it stops where it is.
    postMessage({ error: problem instanceof refusal ? problem.message :
      file.size > 2e7 ? 'The memory of a page is not enough for this file; the program from_log reads it, too.' :
        'The module stopped: ' + problem.message });
  }
};
