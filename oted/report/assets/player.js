(() => {
  "use strict";
  const slowest = 80;  // ms that a frame stays at least, so that the eye can follow
  const rest = 900;    // ms at the end, before it starts again
  for (const motion of document.querySelectorAll(".motion")) {
    const columns = Number(motion.dataset.columns), frames = Number(motion.dataset.frames);
    const period = Number(motion.dataset.period);
    const stay = Math.max(slowest, 1000 * period);
    const button = motion.querySelector("button");
    const slider = motion.querySelector("input");
    const output = motion.querySelector("output");
    const panels = [...motion.querySelectorAll(".panel")].map(panel => ({
      canvas: panel.querySelector("canvas"), strip: panel.querySelector("img")
    }));
    const slow = 1000 * period / stay;
    const speed = slow < 0.99 ? `, shown at ${Number(slow.toPrecision(1))} × real speed` : "";
    slider.max = frames - 1;
    let frame = 0, timer = 0;
    const show = next => {
      frame = next;
      slider.value = frame;
      output.textContent = `${(frame * period).toFixed(2)} s${speed}`;
      for (const {canvas, strip} of panels) {
        const {width, height} = canvas;
        const x = frame % columns * width, y = Math.floor(frame / columns) * height;
        canvas.getContext("2d").drawImage(strip, x, y, width, height, 0, 0, width, height);
      }
    };
    const step = () => {
      show((frame + 1) % frames);
      timer = setTimeout(step, frame === frames - 1 ? stay + rest : stay);
    };
    const play = on => {
      clearTimeout(timer);
      timer = on ? setTimeout(step, stay) : 0;
      button.textContent = on ? "Pause" : "Play";
    };
    button.addEventListener("click", () => { chosen = true; play(timer === 0); });
    slider.addEventListener("input", () => { chosen = true; play(false); show(Number(slider.value)); });
    // It starts by itself when it comes into view, unless the reader has decided otherwise or wants no motion.
    let chosen = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const watch = new IntersectionObserver(entries => { if (!chosen) play(entries[0].isIntersecting); });
    Promise.all(panels.map(({strip}) => strip.decode())).then(() => {
      show(0);
      motion.dataset.ready = "";
      watch.observe(motion);
    });
  }
})();
