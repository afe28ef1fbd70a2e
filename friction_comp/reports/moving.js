// Drawings that move can be stopped, and stand still for those who asked for less motion.
for (const figure of document.querySelectorAll('figure.movie')) {
  const drawings = [...figure.querySelectorAll('svg')], button = figure.querySelector('button');
  const set = (paused) => {
    for (const drawing of drawings) {
      // All from the same moment: each began when it had been read.
      drawing.setCurrentTime(drawings[0].getCurrentTime());
      if (paused) drawing.pauseAnimations(); else drawing.unpauseAnimations();
    }
    button.textContent = paused ? 'Play' : 'Pause';
  };
  button.hidden = false;
  button.addEventListener('click', () => set(!drawings[0].animationsPaused()));
  set(matchMedia('(prefers-reduced-motion: reduce)').matches);
}
