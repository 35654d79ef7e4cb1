// Run in the page by `cargo xtask web`: what it finds stands in #report, a line for each check.
const report = [];
const check = (name, good, what) => report.push(`${good ? "ok" : "FAILED"} ${name}: ${what}`);

// Equations (7) and (8) at 1 kHz with a delay of whole milliseconds, and a hand that trembles: a driver whom nobody told the
// page of.
function synthetic({ t_p_ms, a_1, a_2, a_3, k_d, k_nms, t_nms, tremble_nm }) {
  const seen = [];
  let integral = 0, torque = 0, noise = 0, seed = 2463534242;
  // Xorshift of 32 bits.
  const uniform = () => {
    seed ^= seed << 13; seed ^= seed >>> 17; seed ^= seed << 5;
    return (seed >>> 0) / 4294967296;
  };
  const gauss = () => Math.sqrt(-2 * Math.log(uniform() + 1e-12)) * Math.cos(2 * Math.PI * uniform());
  const decay = Math.exp(-2 * Math.PI * 0.5 * 1e-3);
  return now => {
    integral += 1e-3 * now.e_y_m;
    seen.push(a_1 * now.e_y_m + a_2 * integral + a_3 * now.e_theta_rad);
    const target = seen[seen.length - 1 - t_p_ms] ?? 0;
    torque += 1e-3 / t_nms * (k_d * target + k_nms * (target - now.wheel_angle_rad) - torque);
    noise = decay * noise + tremble_nm * Math.sqrt(1 - decay * decay) * gauss();
    return torque + noise;
  };
}

async function tests() {
  page.choose(false);
  lab.begin('speed = 60\ncondition = "mid"\n[driver]\nt_p = 0.3\n');
  while (lab.play(10000) === 10000);
  const [ours, theirs] = [lab.csv().trimEnd().split("\n"), EXPECTED.trimEnd().split("\n")];
  const differing = theirs.filter((line, i) => line !== ours[i]).length + Math.abs(ours.length - theirs.length);
  check("command line", differing === 0, `${theirs.length} lines of run.csv, ${differing} differ`);

  const before = JSON.stringify(lab.now());
  let said = "";
  try { lab.begin("speed = 900"); } catch (error) { said = error.message; }
  check("bad input", said.includes("speed") && said.includes("250") && JSON.stringify(lab.now()) === before, said);

  page.choose(true);
  document.getElementById("guided").value = "off";
  lab.begin(page.scenario(true));
  const truth = { t_p_ms: 280, a_1: 0.1, a_2: 0.05, a_3: 3.7, k_d: 4, k_nms: 1, t_nms: 0.1, tremble_nm: 0.1 };
  const hand = synthetic(truth);
  let now = lab.now();
  while (lab.step(hand(now), { engage: false })) now = lab.now();
  const found = lab.identify(true), t_p = found.parameters.find(p => p.name === "t_p").found;
  const [low, high] = t_p.interval_95 ?? [NaN, NaN];
  check("synthetic driver", t_p.identified && Math.abs(t_p.estimate - 0.28) < 0.02,
    `${now.time_s.toFixed(0)} s to ${now.s_m.toFixed(0)} m, t_p ${t_p.estimate?.toFixed(4)} s (${low.toFixed(3)} to ${high.toFixed(3)}), truth 0.280 s; ${t_p.identified ? "" : JSON.stringify(found)}`);

  // The way of a person: pointer over the picture, real time, then stop.
  lab.begin(page.scenario(true));
  page.drive();
  const road = document.getElementById("road"), box = road.getBoundingClientRect();
  road.dispatchEvent(new PointerEvent("pointermove", { clientX: box.left + 0.4 * box.width, clientY: box.top + 50 }));
  for (let k = 0; k < 80 && lab.now().time_s < 0.5; k++) await new Promise(done => setTimeout(done, 250));
  const driven = lab.now();
  check("pointer", driven.time_s >= 0.5 && driven.wheel_angle_rad > 0.02,
    `after ${driven.time_s.toFixed(1)} s the wheel is at ${driven.wheel_angle_rad.toFixed(3)} rad`);
  page.end();
  await new Promise(done => setTimeout(done, 200));
  check("too short a drive", document.getElementById("result").textContent.includes("10 s"),
    document.getElementById("result").textContent);

  // What the page says of a drive is for whoever drove it: a hand that pulls the car off the road, one that holds nothing, and
  // the guidance alone.
  const command_line = /--|\bline \d|_nm\b|_rad\b|_m\b|CSV|\blog\b/;
  const told = (guided, hand) => {
    document.getElementById("guided").value = guided ? "on" : "off";
    lab.begin(page.scenario(true));
    while (lab.now().s_m < 1500 && lab.step(hand(lab.now()), { engage: guided }));
    page.show(!guided);
    return [...document.querySelectorAll("#result p")].map(p => p.textContent).join(" ");
  };
  const after = s => now => now.time_s < s ? synthetic_hand(now) : 4;
  const synthetic_hand = synthetic(truth);
  const left = told(false, after(20));
  check("off the road", /At \d+\.\d s .*beyond/.test(left) && !command_line.test(left), left);
  const nobody = told(true, () => 0);
  check("nobody's hands", /nobody held the wheel|cannot be told|does not fit/.test(nobody) && !command_line.test(nobody), nobody);
  const guided = told(true, synthetic(truth));
  check("a guided drive", guided.length > 0 && !command_line.test(guided), guided);
  document.getElementById("guided").value = "off";

  // Left behind for the picture: the synthetic drive on the road, its charts and what was found.
  lab.begin(page.scenario(true));
  const again = synthetic(truth);
  now = lab.now();
  while (now.s_m < 1250 && lab.step(again(now), { engage: false })) now = lab.now();
  page.draw(); page.paint(page.facts()); page.show(true);
}
const wait = setInterval(() => {
  if (!document.body.dataset.ready) return;
  clearInterval(wait);
  tests().catch(error => check("script", false, `${error} ${error.stack}`)).finally(() => {
    const place = document.getElementById("report");
    place.textContent = report.join("\n") + "\nend";
    place.hidden = true;
  });
}, 20);
