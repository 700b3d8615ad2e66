"use strict";
// Draws the figures of a comparison (`figuresIn` stands in figures.js).
(async () => {
  const [show, data] = await figuresIn();
  if (show) data.figures.forEach((figure, index) => show("figure-" + index, figure.data, {1: figure.layout}));
})();
