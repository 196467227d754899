/* Draws the figures when they come into view, zooms all time axes together, and shows the
   time of the 3D view in them. */
(function () {
  "use strict";
  const CONFIG = {
    displaylogo: false,
    doubleClick: "reset",
    responsive: true,
    plotlyServerURL: "",
    modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d"],
    toImageButtonOptions: { scale: 2 },
  };
  const plots = Array.from(document.querySelectorAll(".plot"));
  const drawn = [];
  const linked = document.getElementById("linked");
  let range = null; // of all time axes; null shows everything
  let moving = false; // while figures follow the one that was zoomed
  let now = null; // time of the 3D view

  const isTime = (plot) => plot.layout && plot.layout.meta && plot.layout.meta.time;

  function draw(plot) {
    if (plot.dataset.drawn || typeof Plotly === "undefined") return;
    plot.dataset.drawn = "1";
    const spec = JSON.parse(plot.nextElementSibling.textContent);
    const time = spec.layout.meta && spec.layout.meta.time;
    Plotly.newPlot(plot, spec.data, spec.layout, CONFIG);
    drawn.push(plot);
    if (!time) return;
    if (range) Plotly.relayout(plot, { "xaxis.range": range.slice() });
    plot.on("plotly_relayout", (change) => { ticks(plot, change); follow(plot, change); });
    plot.on("plotly_click", (event) => {
      const detail = { t: event.points[0].x };
      document.dispatchEvent(new CustomEvent("strapdown:seek", { detail }));
    });
    plot.on("plotly_afterplot", () => mark(plot));
    mark(plot);
  }

  /* ticks at quarter turns would leave a zoomed angle without any */
  function ticks(plot, change) {
    const update = {};
    Object.keys(change).forEach((key) => {
      const found = /^(yaxis\d*)\.(range|autorange)/.exec(key);
      if (!found || !quarters(plot, found[1])) return;
      update[`${found[1]}.tickmode`] = found[2] === "autorange" ? "linear" : "auto";
    });
    if (Object.keys(update).length) Plotly.relayout(plot, update);
  }

  const quarters = (plot, name) => plot.layout[name] && plot.layout[name].dtick === 90;

  function follow(source, change) {
    if (moving || (linked && !linked.checked)) return;
    if ("xaxis.range[0]" in change) range = [change["xaxis.range[0]"], change["xaxis.range[1]"]];
    else if (change["xaxis.range"]) range = change["xaxis.range"].slice();
    else if (change["xaxis.autorange"]) range = null;
    else return;
    moving = true;
    const update = range ? { "xaxis.range": range.slice() } : { "xaxis.autorange": true };
    const others = drawn.filter((plot) => plot !== source && isTime(plot));
    Promise.all(others.map((plot) => Plotly.relayout(plot, { ...update })))
      .finally(() => { moving = false; });
  }

  function mark(plot) {
    if (now === null || !isTime(plot) || !plot._fullLayout) return;
    const axis = plot._fullLayout.xaxis;
    let line = plot.querySelector(".cursor");
    if (!line) {
      line = document.createElement("div");
      line.className = "cursor";
      plot.appendChild(line);
    }
    const pixel = axis.l2p(now);
    const size = plot._fullLayout._size;
    line.style.display = pixel >= 0 && pixel <= axis._length ? "block" : "none";
    line.style.left = `${axis._offset + pixel}px`;
    line.style.top = `${size.t}px`;
    line.style.height = `${size.h}px`;
  }

  document.addEventListener("strapdown:time", (event) => {
    now = event.detail.t;
    drawn.forEach(mark);
  });

  if ("IntersectionObserver" in window) {
    const seen = new IntersectionObserver((entries) => {
      entries.filter((entry) => entry.isIntersecting).forEach((entry) => {
        seen.unobserve(entry.target);
        draw(entry.target);
      });
    }, { rootMargin: "600px" });
    plots.forEach((plot) => seen.observe(plot));
  } else {
    plots.forEach(draw);
  }
  window.addEventListener("beforeprint", () => plots.forEach(draw));
})();
