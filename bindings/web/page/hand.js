// A person drives: pointer, keys, gamepad or steering wheel to a torque, in real time, one step a millisecond.

// A hand holds the wheel like a spring towards where it wants it.
const HAND = { stiffness_nm_per_rad: 8, damping_nm_s_per_rad: 0.6, most_nm: 8, range_rad: 0.6, key_rad_per_s: 0.5, wheel_rad: 450 * Math.PI / 180 };
const MOST_STEPS = 120;

class LiveDrive {
  #lab; #target_rad = 0; #keys = 0; #last = null; #real_ms = 0; #driven_ms = 0; #rumbled = 0;
  going = false; settings = null; failed_s = Infinity; road = []; told = ""; note = ""; asked = ""; give = null; isFelt = () => false;

  constructor(lab, canvas) {
    this.#lab = lab;
    const steer = event => {
      if (!this.going) return;
      const box = canvas.getBoundingClientRect();
      this.#target_rad = HAND.range_rad * (1 - 2 * (event.clientX - box.left) / box.width);
      this.told = t("input_found", { what: t("input_mouse") });
    };
    canvas.addEventListener("pointermove", steer);
    canvas.addEventListener("pointerdown", steer);
    const key = (event, on) => {
      const way = { ArrowLeft: 1, ArrowRight: -1 }[event.key];
      if (!way || !this.going || event.target.matches?.("input, select, textarea, [role=slider]")) return;
      this.#keys = on ? way : this.#keys === way ? 0 : this.#keys;
      this.told = t("input_found", { what: t("input_keys") });
      event.preventDefault();
    };
    addEventListener("keydown", event => key(event, true));
    addEventListener("keyup", event => key(event, false));
    addEventListener("blur", () => { this.#keys = 0; });
  }

  // `give` steers in the place of a person: a torque for an instant.
  begin(settings, give = null) {
    const guided = settings.guided !== "off";
    this.settings = { course: settings.course, speed: settings.speed, guided, law: "shipping" };
    this.#lab.begin(scenario(this.settings, { person: true }), { person: true });
    this.failed_s = settings.guided === "surprise" ? 12 + 40 * Math.random() : Infinity;
    this.road = this.#lab.road(2);
    this.give = give;
    [this.#target_rad, this.#last, this.#real_ms, this.#driven_ms] = [0, null, 0, 0];
    this.going = true;
  }

  now() { return this.#lab.now(); }
  get target_rad() { return this.#target_rad; }

  #torque(now) {
    if (this.give) return this.give(now);
    const wanted = HAND.stiffness_nm_per_rad * (this.#target_rad - now.wheel_angle_rad) - HAND.damping_nm_s_per_rad * now.wheel_rate_rad_per_s;
    return Math.max(-HAND.most_nm, Math.min(HAND.most_nm, wanted));
  }

  // So many milliseconds of the drive; false where it ends.
  advance(steps) {
    for (let k = 0; k < steps; k++) {
      const now = this.#lab.now();
      if (!this.#lab.step(this.#torque(now), { engage: this.settings.guided, torque_lost: now.time_s >= this.failed_s })) {
        this.going = false;
        return false;
      }
    }
    return true;
  }

  // The next picture. Who was away does not drive blindly meanwhile.
  frame(time) {
    const gone = this.#last === null ? 0 : time - this.#last;
    this.#last = time;
    const steps = Math.max(0, Math.min(MOST_STEPS, Math.round(gone)));
    this.#pads(steps * 1e-3, time);
    if (gone > 1000) { this.told = t("drive_paused"); return true; }
    [this.#real_ms, this.#driven_ms] = [0.97 * this.#real_ms + gone, 0.97 * this.#driven_ms + steps];
    if (this.#real_ms > 2000 && this.#driven_ms < 0.9 * this.#real_ms) this.told = t("drive_slow", { share: (100 * this.#driven_ms / this.#real_ms).toFixed(0) });
    return this.advance(steps);
  }

  #pads(dt_s, time) {
    const pad = [...navigator.getGamepads?.() ?? []].find(found => found?.connected);
    // A pad that rests is not the hand that steers; a wheel that is felt always is.
    if (pad && (this.isFelt() || Math.abs(pad.axes[0]) > 0.02)) {
      const isWheel = /wheel|racing|g2[0-9]|g9[0-9]{2}|t[0-9]{3}|fanatec/i.test(pad.id);
      this.#target_rad = -pad.axes[0] * (isWheel ? HAND.wheel_rad : HAND.range_rad);
      this.told = t("input_found", { what: t("input_wheel", { name: pad.id.slice(0, 40) }) });
    }
    const rumble = pad?.vibrationActuator;
    if (rumble && time - this.#rumbled > 100) {
      this.#rumbled = time;
      const strength = Math.min(1, Math.abs(this.#lab.now().guidance_torque_nm));
      rumble.playEffect?.("dual-rumble", { duration: 120, strongMagnitude: strength, weakMagnitude: 0 })?.catch?.(() => {});
      if (!this.told.includes(t("input_rumble"))) this.told += ` ${t("input_rumble")}`;
    }
    this.#target_rad += this.#keys * HAND.key_rad_per_s * dt_s;
    const most = Math.max(HAND.range_rad, Math.abs(this.#target_rad) > HAND.range_rad && pad ? HAND.wheel_rad : 0);
    this.#target_rad = Math.max(-most, Math.min(most, this.#target_rad));
  }

  end() { this.going = false; }

  // What was driven so far, as a drive of the model's is.
  result() {
    const channels = {};
    for (const name of Object.keys(CHANNEL)) channels[name] = this.#lab.channel(name);
    return { channels, road: this.road, now: this.#lab.now(), failed_s: this.failed_s };
  }

  csv() { return this.#lab.csv(); }
}

// What an identification found, for whoever drove.
function foundList(found, guided) {
  const names = { t_p: "found_delay", gain_1: "found_1", gain_2: "found_2", gain_3: "found_3", k_hg: "found_k_hg" };
  const order = Object.keys(names), place = ({ name }) => order.indexOf(name);
  const rows = [...found.parameters].sort((a, b) => place(a) - place(b)).filter(({ name }) => names[name] && (guided || name !== "k_hg")).map(({ name, unit, found: p, fourteen }) => {
    const digits = name === "gain_3" ? 1 : 2, text = value => value.toFixed(digits);
    const said = p.identified && p.interval_95
      ? t("found_interval", { value: text(p.estimate), unit: unit === "-" ? "" : unit, low: text(p.interval_95[0]), high: text(p.interval_95[1]) }).replace(" ;", ";")
      : t("found_not");
    const beside = t("found_fourteen", { low: text(fourteen[0]), high: text(fourteen.at(-1)), median: text((fourteen[6] + fourteen[7]) / 2) });
    return el("div", {}, el("dt", {}, t(names[name])), el("dd", {}, said, " ", el("small", {}, beside)));
  });
  return [el("dl", {}, ...rows), el("p", {}, t("found_fit", { fit: found.fit_percent.toFixed(0) })), ...found.notes.map(note => el("p", {}, note))];
}
