"use strict";
(() => {
  const el = (id) => document.getElementById(id);
  const trouble = (text) => { el("trouble").textContent = text; el("trouble").hidden = false; };
  const scene = JSON.parse(el("scene").textContent);

  let viewer;
  try {
    viewer = new MeshCat.Viewer(el("view"));
  } catch (error) {
    trouble("The robot cannot be drawn: this browser offers no WebGL.");
    return;
  }
  for (const command of scene.commands) {
    viewer.handle_command_bytearray(Uint8Array.from(atob(command), (c) => c.charCodeAt(0)));
  }
  el("scene").remove();

  // The scene was framed for windows wider than scene.aspect; a narrower one zooms out by as much.
  const fit = () => {
    viewer.camera.zoom = Math.min(1, innerWidth / innerHeight / scene.aspect);
    viewer.set_dirty();
  };
  addEventListener("resize", fit);
  fit();

  const animator = viewer.animator;
  const duration = animator.duration;
  if (!(duration > 0)) return;
  const slider = el("time"), button = el("play"), clock = el("clock");
  slider.max = duration;
  el("player").hidden = false;

  const show = (time) => {
    clock.textContent = time.toFixed(2) + " / " + duration.toFixed(2) + " s";
  };
  const setPlaying = (playing) => {
    if (playing) animator.play(); else animator.pause();
    button.classList.toggle("paused", !playing);
    button.setAttribute("aria-label", playing ? "Pause" : "Play");
  };
  const seek = (time) => {
    setPlaying(false);
    animator.seek(time);
    slider.value = time;
    show(time);
  };
  const follow = () => {
    if (animator.playing) {
      slider.value = animator.time;
      show(animator.time);
    }
    requestAnimationFrame(follow);
  };

  button.addEventListener("click", () => setPlaying(!animator.playing));
  slider.addEventListener("input", () => seek(slider.valueAsNumber));
  addEventListener("keydown", (event) => {
    if (event.key === " " && event.target !== button) {
      event.preventDefault();
      setPlaying(!animator.playing);
    }
  });
  // "#t=1.5" in the address opens the page at that moment, standing still.
  const moment = () => {
    const match = /^#t=(\d+(\.\d*)?)$/.exec(location.hash);
    if (match) seek(Math.min(Number(match[1]), duration));
  };
  addEventListener("hashchange", moment);
  follow();
  moment();
  if (matchMedia("(prefers-reduced-motion: reduce)").matches) setPlaying(false);
})();
