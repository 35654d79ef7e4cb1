// The closed loop in WebAssembly, for the page and for its workers. Every number of a drive comes from here.

const CHANNEL = { time: 0, e_y: 1, e_theta: 2, wheel: 3, guidance: 4, driver: 5, error: 6, s: 7, heading: 8, limited: 15,
  assist: 19, mode: 20, limit: 21, warning: 22, k_hg: 23, deviation: 24, read: 25, taken: 26 };
const NOW = ["time_s", "s_m", "lateral_error_m", "heading_error_rad", "wheel_angle_rad", "driver_torque_nm",
  "guidance_torque_nm", "mode", "limit", "warning", "e_y_m", "e_theta_rad", "speed_m_per_s", "wheel_rate_rad_per_s",
  "steps", "diverged", "k_hg", "deviation", "taken_nm"];

// `law` gets the ten numbers that a law of the page's own sees, and returns its torque.
async function engine(bytes, law = () => 0) {
  const env = { law: at => law(new Float64Array(wasm.memory.buffer, at, 10)) };
  const wasm = (await WebAssembly.instantiate(bytes, { env })).instance.exports;
  const numbers = (at, count = wasm.count()) => new Float64Array(wasm.memory.buffer, at, count).slice();
  const answer = () => {
    // The place first: the length is another call.
    const at = wasm.text(), length = wasm.text_length();
    return new TextDecoder().decode(new Uint8Array(wasm.memory.buffer, at, length));
  };
  const give = text => {
    const bytes = new TextEncoder().encode(text);
    const at = wasm.take(bytes.length);
    new Uint8Array(wasm.memory.buffer, at, bytes.length).set(bytes);
  };
  const ask = good => { const said = answer(); if (!good) throw new Error(said); return said; };
  return {
    begin(toml, { law = -1, person = false } = {}) { give(toml); ask(wasm.begin(law, +person)); },
    play: steps => wasm.play(steps),
    step: (hand_nm, { steps = 1, engage = true, authority = 1, torque_lost = false, lane_lost = false } = {}) =>
      wasm.step(steps, hand_nm, +engage, authority, +torque_lost, +lane_lost),
    now: () => { const values = numbers(wasm.now(), NOW.length); return Object.fromEntries(NOW.map((name, i) => [name, values[i]])); },
    road: every_m => numbers(wasm.road(every_m)),
    channel: name => numbers(wasm.channel(CHANNEL[name])),
    metrics: (from_m, to_m) => JSON.parse(ask(wasm.metrics(from_m, to_m))),
    peakIfLost: (what, lasts_s) => wasm.peak_if_lost(+(what === "input"), lasts_s),
    csv: () => ask(wasm.csv()),
    fourteen: () => JSON.parse(ask(wasm.fourteen())),
    laws: () => JSON.parse(ask(wasm.laws())),
    course(name, text) { give(`${name}\n${text}`); return Number(ask(wasm.keep_course())); },
    identify(csv, manual) { give(csv); return JSON.parse(ask(wasm.identify(+manual))); },
    replay(bus) { give(bus); return ask(wasm.replay()); },
  };
}
