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
  const packed = await fetch(`data:application/gzip;base64,${document.getElementById("plotly").textContent}`);
  const library = await new Response(packed.body.pipeThrough(new DecompressionStream("gzip"))).blob();
  const script = document.createElement("script");
  script.src = URL.createObjectURL(library);
  await new Promise(loaded => {
    script.onload = loaded;
    document.head.append(script);
  });
  const watch = new IntersectionObserver(seen => {
    seen.filter(one => one.isIntersecting).forEach(({ target, boundingClientRect: box }) => {
      watch.unobserve(target);
      if (box.top < innerHeight && box.bottom > 0) draw(target);
      else requestAnimationFrame(() => setTimeout(draw, 0, target));
    });
    document.documentElement.dataset.ready = "yes";
  }, { rootMargin: "600px" });
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
})();
