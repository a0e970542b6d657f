"use strict";
(() => {
  const { axes, cubes, named } = JSON.parse(document.getElementById("data").textContent);
  const state = {};
  for (const [name, axis] of Object.entries(axes)) state[name] = axis.d;
  const all = (what, where = document) => [...where.querySelectorAll(what)];

  // Where the value at a place stands in a cube; -1 where it has none.
  const indexOf = (cube, place) => {
    let found = 0;
    for (let k = 0; k < cube.d.length; k++) {
      const here = cube.a[k].indexOf(place[cube.d[k]]);
      if (here < 0) return -1;
      found = found * cube.a[k].length + here;
    }
    return found;
  };
  const placeOf = (text) => {
    const place = { ...state };
    for (const one of text ? text.split(";") : []) {
      const at = one.lastIndexOf(":");
      place[one.slice(0, at)] = Number(one.slice(at + 1));
    }
    return place;
  };
  const codeOf = (cube, place) => {
    let text = cube.k;
    cube.d.forEach((dim, k) => {
      const here = cube.a[k].indexOf(place[dim]);
      const code = dim in cube.o ? cube.o[dim][here] : axes[dim].c[place[dim]];
      text = text.split("\0" + dim + "\0").join(here < 0 ? "..." : code);
    });
    return text;
  };

  // Numbers as the page begins with them: ties to even, four digits; counts with all digits.
  const whole = (v) => {
    const low = Math.floor(v), rest = v - low;
    return String(rest === 0.5 ? low + (low % 2) : Math.round(v));
  };
  const digits = (v, counted) => {
    if (Number.isInteger(v) && (counted || Math.abs(v) < 1e4)) return String(v);
    let [mantissa, power] = v.toExponential(3).split("e");
    // toExponential rounds ties away from zero: from an odd last digit, one back is even.
    const tie = /^-?\d\.\d{3}50{16}e/.test(v.toExponential(20));
    if (tie && Number(mantissa.slice(-1)) % 2) mantissa = mantissa.slice(0, -1) + (mantissa.slice(-1) - 1);
    const p = Number(power);
    if (p >= -4 && p < 4) return String(Number(mantissa + "e" + power));
    return Number(mantissa) + "e" + (p < 0 ? "-" : "+") + String(Math.abs(p)).padStart(2, "0");
  };

  const fill = (cell) => {
    const cube = cubes[cell.dataset.c];
    const at = indexOf(cube, placeOf(cell.dataset.at));
    const value = at < 0 ? null : cube.v[at];
    const said = (v) => (cube.p ? whole(v) : digits(v, cube.i));
    const [text, interval, source] = cell.querySelectorAll(".v, .ci, .src");
    text.textContent = value === null ? "–" : said(value);
    interval.textContent = source.textContent = cell.className = "";
    if (value === null) return;
    const low = cube.l.length ? cube.l[at] : null, high = cube.h.length ? cube.h[at] : null;
    if (low === null || high === null) return;
    interval.textContent = said(low) + "–" + said(high);
    const theirs = cube.s.length ? cube.s[at] : null;
    if (theirs === null) return;
    const points = Number(whole(Math.abs(value - theirs)));
    const above = value > theirs;
    const mark = document.createElement("b");
    mark.textContent = points ? (above ? "+" : "−") + points : "±0";
    source.append(String(theirs) + " ", mark);
    cell.className = low <= theirs && theirs <= high ? "same"
      : (above ? "above" : "below") + (points >= 15 ? " strong" : "");
  };

  const fillMatrix = (row) => {
    const cells = all("td", row);
    const counts = cells.map((cell) => {
      const cube = cubes[cell.dataset.c];
      const at = indexOf(cube, placeOf(cell.dataset.at));
      return at < 0 ? null : cube.v[at];
    });
    const total = counts.reduce((sum, count) => sum + (count || 0), 0);
    cells.forEach((cell, k) => {
      const [text, count] = cell.querySelectorAll(".v, .ci");
      const share = total && counts[k] !== null ? counts[k] / total : null;
      text.textContent = share === null ? "–" : whole(100 * share);
      count.textContent = share === null ? "" : String(counts[k]);
      cell.className = "k" + (share === null ? 0 : Math.min(9, Math.trunc(share * 9 + 0.999)));
    });
  };

  // Charts: the same paths as the page begins with.
  const marks = [
    (x, y) => `M${(x - 3).toFixed(1)} ${y.toFixed(1)}a3 3 0 1 0 6 0a3 3 0 1 0 -6 0z`,
    (x, y) => `M${(x - 3).toFixed(1)} ${(y - 3).toFixed(1)}h6v6h-6z`,
    (x, y) => `M${x.toFixed(1)} ${(y - 4).toFixed(1)}l4 4l-4 4l-4 -4z`,
    (x, y) => `M${x.toFixed(1)} ${(y - 4).toFixed(1)}l4 7h-8z`,
  ];
  const draw = (chart) => {
    const { axis, across, low, high, log } = chart.dataset;
    const xs = JSON.parse(across);
    const scale = (v) => (log === "1" ? (v > 0 ? Math.log10(v) : Math.log10(low)) : v);
    const [bottom, top] = log === "1" ? [Math.log10(low), Math.log10(high)] : [Number(low), Number(high)];
    const height = (v) => 186 - Math.min(1, Math.max(0, (scale(v) - bottom) / (top - bottom))) * 166;
    let empty = true;
    for (const series of all("g", chart)) {
      const cube = cubes[series.dataset.c];
      const points = [], bars = [], marked = [];
      xs.forEach((x, here) => {
        if (x === null) return;
        const at = indexOf(cube, { ...state, [axis]: here });
        if (at < 0 || cube.v[at] === null) return;
        const y = height(cube.v[at]);
        points.push(`${x.toFixed(1)} ${y.toFixed(1)}`);
        marked.push(marks[series.dataset.shape](x, y));
        if (cube.l.length && cube.l[at] !== null && cube.h[at] !== null) {
          bars.push(`M${x.toFixed(1)} ${height(cube.l[at]).toFixed(1)}V${height(cube.h[at]).toFixed(1)}`);
        }
      });
      empty = empty && !points.length;
      const [bar, line, mark] = all("path", series);
      line.setAttribute("d", points.length ? "M" + points.join("L") : "");
      bar.setAttribute("d", bars.join(""));
      mark.setAttribute("d", marked.join(""));
    }
    chart.querySelector(".none").toggleAttribute("hidden", !empty);
  };

  const update = () => {
    all("td[data-c]:not([data-m])").forEach(fill);
    all(".confusion tbody tr").forEach(fillMatrix);
    all("svg[data-axis]").forEach(draw);
    all("[data-shown]").forEach((one) => {
      one.textContent = axes[one.dataset.shown].t[state[one.dataset.shown]];
    });
    all("[data-code]").forEach((one) => {
      one.textContent = codeOf(cubes[one.dataset.code], placeOf(one.dataset.at));
    });
    all("[data-fixed]").forEach((one) => {
      one.hidden = axes[one.dataset.fixed].t[state[one.dataset.fixed]] === one.dataset.text;
    });
    if (current) tell(current);
  };

  // Which variable and selection give a figure: of the cell under the pointer, or the keyboard.
  const where = document.getElementById("where");
  let current = null;
  const tell = (cell) => {
    current = cell;
    where.hidden = false;
    const cube = cubes[cell.dataset.c], place = placeOf(cell.dataset.at);
    const at = indexOf(cube, place);
    const count = at >= 0 && cube.n.length ? "  # n = " + cube.n[at] : "";
    where.querySelector("code").textContent = at < 0 ? "no value here" : codeOf(cube, place) + count;
  };
  for (const table of all("table.figures")) {
    const first = table.querySelector("td");
    if (first) first.tabIndex = 0;
    table.addEventListener("pointerover", (event) => {
      const cell = event.target.closest("td");
      if (cell) tell(cell);
    });
    table.addEventListener("focusin", (event) => {
      const cell = event.target.closest("td");
      if (cell) tell(cell);
    });
    table.addEventListener("keydown", (event) => {
      const cell = event.target.closest("td");
      const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
      if (!cell || !step) return;
      const rows = all("tbody tr", table), row = rows.indexOf(cell.parentElement) + step[0];
      const next = rows[row] && rows[row].children[cell.cellIndex + step[1]];
      if (!next || next.tagName !== "TD") return;
      event.preventDefault();
      cell.tabIndex = -1;
      next.tabIndex = 0;
      next.focus();
    });
  }
  const copy = where.querySelector("button");
  copy.addEventListener("click", () => {
    const range = document.createRange();
    range.selectNodeContents(where.querySelector("code"));
    const chosen = getSelection();
    chosen.removeAllRanges();
    chosen.addRange(range);
    const done = document.execCommand("copy");
    copy.textContent = done ? "Copied" : "Press Ctrl+C";
    setTimeout(() => { copy.textContent = "Copy"; }, 1500);
  });

  // Selectors.
  const bar = document.querySelector(".bar");
  if (bar) {
    bar.hidden = false;
    bar.addEventListener("submit", (event) => event.preventDefault());
    for (const select of all("select[data-axis]", bar)) {
      state[select.dataset.axis] = Number(select.value);
      select.addEventListener("change", () => {
        state[select.dataset.axis] = Number(select.value);
        update();
      });
    }
  }
  const who = document.getElementById("who");
  const chosen = () => {
    for (const one of all(".classifier, .matrix")) {
      one.hidden = Boolean(who.value) && one.dataset.name !== who.value;
    }
    for (const series of all("#curves g[data-c]")) {
      const name = cubes[series.dataset.c].g;
      series.classList.toggle("faint", Boolean(who.value) && name !== who.value);
    }
  };
  if (who) {
    who.addEventListener("change", chosen);
    chosen();
  }
  // Tables of which there is a variant for each axis show the one asked for, if there is one.
  const by = document.getElementById("by");
  const vary = () => {
    const parts = new Map();
    for (const one of all(".classifier .sheet")) {
      parts.set(one.dataset.part, [...(parts.get(one.dataset.part) || []), one]);
    }
    for (const sheets of parts.values()) {
      const wanted = sheets.find((one) => one.dataset.by === by.value) || sheets[0];
      for (const one of sheets) one.hidden = one !== wanted;
    }
  };
  if (by && by.options.length > 1) {
    by.parentElement.hidden = false;
    by.addEventListener("change", vary);
    vary();
  }
  // On paper nothing can be opened: what is closed is printed, too.
  let closed = [];
  addEventListener("beforeprint", () => {
    closed = all("details:not([open], .code)");
    for (const one of closed) one.open = true;
  });
  addEventListener("afterprint", () => {
    for (const one of closed) one.open = false;
  });
  update();
})();
