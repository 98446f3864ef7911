"use strict";
// Tables that sort, plots that follow light and dark. Everything is in the page or beside it; nothing is fetched.
(() => {
  const numberOf = (text) => {
    const found = text.replace("−", "-").match(/-?\d+(\.\d+)?(e[+-]?\d+)?/i);
    return found ? Number(found[0]) : NaN;
  };

  function sortable(table) {
    const headers = [...table.querySelectorAll("thead th")];
    headers.forEach((header, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...header.childNodes);
      header.append(button);
      header.setAttribute("aria-sort", "none");
      button.addEventListener("click", () => {
        const up = header.getAttribute("aria-sort") !== "ascending";
        headers.forEach((other) => other.setAttribute("aria-sort", "none"));
        header.setAttribute("aria-sort", up ? "ascending" : "descending");
        for (const body of table.tBodies) sortRows(body, column, up);
      });
    });
  }

  function sortRows(body, column, up) {
    const rows = [...body.rows].filter((row) => !row.classList.contains("section"));
    const keyed = rows.map((row) => {
      const text = row.cells[column] ? row.cells[column].textContent.trim() : "";
      return { row, text, number: numberOf(text) };
    });
    const numeric = keyed.filter((item) => !Number.isNaN(item.number)).length > keyed.length / 2;
    keyed.sort((a, b) => {
      if (!numeric) return (up ? 1 : -1) * a.text.localeCompare(b.text);
      if (Number.isNaN(a.number) || Number.isNaN(b.number)) return Number.isNaN(a.number) - Number.isNaN(b.number);
      return (up ? 1 : -1) * (a.number - b.number);
    });
    keyed.forEach((item) => body.append(item.row));
  }

  function draw(place) {
    const style = getComputedStyle(document.documentElement);
    const ink = style.getPropertyValue("--ink").trim();
    const faint = style.getPropertyValue("--faint").trim();
    const axis = { gridcolor: faint, zerolinecolor: faint, linecolor: faint, automargin: true };
    const figure = JSON.parse(document.getElementById(place.dataset.figure).textContent);
    const layout = { ...figure.layout, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink, size: 12 } };
    for (const name of ["xaxis", "yaxis"]) layout[name] = { ...axis, ...layout[name] };
    Plotly.newPlot(place, figure.data, layout, { responsive: true, displaylogo: false });
  }

  // Plots are drawn when they come near the window: the motions do not wait for them.
  function drawWhenNear() {
    if (typeof Plotly === "undefined") return;
    const drawn = new Set();
    const near = new IntersectionObserver((found) => {
      for (const { target, isIntersecting } of found) {
        if (!isIntersecting) continue;
        near.unobserve(target);
        drawn.add(target);
        draw(target);
      }
    }, { rootMargin: "500px" });
    document.querySelectorAll(".plot").forEach((place) => near.observe(place));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => drawn.forEach(draw));
  }

  document.querySelectorAll("table.stylebench").forEach(sortable);
  addEventListener("load", drawWhenNear);
})();
