// The road ahead, the lane from above, and the wheel with both hands' torques on it: one instant of a drive.

// Bright, for they stand on the dark of road and dashboard in either theme.
const HANDS = { driver: "#7ab8ff", guidance: "#ffb066" };
const shade = name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

class Scene {
  #canvas; #pen; #colors = null;
  constructor(canvas) {
    this.#canvas = canvas;
    this.#pen = canvas.getContext("2d");
    const recolor = () => { this.#colors = null; };
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolor);
  }

  // instant: { s_m, lateral_error_m, heading_error_rad, wheel_angle_rad, driver_torque_nm, guidance_torque_nm, note, alarm }; the
  // road as [x, y, heading, curvature] every two metres.
  paint(instant, road) {
    const canvas = this.#canvas, ratio = Math.min(2, devicePixelRatio || 1), width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !road.length) return;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    this.#colors ??= Object.fromEntries(["sky", "land", "asphalt"].map(name => [name, shade(name)]));
    const pen = this.#pen;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.#road(instant, road, width, height);
    this.#lane(instant, width);
    this.#wheel(instant, width, height);
  }

  clear() { this.#canvas.width = 0; }

  // Whether a pointer is on the steering wheel.
  isWheel(event) {
    const box = this.#canvas.getBoundingClientRect(), { x, y, radius } = this.#rim(box.width, box.height);
    return Math.hypot(event.clientX - box.left - x, event.clientY - box.top - y) < radius + 14;
  }
  #rim(w, h) {
    const radius = Math.min(0.24 * h, 0.15 * w);
    return { radius, x: w / 2, y: h - radius - 10 };
  }

