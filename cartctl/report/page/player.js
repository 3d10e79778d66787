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

  // A copy of a robot borrows its shapes from the first one: sent once, kept once.
  const shapes = new Map(), copies = [];
  viewer.scene.traverse((object) => {
    if (!object.geometry) return;
    if (object.geometry.userData.borrows) copies.push(object);
    else shapes.set(object.geometry.uuid, object.geometry);
  });
  for (const copy of copies) copy.geometry = shapes.get(copy.geometry.userData.borrows);

  // The picture has the room that the table below leaves.
  const view = el("view"), resize = viewer.set_3d_pane_size.bind(viewer);
  viewer.set_3d_pane_size = () => resize(view.clientWidth, view.clientHeight);

  // The scene was framed for windows wider than scene.aspect; a narrower one zooms out by as much.
  const fit = () => {
    viewer.camera.zoom = Math.min(1, view.clientWidth / view.clientHeight / scene.aspect);
    viewer.set_3d_pane_size();
  };
  new ResizeObserver(fit).observe(view);
  fit();

  // What can be shown or hidden beside the robot.
  for (const box of document.querySelectorAll("[data-paths]")) {
    const apply = () => {
      for (const path of box.dataset.paths.split(" ")) {
        viewer.set_property(["meshcat", ...path.split("/")], "visible", box.checked);
      }
      viewer.set_dirty();
    };
    box.addEventListener("change", apply);
    apply();
  }

  // One switch a run, and one for all.
  let plots = null;
  const switches = [...document.querySelectorAll("[data-run]")], all = el("all");
  const toggle = () => {
    for (const box of switches) {
      viewer.set_property(["meshcat", "run" + box.dataset.run], "visible", box.checked);
      if (plots) plots.toggle(Number(box.dataset.run), box.checked);
    }
    const on = switches.filter((box) => box.checked).length;
    if (all) {
      all.checked = on > 0;
      all.indeterminate = on > 0 && on < switches.length;
    }
    viewer.set_dirty();
  };
  for (const box of switches) box.addEventListener("change", toggle);
  if (all) all.addEventListener("change", () => {
    for (const box of switches) box.checked = all.checked;
    toggle();
  });
  if (all) toggle();

  const animator = viewer.animator;
  const duration = animator.duration;
  if (!(duration > 0)) return;
  const slider = el("time"), button = el("play"), clock = el("clock");
  slider.max = duration;
  el("player").hidden = false;

  const show = (time) => {
    if (plots) plots.show(time);
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

  const panels = scene.panels;
  if (panels.length) plots = makePlots(el("plots"), panels, duration, (time) => seek(Math.min(Math.max(time, 0), duration)));

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
