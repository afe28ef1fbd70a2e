// Adds a pause button to animations; they start paused for visitors who prefer reduced motion.
for (const figure of document.querySelectorAll('figure.movie')) {
  const drawings = [...figure.querySelectorAll('svg')], button = figure.querySelector('button');
  const set = (paused) => {
    for (const drawing of drawings) {
      // Synchronise the drawings: each started when the browser had parsed it.
      drawing.setCurrentTime(drawings[0].getCurrentTime());
      if (paused) drawing.pauseAnimations(); else drawing.unpauseAnimations();
    }
    button.textContent = paused ? 'Play' : 'Pause';
  };
  button.hidden = false;
  button.addEventListener('click', () => set(!drawings[0].animationsPaused()));
  set(matchMedia('(prefers-reduced-motion: reduce)').matches);
}
