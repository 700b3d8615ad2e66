"use strict";
// Draws the figures of a comparison from #page-data.
(() => {
  const figures = JSON.parse(document.getElementById("page-data").textContent);
  const options = {responsive: true, displaylogo: false};
  for (const target of document.querySelectorAll("[data-figure]")) {
    const figure = figures[Number(target.dataset.figure)];
    Plotly.react(target, figure.data, figure.layout, options);
  }
})();
