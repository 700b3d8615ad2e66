"use strict";
// Draws the figures of a comparison from #page-data (`figuresIn` stands in figures.js).
(async () => {
  const {figures, dark} = JSON.parse(document.getElementById("page-data").textContent);
  const show = await figuresIn(dark);
  if (show) figures.forEach((figure, index) => show("figure-" + index, figure.data, {1: figure.layout}));
})();
