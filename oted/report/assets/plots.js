(() => {
  "use strict";
  const variable = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  // Replaces "var:--name" by the colour that the page's mode gives it.
  const resolve = value => {
    if (typeof value === "string") return value.startsWith("var:--") ? variable(value.slice(4)) : value;
    if (Array.isArray(value)) return value.map(resolve);
    if (value === null || typeof value !== "object") return value;
    return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, resolve(inner)]));
  };
  const base = () => {
    const axis = {
      gridcolor: variable("--grid"), linecolor: variable("--rule"), zerolinecolor: variable("--rule"), zeroline: false,
      automargin: true, fixedrange: matchMedia("(pointer: coarse)").matches, title: {standoff: 8}
    };
    return {
      margin: {l: 44, r: 8, t: 8, b: 40}, showlegend: false, hovermode: "closest",
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: {family: getComputedStyle(document.body).fontFamily, size: 12, color: variable("--soft")},
      hoverlabel: {bgcolor: variable("--surface"), bordercolor: variable("--rule"), font: {color: variable("--text")}},
      xaxis: {...axis}, yaxis: {...axis}
    };
  };
  const merge = (under, over) => {
    const merged = {...under};
    for (const [key, value] of Object.entries(over)) {
      const both = [merged[key], value].every(part => part && typeof part === "object" && !Array.isArray(part));
      merged[key] = both ? merge(merged[key], value) : value;
    }
    return merged;
  };
  // A table that does not fit is shown row by row.
  const fit = () => {
    for (const box of document.querySelectorAll(".table")) {
      box.classList.remove("stacked");
      box.classList.toggle("stacked", box.scrollWidth > box.clientWidth + 1);
    }
  };
  fit();
  addEventListener("resize", fit);
  const figures = [...document.querySelectorAll("figure")].map(figure => ({
    plot: figure.querySelector(".plot"), spec: JSON.parse(figure.querySelector("script").textContent)
  }));
  const draw = () => {
    for (const {plot, spec} of figures) {
      const {data, layout} = resolve(spec);
      Plotly.react(plot, data, merge(base(), layout), {displayModeBar: false, responsive: true});
    }
  };
  draw();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);

  const links = new Map([...document.querySelectorAll("nav a:not(.home)")].map(a => [a.hash.slice(1), a]));
  const sections = [...document.querySelectorAll("section")];
  const mark = () => {
    const passed = sections.filter(section => section.getBoundingClientRect().top < innerHeight * 0.35);
    const here = passed.length > 0 ? passed[passed.length - 1].id : "";
    for (const [id, link] of links) link.classList.toggle("here", id === here);
  };
  addEventListener("scroll", mark, {passive: true});
  mark();
})();
