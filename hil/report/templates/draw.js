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
    plot.closest(".figure").after(buttons(plot));
  };
  const titled = (layout, name) => {
    const axes = Object.entries(layout).filter(([key]) => /^[xy]axis/.test(key) && key[0] === name[0]);
    const own = layout[name[0] + "axis" + name.slice(1)];
    const same = axes.map(([, axis]) => axis).filter(axis => axis === own || axis.anchor === own.matches
      || axis.matches === name || (own.matches && axis.matches === own.matches));
    return [own, ...same].map(axis => axis.title?.text).find(Boolean) || "";
  };
  const table = plot => {
    const more = ["z", "lowerfence", "q1", "median", "q3", "upperfence", "value"];
    const rows = plot._fullData.flatMap(trace => {
      const part = { ...trace, value: trace.marker?.color };
      const count = Math.max(...["x", "y", "q1"].map(key => part[key]?.length ?? 0));
      const head = [titled(plot._fullLayout, trace.xaxis), titled(plot._fullLayout, trace.yaxis), trace.name];
      if (trace.type === "heatmap")
        return part.z.flatMap((row, j) => Array.from(row, (z, i) => [...head, part.x[i], part.y[j], z]));
      return Array.from({ length: count }, (_, k) => [...head, ...["x", "y", ...more].map(key =>
        ArrayBuffer.isView(part[key]) || Array.isArray(part[key]) ? part[key][k] ?? "" : "")]);
    });
    const quoted = cell => /[",\n]/.test(cell) ? `"${String(cell).replaceAll('"', '""')}"` : cell ?? "";
    return [["x axis", "y axis", "series", "x", "y", ...more], ...rows].map(row => row.map(quoted).join(",")).join("\n") + "\n";
  };
  const picture = (plot, format) => {
    const { data, layout } = JSON.parse(plot.nextElementSibling.textContent);
    const look = { ...layout, width: 720, paper_bgcolor: "white", plot_bgcolor: "white" };
    return Plotly.toImage({ data, layout: look, config }, { format, width: 720, height: layout.height || 420, scale: format === "png" ? 4 : 1 });
  };
  const buttons = plot => {
    const bar = document.createElement("p"), heads = [...plot.closest("section").querySelectorAll("h2, h3, summary")];
    const above = heads.filter(one => one.compareDocumentPosition(plot) & Node.DOCUMENT_POSITION_FOLLOWING).at(-1);
    const name = `${plot.id} ${above?.textContent ?? ""}`.toLowerCase().replace(/[^a-z0-9]+/g, "_").slice(0, 60);
    bar.className = "save";
    for (const format of ["svg", "png", "csv"]) {
      const button = document.createElement("button");
      button.textContent = format.toUpperCase();
      button.title = { svg: "The figure for a paper, as vectors", png: "The figure for a paper, as pixels", csv: "Its numbers" }[format];
      button.onclick = async () => {
        const link = document.createElement("a");
        link.href = format === "csv" ? URL.createObjectURL(new Blob([table(plot)], { type: "text/csv" })) : await picture(plot, format);
        link.download = `${name}.${format}`;
        link.click();
      };
      bar.append(button);
    }
    return bar;
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
    plots.forEach(plot => {
      draw(plot);
      plot.dataset.height = plot.layout.height;
      Plotly.relayout(plot, { width: 660, height: Math.min(plot.layout.height, 860) });
      plot.style.height = `${plot.layout.height}px`;
    });
  });
  addEventListener("afterprint", () => {
    opened.forEach(one => { one.open = false; });
    plots.forEach(plot => {
      plot.style.height = `${plot.dataset.height}px`;
      Plotly.relayout(plot, { width: null, autosize: true, height: Number(plot.dataset.height) });
    });
  });
})();
