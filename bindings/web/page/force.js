// A steering wheel whose torque can be felt: the constant force of Logitech's wheels over WebHID. It was never tried on hardware, only
// against a fake device.
//
// The hand feels what the column holds against it, -T_d, in the part that is chosen. A report has seven bytes: a command in the first slot,
// the kind of force, and its level, where 0x80 is none. Which way a level turns the wheel is tried out, gently, before anything else.

// `motor_nm` is the torque of a level of 1. No more than `most` of the motor's strength is asked for: a hand has to be able to hold it.
// `ramp_per_s`: no force comes as a jerk. `trial` is the level that finds the way, for at most `trial_s`, until the wheel has turned by
// `turned_rad`. `silent_ms` without a picture end the force, as the page may hang.
const FELT = { vendor: 0x046d, motor_nm: 2.5, most: 0.4, ramp_per_s: 2, trial: 0.2, trial_s: 1.5, turned_rad: 0.05, silent_ms: 150, report_bits: 56 };
const NO_SPRING = Uint8Array.of(0xf5, 0, 0, 0, 0, 0, 0), NO_FORCE = Uint8Array.of(0x13, 0, 0, 0, 0, 0, 0);
const constantForce = level => Uint8Array.of(0x11, 0x08, 0x80 + Math.round(127 * level), 0x80, 0, 0, 0);
const between = (value, most) => Math.max(-most, Math.min(most, value));
// Whether a device takes a report of seven bytes without a number.
const takesForce = device => device.collections.some(({ outputReports }) => outputReports?.some(({ reportId, items }) =>
  reportId === 0 && items.reduce((bits, item) => bits + item.reportSize * item.reportCount, 0) === FELT.report_bits));

class FeltWheel {
  #device = null; #busy = Promise.resolve(); #sending = false; #stopped = true; #held = false; #level = 0; #last = 0; #heard = 0; #way = 0; #trial = null; #told;
  part = 0.5;

  constructor(told) {
    this.#told = told;
    setInterval(() => { if (!this.#stopped && performance.now() - this.#heard > FELT.silent_ms) this.stop(); }, 50);
    addEventListener("blur", () => this.hold(false));
    addEventListener("pagehide", () => this.hold(false));
    document.addEventListener("visibilitychange", () => this.hold(false));
  }

  get isThere() { return this.#device !== null; }
  get level() { return this.#level; }

  async connect() {
    const hid = navigator.hid;
    if (!hid) { this.#told(t("felt_no_hid")); return; }
    try {
      const [device] = await hid.requestDevice({ filters: [{ vendorId: FELT.vendor }] });
      if (!device) { this.#told(t("felt_none")); return; }
      if (!device.opened) await device.open();
      if (!takesForce(device)) { await device.close(); this.#told(t("felt_other", { name: device.productName })); return; }
      hid.addEventListener("disconnect", ({ device: gone }) => { if (gone === this.#device) this.#lose(t("felt_gone")); });
      [this.#device, this.#way, this.#stopped] = [device, 0, false];
      this.#send(NO_SPRING);
      this.stop();
      this.#told(t("felt_ready", { name: device.productName }));
    } catch (error) { this.#lose(t("felt_wrong", { what: error.message })); }
  }

  #lose(why) {
    [this.#device, this.#held, this.#level, this.#stopped] = [null, false, 0, true];
    this.#told(why);
  }

  // One report after the other; the last of them always.
  #send(bytes) {
    const device = this.#device;
    this.#sending = true;
    const mine = this.#busy = this.#busy.then(() => device.sendReport(0, bytes)).catch(error => { if (device === this.#device) this.#lose(t("felt_wrong", { what: error.message })); })
      .then(() => { if (mine === this.#busy) this.#sending = false; });
  }

  // The dead man's key: force only while it is down.
  hold(on) {
    this.#held = on;
    if (!on) this.stop();
  }

  stop() {
    [this.#level, this.#trial] = [0, null];
    if (!this.#device || this.#stopped) return;
    this.#stopped = true;
    this.#send(NO_FORCE);
  }

  // A picture of a drive: the torque that the hand holds against, to the left +, and where the wheel is.
  frame(time, torque_nm, wheel_rad) {
    const gone_s = Math.min(0.05, Math.max(0, (time - this.#last) * 1e-3));
    [this.#last, this.#heard] = [time, performance.now()];
    if (!this.#device || !this.#held) { this.stop(); return; }
    const wanted = this.#way ? this.#way * this.part * torque_nm / FELT.motor_nm : this.#find(time, wheel_rad);
    this.#level += between(between(wanted, FELT.most) - this.#level, FELT.ramp_per_s * gone_s);
    // A device that is slower than the pictures gets the newest force only.
    if (this.#sending || !this.#held) return;
    this.#stopped = false;
    this.#send(constantForce(this.#level));
  }

  // The level that is tried, until the wheel has turned.
  #find(time, wheel_rad) {
    this.#trial ??= { time, wheel_rad };
    const turned = wheel_rad - this.#trial.wheel_rad;
    if (Math.abs(turned) > FELT.turned_rad) {
      this.#way = Math.sign(turned);
      this.#told(t("felt_found"));
      return 0;
    }
    if (time - this.#trial.time > 1000 * FELT.trial_s) { this.hold(false); this.#told(t("felt_lost")); return 0; }
    return FELT.trial;
  }
}
