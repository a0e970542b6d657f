"use strict";
// The headline at a selection, in the words of sweeps/report/headline.py, which writes the first.
const headlineOf = (about, table, kept, axis, bin) => {
  const { rows } = table, { figure, low, high, chance } = about;
  const along = axis in about.axes && axis !== table.across ? axis : "";
  const valid = kept.map((one, k) => k).filter((k) => kept[k] && rows[figure][k] !== null
    && (!table.across || rows[table.across][k] === bin) && !about.untested.includes(rows.kind?.[k]));
  const ships = valid.filter((k) => rows.scored?.[k] === "ship");
  const rivals = new Map();
  for (const k of ships.length ? ships : valid) {
    const name = table.series.map((one) => rows[one][k]).join("\n");
    rivals.set(name, [...(rivals.get(name) ?? []), k]);
  }
  const place = (value) => (about.simplest.includes(value) ? about.simplest.indexOf(value) : about.simplest.length);
  const order = (a, b) => a.map((one, k) => one - b[k]).find((one) => one) ?? 0;
  const all = [...rivals.values()].map((every) => {
    const given = along ? every.filter((k) => rows[along][k] !== null) : [];
    const axis = given.length ? along : "";
    const own = axis ? given.filter((k, at) => given.findIndex((one) => rows[axis][one] === rows[axis][k]) === at) : every.slice(0, 1);
    if (axis && typeof rows[axis][own[0]] === "number") own.sort((a, b) => rows[axis][a] - rows[axis][b]);
    return { axis, own };
  });
  // Ranked by their means at the values that all have, of those that depend on the axis.
  const valuesOf = all.filter((one) => one.axis).map(({ own }) => new Set(own.map((k) => rows[along][k])));
  const values = new Set(valuesOf.flatMap((of) => [...of]));
  const shared = [...values].filter((value) => valuesOf.every((of) => of.has(value)));
  const best = all.map(({ axis, own }) => {
    const ranked = axis && shared.length ? own.filter((k) => shared.includes(rows[axis][k])) : own;
    const mean = ranked.reduce((sum, k) => sum + rows[figure][k], 0) / ranked.length;
    const of = [rows.classifier?.[own[0]], rows.channel?.[own[0]]];
    return { axis, own, rank: [-Math.round(1e6 * mean), +of.includes("both"), ...of.map(place)] };
  }).sort((a, b) => order(a.rank, b.rank))[0];
  if (!best) return "No score: no test has an answer at this selection.";
  // Python rounds halves to even.
  const whole = (value) => String(Math.abs(value % 1) === 0.5 ? 2 * Math.round(value / 2) : Math.round(value));
  const text = (value) => (typeof value === "boolean" ? (value ? "yes" : "no") : typeof value === "number" ? String(+value.toPrecision(6)) : value.replaceAll("_", " "));
  const inWords = (name, value, named = true) => [named && about.axes[name][0], text(value), about.axes[name][1]].filter(Boolean).join(" ");
  const [first] = best.own, ends = [...new Set([first, best.axis ? best.own.at(-1) : first])];
  const score = ends.map((k, at) => {
    const value = (name) => (name ? rows[name]?.[k] ?? null : null);
    const interval = value(low) === null || value(high) === null ? "" : ` [${whole(value(low))}–${whole(value(high))}]`;
    const doubtful = value(chance) !== null && value(low) !== null && value(low) <= value(chance);
    return `${whole(rows[figure][k])} %${interval}${at ? "" : ` of ${about.ships}`}`
      + (best.axis ? ` at ${inWords(best.axis, rows[best.axis][k], !at)}` : "") + (doubtful ? ", no better than chance" : "");
  });
  const settings = about.settings.filter((name) => name !== best.axis && best.own.every((k) => rows[name][k] !== null && rows[name][k] === rows[name][first]));
  const where = settings.map((name) => inWords(name, rows[name][first]));
  if (table.across && bin !== about.overall) where.push(`aspect ${bin}°`);
  const channel = rows.channel[first], name = `${table.words.classifier[rows.classifier[first]]} on ${about.by[channel] ?? channel}`;
  const start = rivals.size > 1 ? `Best of ${rivals.size}: ${name}` : name[0].toUpperCase() + name.slice(1);
  const level = chance && rows[chance][first] !== null ? `; chance ${whole(rows[chance][first])} %.` : ".";
  const by = shared.length === values.size ? ""
    : shared.length ? ` Ranked by ${shared.length} of ${values.size} values of ${about.axes[along][0]}, ${shared.length > 1 ? "those" : "the one"} that all have.`
    : ` Ranked by means over different values of ${about.axes[along][0]}, since none is shared.`;
  const least = rows.n ? Math.min(...best.own.map((k) => rows.n[k])) : about.few;
  return `${start} identifies ${score.join(score[0].endsWith("chance") ? ", and " : " and ")}${where.length ? ` (${where.join(", ")})` : ""}${level}${by}`
    + (least < about.few ? ` Few answers (n = ${whole(least)}) make the interval wide.` : "");
};
