// Makes each figure of the report live: drag to zoom, double-click to see all again, values under the cursor.
// The data stand beside each figure as JSON; nothing is loaded. Without this script, and on paper, the drawing shows.
(function () {
  "use strict";
  const HEIGHT = 230;
  const BAND = { light: "rgba(0,0,0,0.05)", dark: "rgba(0,0,0,0.12)", alert: "rgba(213,94,0,0.2)" };
  const SHADED = { light: "lightly shaded: ", dark: "shaded: ", alert: "shaded in colour: " };

  // A colour with an opacity.
  function pale(colour, opacity) {
    const channel = (i) => parseInt(colour.slice(i, i + 2), 16);
    return `rgba(${channel(1)},${channel(3)},${channel(5)},${opacity})`;
  }

  // Numbers as they can be copied elsewhere: no separator of thousands.
  function plain(u, ticks) {
    return ticks.map((v) => (v == null ? "" : String(Number(v.toPrecision(10)))));
  }

  // The drawing within the axes, until it is restored.
  function clipped(u) {
    const { left, top, width, height } = u.bbox;
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(left, top, width, height);
    u.ctx.clip();
    return u.ctx;
  }

  // Shaded stretches below everything, markers above them.
  function backdrop(figure, panel) {
    return (u) => {
      const { top, height } = u.bbox;
      const c = clipped(u);
      for (const band of figure.bands) {
        if (band.panel !== null && band.panel !== panel) continue;
        const from = u.valToPos(band.from, "x", true);
        c.fillStyle = BAND[band.shade];
        c.fillRect(from, top, u.valToPos(band.to, "x", true) - from, height);
      }
      c.strokeStyle = "#555";
      c.lineWidth = 1.5 * devicePixelRatio;
      c.setLineDash([2 * devicePixelRatio, 2 * devicePixelRatio]);
      for (const marker of figure.markers) {
        const x = u.valToPos(marker.x, "x", true);
        c.beginPath();
        c.moveTo(x, top);
        c.lineTo(x, top + height);
        c.stroke();
      }
      c.restore();
    };
  }

  // Stems and bounds from zero, the intervals of single points, and crosses where lines end.
  function uprights(panel) {
    return (u) => {
      const c = clipped(u);
      c.lineWidth = 1.2 * devicePixelRatio;
      for (const series of panel.series) {
        const fromZero = series.mark === "stems" || series.mark === "bounds";
        const ends = fromZero ? series.y.map((y) => [0, y]) : series.ends || [];
        c.strokeStyle = series.colour;
        c.setLineDash(series.mark === "bounds" ? [2 * devicePixelRatio, 2 * devicePixelRatio] : []);
        ends.forEach(([low, high], i) => {
          const x = u.valToPos(series.x[i], "x", true);
          c.beginPath();
          c.moveTo(x, u.valToPos(low, "y", true));
          c.lineTo(x, u.valToPos(high, "y", true));
          c.stroke();
        });
        if (series.mark !== "ends") continue;
        const half = 5 * devicePixelRatio;
        series.x.forEach((place, i) => {
          const [x, y] = [u.valToPos(place, "x", true), u.valToPos(series.y[i], "y", true)];
          c.beginPath();
          c.moveTo(x - half, y - half);
          c.lineTo(x + half, y + half);
          c.moveTo(x - half, y + half);
          c.lineTo(x + half, y - half);
          c.stroke();
        });
      }
      c.restore();
    };
  }

  // One column of values for a line or for points, two for an area.
  function columns(series) {
    if (series.mark !== "interval") return [[series.x, series.y]];
    return [[series.x, series.y], [series.x, series.high]];
  }

  // A value under the cursor with so many digits.
  function read(digits) {
    return (u, v) => (v == null ? "" : String(Number(v.toPrecision(digits))));
  }

  // What stands before a name: the line with its dashes, the dot, the cross, the area.
  function swatch(series) {
    const dots = ["dots", "whiskers", "stems", "bounds"].includes(series.mark);
    const stroke = `fill="none" stroke="${series.colour}" stroke-width="${series.width}"`;
    let drawn = "";
    if (series.mark === "line" || series.joined) {
      drawn += `<path d="M0 6H40" ${stroke} stroke-dasharray="${series.dash.join(" ")}"/>`;
    }
    if (dots) drawn += `<circle cx="20" cy="6" r="3.5" fill="${series.colour}"/>`;
    if (series.mark === "ends") drawn += `<path d="M15 1L25 11M15 11L25 1" ${stroke}/>`;
    if (series.mark === "interval") {
      drawn += `<rect x="10" width="20" height="12" fill="${series.colour}" fill-opacity="0.25"/>`;
    }
    return `<svg class="swatch" width="40" height="12">${drawn}</svg>`;
  }

  function look(series, index, unnamed) {
    const points = !["line", "interval", "ends"].includes(series.mark);
    const label = series.label || unnamed;
    const lines = series.mark === "line" || series.joined;
    if (series.mark === "interval") {
      return {
        label: label + (index ? ", to" : ", from"),
        stroke: pale(series.colour, 0.5),
        width: 0.5,
        points: { show: false },
        value: read(5),
      };
    }
    return {
      label,
      stroke: series.colour,
      width: lines ? series.width : 0,
      dash: series.dash.length ? series.dash : undefined,
      paths: lines ? undefined : () => null,
      points: points ? { show: true, size: 7, fill: series.colour, width: 0 } : { show: false },
      value: read(5),
    };
  }

  function chart(figure, panel, last, place, siblings, key) {
    const tables = panel.series.flatMap(columns);
    const data = tables.length ? uPlot.join(tables.map(([x, y]) => [x, y])) : [[]];
    const shown = [{ label: figure.x || "x", value: read(6) }];
    const areas = [];
    for (const series of panel.series) {
      if (series.mark === "interval") {
        areas.push({ series: [shown.length + 1, shown.length], fill: pale(series.colour, 0.25) });
      }
      columns(series).forEach((_, i) => shown.push(look(series, i, panel.label)));
    }
    const whole = figure.limits;
    const options = {
      width: place.clientWidth,
      height: HEIGHT,
      title: panel.title || undefined,
      series: shown,
      legend: { markers: { show: false } },
      bands: areas,
      pxAlign: 0,
      scales: {
        x: { time: false, range: (u, low, high) => (low == null ? whole : [low, high]) },
        y: panel.limits ? { range: () => panel.limits } : {},
      },
      axes: [
        {
          label: last ? figure.x : undefined,
          size: last ? 34 : 24,
          values: plain,
          incrs: figure.whole ? [1, 2, 5, 10, 20, 50, 100] : undefined,
        },
        { label: panel.label, size: 66, values: plain },
      ],
      // The cursor moves in all panels, a drag is one panel's: its scale goes to the others below.
      cursor: {
        sync: { key, filters: { pub: (type) => type !== "mousedown" && type !== "mouseup" } },
        drag: { x: true, y: false },
      },
      hooks: {
        drawClear: [backdrop(figure, siblings.length)],
        draw: [uprights(panel)],
        ready: [(u) => u.setScale("x", { min: whole[0], max: whole[1] })],
        setScale: [
          (u, scale) => {
            if (scale !== "x") return;
            const { min, max } = u.scales.x;
            for (const other of siblings) {
              if (other !== u && (other.scales.x.min !== min || other.scales.x.max !== max)) {
                other.setScale("x", { min, max });
              }
            }
          },
        ],
      },
    };
    const made = new uPlot(options, data, place);
    const names = made.root.querySelectorAll(".u-legend .u-series th");
    const swatches = panel.series.flatMap((series) => columns(series).map(() => swatch(series)));
    swatches.forEach((drawn, i) => names[i + 1].insertAdjacentHTML("afterbegin", drawn));
    // Why lines end is said once.
    const said = new Set();
    panel.series.flatMap((series) => columns(series).map(() => series)).forEach((series, i) => {
      if (series.mark !== "ends") return;
      if (said.has(series.label)) names[i + 1].closest(".u-series").style.display = "none";
      said.add(series.label);
    });
    // The whole stretch again, not only as far as this panel's data reach.
    made.over.addEventListener("dblclick", () => made.setScale("x", { min: whole[0], max: whole[1] }));
    siblings.push(made);
  }

  document.querySelectorAll("figure").forEach((element, number) => {
    const source = element.querySelector("script[type='application/json']");
    if (!source) return;
    const figure = JSON.parse(source.textContent);
    const place = document.createElement("div");
    place.className = "charts";
    element.insertBefore(place, element.firstChild);
    element.classList.add("live");
    const siblings = [];
    figure.panels.forEach((panel, i) => {
      chart(figure, panel, i + 1 === figure.panels.length, place, siblings, "figure-" + number);
    });
    const keys = new Set(figure.markers.map((m) => "dotted: " + m.label));
    for (const band of figure.bands) keys.add(SHADED[band.shade] + band.label);
    if (keys.size) {
      const line = document.createElement("div");
      line.className = "keys";
      line.textContent = [...keys].join("; ");
      place.append(line);
    }
    addEventListener("resize", () => {
      for (const made of siblings) made.setSize({ width: place.clientWidth, height: HEIGHT });
    });
  });
})();