  #road(instant, road, w, h) {
    const pen = this.#pen, c = this.#colors, horizon = 0.3 * h, eye_m = 1.25, focal = 0.62 * w;
    pen.fillStyle = c.sky; pen.fillRect(0, 0, w, horizon);
    pen.fillStyle = c.land; pen.fillRect(0, horizon, w, h);
    const count = road.length / 4, first = Math.min(count - 1, Math.max(0, Math.floor(instant.s_m / 2)));
    const [x0, y0, heading0] = [0, 1, 2].map(k => road[4 * first + k]);
    // From the car: forward and left of the direction of movement.
    const beyond = instant.s_m - 2 * first, turned = heading0 + instant.heading_error_rad;
    const px = x0 + beyond * Math.cos(heading0) - instant.lateral_error_m * Math.sin(heading0);
    const py = y0 + beyond * Math.sin(heading0) + instant.lateral_error_m * Math.cos(heading0);
    const rows = [];
    for (let i = first; i < Math.min(count, first + 110); i++) {
      const [x, y, heading] = [road[4 * i] - px, road[4 * i + 1] - py, road[4 * i + 2] - turned];
      const forward = x * Math.cos(turned) + y * Math.sin(turned), left = y * Math.cos(turned) - x * Math.sin(turned);
      if (forward > 2) rows.push({ forward, left, sin: Math.sin(heading), cos: Math.cos(heading), s: 2 * i });
      else if (rows.length && forward < rows.at(-1).forward) break;
    }
    const at = (row, by) => { const x = Math.max(1, row.forward - by * row.sin); return [w / 2 - focal * (row.left + by * row.cos) / x, horizon + focal * eye_m / x]; };
    const band = (from, to, color, rows_) => {
      pen.fillStyle = color; pen.beginPath();
      for (const row of rows_) pen.lineTo(...at(row, from));
      for (let k = rows_.length - 1; k >= 0; k--) pen.lineTo(...at(rows_[k], to));
      pen.fill();
    };
    if (rows.length < 2) return;
    band(6.0, -2.6, c.asphalt, rows);
    band(-1.74, -1.88, "#fff", rows); band(5.5, 5.36, "#fff", rows);
    // The broken line moves with the road, and posts stand beside it.
    for (let k = 0; k + 1 < rows.length; k++) if (rows[k].s % 12 < 6) band(1.88, 1.74, "#fff", [rows[k], rows[k + 1]]);
    band(0.05, -0.05, "rgba(255,255,255,.28)", rows);
    for (const row of rows) {
      if (row.s % 50) continue;
      for (const side of [-3.4, 6.8]) {
        const [x, y] = at(row, side), tall = focal * 1 / row.forward;
        pen.fillStyle = "#f4f4f4"; pen.fillRect(x - tall * 0.06, y - tall, tall * 0.12, tall);
        pen.fillStyle = "#333"; pen.fillRect(x - tall * 0.06, y - 0.8 * tall, tall * 0.12, 0.22 * tall);
      }
    }
  }

  #text(text, x, y, { align = "left", color = "#fff", size = 13, bold = false } = {}) {
    const pen = this.#pen;
    pen.font = `${bold ? "600 " : ""}${size}px system-ui, sans-serif`;
    pen.textAlign = align; pen.fillStyle = color;
    pen.fillText(text, x, y);
  }

  // The lane from above: how far the car is from its middle, and how much room is left.
  #lane({ lateral_error_m }, w) {
    const pen = this.#pen, width = Math.min(w > 1000 ? 280 : 220, 0.5 * w), scale = width / 3.6, x = w / 2, top = 8, size = w > 1000 ? 15 : 12;
    pen.fillStyle = "rgba(20,28,38,.82)"; pen.fillRect(x - width / 2 - 8, top, width + 16, 40);
    pen.fillStyle = "#fff"; pen.fillRect(x - width / 2 - 2, top + 20, 3, 17); pen.fillRect(x + width / 2 - 1, top + 20, 3, 17);
    pen.fillStyle = "rgba(255,255,255,.45)"; pen.fillRect(x - 0.5, top + 20, 1, 17);
    const car = x - Math.max(-1.9, Math.min(1.9, lateral_error_m)) * scale;
    pen.fillStyle = Math.abs(lateral_error_m) > 0.95 ? "#ff7b6e" : "#e8edf2";
    pen.fillRect(car - 0.85 * scale, top + 22, 1.7 * scale, 13);
    const far = Math.abs(lateral_error_m);
    this.#text(far < 0.005 ? t("lane_middle") : t(lateral_error_m > 0 ? "lane_left" : "lane_right", { far: far.toFixed(2) }), x, top + 16, { align: "center", size });
  }

  #wheel(instant, w, h) {
    const pen = this.#pen, dash = 0.66 * h, { x, y, radius } = this.#rim(w, h);
    pen.fillStyle = "#18202a";
    pen.beginPath(); pen.moveTo(0, h); pen.lineTo(0, dash + 0.06 * h); pen.quadraticCurveTo(w / 2, dash - 0.05 * h, w, dash + 0.06 * h); pen.lineTo(w, h); pen.fill();
    pen.save(); pen.translate(x, y); pen.rotate(-instant.wheel_angle_rad);
    pen.strokeStyle = "#8d99a6"; pen.lineWidth = Math.max(6, 0.13 * radius);
    pen.beginPath(); pen.arc(0, 0, radius, 0, 2 * Math.PI); pen.stroke();
    pen.lineWidth = Math.max(5, 0.1 * radius);
    pen.beginPath(); pen.moveTo(-radius, 0); pen.lineTo(radius, 0); pen.moveTo(0, 0); pen.lineTo(0, radius); pen.stroke();
    pen.fillStyle = "#f4c542"; pen.beginPath(); pen.arc(0, -radius, 0.09 * radius, 0, 2 * Math.PI); pen.fill();
    pen.restore();
    this.#arrow(x, y, radius + 12, instant.driver_torque_nm, HANDS.driver);
    this.#arrow(x, y, radius + 25, instant.guidance_torque_nm, HANDS.guidance);
    const side = nm => Math.abs(nm) < 0.005 ? "" : t(nm > 0 ? "to_left" : "to_right");
    const small = w < 560, size = small ? 12 : w > 1000 ? 19 : 14, foot = h - 2 * size - 12;
    const label = (name, symbol, nm, at, align, color) => {
      this.#text(small ? name : `${name} ${symbol}`, at, foot, { align, color, size, bold: true });
      this.#text(`${Math.abs(nm).toFixed(2)} N.m ${side(nm)}`.trim(), at, foot + size + 5, { align, size });
    };
    label(t("hands_driver"), "T_d", instant.driver_torque_nm, 12, "left", HANDS.driver);
    label(t("hands_guidance"), "T_h", instant.guidance_torque_nm, w - 12, "right", HANDS.guidance);
    if (instant.name) {
      pen.fillStyle = shade(instant.name); pen.fillRect(10, 8, 30, 30);
      this.#text(instant.name.toUpperCase(), 25, 29, { align: "center", size: 18, bold: true, color: shade("card") });
    }
    if (instant.note) this.#text(instant.note, w - 12, 24, { align: "right", size: 12, bold: true, color: shade("ink") });
    if (instant.alarm) {
      pen.font = "600 15px system-ui, sans-serif";
      // Beside the arrows, where they reach that high.
      const wide = pen.measureText(instant.alarm).width + 24, at = y - radius - 35 > 80 ? x : wide / 2 + 10;
      pen.fillStyle = "#b3261e"; pen.fillRect(at - wide / 2, 54, wide, 26);
      this.#text(instant.alarm, at, 72, { align: "center", size: 15, bold: true });
    }
  }

  // A torque along the rim, from its top towards the side where it turns the wheel: 1 N.m is a quarter of a turn.
  #arrow(x, y, radius, nm, color) {
    const pen = this.#pen, angle = Math.max(-2.6, Math.min(2.6, -nm * Math.PI / 2));
    pen.fillStyle = color;
    for (const [wide, shade] of [[10, "#18202a"], [7, color]]) {
      pen.strokeStyle = shade; pen.lineWidth = wide;
      pen.beginPath(); pen.arc(x, y, radius, -Math.PI / 2, -Math.PI / 2 + angle, angle < 0); pen.stroke();
    }
    if (Math.abs(angle) < 0.02) return;
    pen.save(); pen.translate(x, y); pen.rotate(angle); pen.translate(0, -radius); pen.scale(Math.sign(angle), 1);
    pen.beginPath(); pen.moveTo(0, -9); pen.lineTo(13, 0); pen.lineTo(0, 9); pen.fill();
    pen.restore();
  }
}
