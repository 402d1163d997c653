(async () => {
  const plots = [...document.querySelectorAll(".plot")];
  const config = { displayModeBar: false, responsive: true };
  const narrow = matchMedia("(max-width: 700px)");
  const draw = plot => {
    if (plot.dataset.drawn) return;
    plot.dataset.drawn = "yes";
    const { data, layout } = JSON.parse(plot.nextElementSibling.textContent);
    if (narrow.matches && layout.legend) layout.legend.font = { size: 11 };
    Plotly.newPlot(plot, data, layout, config);
  };
  const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), c => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  script.text = await new Response(stream).text();
  document.head.append(script);
  const watch = new IntersectionObserver(seen => seen.filter(one => one.isIntersecting).forEach(one => {
    watch.unobserve(one.target);
    draw(one.target);
  }), { rootMargin: "600px" });
  plots.forEach(plot => watch.observe(plot));
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    opened.forEach(one => { one.open = true; });
    plots.forEach(plot => { draw(plot); Plotly.relayout(plot, { width: 660 }); });
  });
  addEventListener("afterprint", () => {
    opened.forEach(one => { one.open = false; });
    plots.forEach(plot => Plotly.relayout(plot, { width: null, autosize: true }));
  });
  document.documentElement.dataset.ready = "yes";
})();
