// Reads curves where a reader points, and zooms to a box that is drawn; a double click shows all.
const SHARE = [[0, 1], [0, 1]];

const make = (parent, tag, attributes, text = '') => {
  const node = document.createElementNS(parent.namespaceURI, tag);
  for (const name in attributes) node.setAttribute(name, attributes[name]);
  node.textContent = text;
  parent.append(node);
  return node;
};

const shown = (value) => String(Number(value.toPrecision(4))).replace('-', '\u2212');

// The value of a scale at a share of its length, and the share at a value.
const valueAt = ({limits: [low, high], log}, share) => (
  log ? low * (high / low) ** share : low + share * (high - low));
const shareAt = ({limits: [low, high], log}, value) => (
  log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low));

function ticksBetween(low, high) {
  const raw = (high - low) / 5, power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw);
  const first = Math.ceil(low / step), count = Math.floor(high / step) - first + 1;
  return Array.from({length: count}, (_, k) => (first + k) * step);
}

// Pieces of a curve as lists of points: its path, and its markers.
function piecesOf(curve) {
  const pieces = [];
  for (const path of curve.querySelectorAll(':scope > path')) {
    for (const [, kind, x, y] of path.getAttribute('d').matchAll(/([ML])\s*(\S+)\s+(\S+)/g)) {
      if (kind === 'M') pieces.push([]);
      pieces.at(-1).push([Number(x), Number(y)]);
    }
  }
  for (const dot of curve.querySelectorAll('use')) {
    pieces.push([[Number(dot.getAttribute('x')), Number(dot.getAttribute('y'))]]);
  }
  return pieces;
}

class Panel {
  constructor(svg, {box, scales, names}, k) {
    Object.assign(this, {box, scales, shares: SHARE});
    const node = svg.querySelector(`[id$="panel-${k}"]`);
    this.axes = [...node.querySelectorAll('[id*="matplotlib.axis_"]')].slice(0, 2);
    const [x, y, width, height] = box;
    this.view = make(node, 'svg', {x, y, width, height, preserveAspectRatio: 'none'});
    const drawn = [...node.children].filter((part) => (
      part !== this.view && !this.axes.includes(part)
      && (part.matches('image') || part.querySelector('[clip-path]'))));
    if (drawn.length) drawn[0].before(this.view);
    this.view.append(...drawn);
    for (const image of this.view.querySelectorAll('image')) {
      image.setAttribute('preserveAspectRatio', 'none');
    }
    this.ticks = make(node, 'g', {class: 'ticks'});
    this.curves = names.map((name, j) => {
      const curve = this.view.querySelector(`[id$="curve-${k}-${j}"]`);
      return {name, pieces: curve ? piecesOf(curve) : []};
    });
    this.zoom(SHARE);
  }

  // The share of each scale at a place in the drawing.
  sharesAt(point) {
    const [x, y, width, height] = this.box, [across, up] = this.shares;
    const part = [(point.x - x) / width, 1 - (point.y - y) / height];
    return [across, up].map(([low, high], i) => low + part[i] * (high - low));
  }

  contains({x, y}) {
    return x >= this.box[0] && x <= this.box[0] + this.box[2]
      && y >= this.box[1] && y <= this.box[1] + this.box[3];
  }

  // Shows a part of each scale, given as shares of its length.
  zoom(shares) {
    this.shares = shares;
    const [x, y, width, height] = this.box, [across, up] = shares;
    this.size = [across[1] - across[0], up[1] - up[0]];
    this.view.setAttribute('viewBox', [x + across[0] * width, y + (1 - up[1]) * height,
      this.size[0] * width, this.size[1] * height].join(' '));
    // Lines keep their width, and markers their shape.
    this.view.classList.toggle('zoomed', shares.some(([low, high]) => low > 0 || high < 1));
    for (const dot of this.view.querySelectorAll('[id*="curve-"] use')) {
      const [a, b] = [dot.getAttribute('x'), dot.getAttribute('y')];
      dot.setAttribute('transform', `translate(${a} ${b}) scale(${this.size.join(' ')}) `
        + `translate(${-a} ${-b})`);
    }
    this.ticks.replaceChildren();
    shares.forEach((share, i) => this.drawTicks(i, share));
  }

  drawTicks(i, [low, high]) {
    const own = this.axes[i]?.querySelectorAll('[id*="tick_"]') ?? [], all = low === 0 && high === 1;
    for (const tick of own) tick.style.display = all ? '' : 'none';
    if (all || !own.length) return;
    const [x, y, width, height] = this.box, scale = this.scales[i];
    const labelled = [...own].some((tick) => tick.querySelector('[id*="text_"]'));
    for (const value of ticksBetween(valueAt(scale, low), valueAt(scale, high))) {
      const part = (shareAt(scale, value) - low) / (high - low);
      const [a, b] = i ? [x, y + (1 - part) * height] : [x + part * width, y + height];
      make(this.ticks, 'path', {d: i ? `M${a} ${b}h${width}` : `M${a} ${b}v${-height}`});
      if (labelled) make(this.ticks, 'text', i ? {x: a - 6, y: b + 3, 'text-anchor': 'end'}
        : {x: a, y: b + 13, 'text-anchor': 'middle'}, shown(value));
    }
  }

  // The point of a curve that is nearest to a place, within 30 points of the drawing.
  nearest(point) {
    const [x, y, width, height] = this.box, [across, up] = this.sharesAt(point);
    const place = [x + across * width, y + (1 - up) * height];
    let best = {distance: 30};
    for (const {name, pieces} of this.curves) {
      for (const piece of pieces) {
        piece.forEach((end, k) => {
          const begin = piece[Math.max(k - 1, 0)];
          const [step, gap] = [[0, 1].map((i) => (end[i] - begin[i]) / this.size[i]),
            [0, 1].map((i) => (place[i] - begin[i]) / this.size[i])];
          const along = Math.min(Math.max(
            (step[0] * gap[0] + step[1] * gap[1]) / (step[0] ** 2 + step[1] ** 2 || 1), 0), 1);
          const distance = Math.hypot(gap[0] - along * step[0], gap[1] - along * step[1]);
          if (distance < best.distance) {
            const at = [0, 1].map((i) => begin[i] + along * (end[i] - begin[i]));
            best = {name, distance, shares: [(at[0] - x) / width, 1 - (at[1] - y) / height]};
          }
        });
      }
    }
    return best.shares ? best : null;
  }

  // A place in the drawing for a share of each scale.
  placeAt(shares) {
    const part = shares.map((share, i) => (share - this.shares[i][0]) / this.size[i]);
    return [this.box[0] + part[0] * this.box[2], this.box[1] + (1 - part[1]) * this.box[3]];
  }
}

for (const svg of document.querySelectorAll('svg[data-panels]')) {
  const panels = JSON.parse(svg.dataset.panels).map((panel, k) => new Panel(svg, panel, k));
  const mark = make(svg, 'circle', {class: 'mark', r: 4, visibility: 'hidden'});
  const box = make(svg, 'rect', {class: 'box', visibility: 'hidden'});
  const reading = document.createElement('output');
  svg.after(reading);
  if (svg === document.querySelector('svg[data-panels]')) {
    const hint = document.createElement('small');
    hint.textContent = ' Point at a curve to read it; drag to zoom, double-click to see all.';
    svg.closest('figure').querySelector('figcaption').append(hint);
  }
  let drag = null;

  const placeOf = (event) => (
    new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse()));
  const hide = () => {
    reading.textContent = '';
    mark.setAttribute('visibility', 'hidden');
  };
  const read = (panel, point) => {
    const found = panel?.nearest(point);
    if (!found) return hide();
    const [cx, cy] = panel.placeAt(found.shares);
    for (const [name, value] of Object.entries({cx, cy, visibility: 'visible'})) {
      mark.setAttribute(name, value);
    }
    const values = panel.scales.map((scale, i) => (
      `${scale.label}: ${shown(valueAt(scale, found.shares[i]))}`));
    reading.textContent = [found.name, ...values].filter(Boolean).join(' \u00b7 ');
  };
  // Panels that share a scale are zoomed together.
  const zoom = (changed, shares) => {
    for (const panel of panels) {
      panel.zoom(panel.scales.map((scale, i) => (
        scale.group === changed.scales[i].group ? shares[i] : panel.shares[i])));
    }
  };

  svg.addEventListener('pointermove', (event) => {
    const point = placeOf(event);
    if (!drag) return read(panels.find((panel) => panel.contains(point)), point);
    const [x, y] = [Math.min(point.x, drag.from.x), Math.min(point.y, drag.from.y)];
    const [width, height] = [Math.abs(point.x - drag.from.x), Math.abs(point.y - drag.from.y)];
    for (const [name, value] of Object.entries({x, y, width, height, visibility: 'visible'})) {
      box.setAttribute(name, value);
    }
  });
  svg.addEventListener('pointerdown', (event) => {
    const from = placeOf(event), panel = panels.find((one) => one.contains(from));
    if (!panel || event.pointerType === 'touch' || event.button) return;
    drag = {from, panel};
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  svg.addEventListener('pointerup', (event) => {
    const to = placeOf(event), begun = drag;
    drag = null;
    box.setAttribute('visibility', 'hidden');
    if (!begun || Math.hypot(to.x - begun.from.x, to.y - begun.from.y) < 8) return;
    const ends = [begun.panel.sharesAt(begun.from), begun.panel.sharesAt(to)];
    // Along a scale on which the box is thin, all stays as it is.
    zoom(begun.panel, begun.panel.shares.map(([low, high], i) => {
      const [first, last] = [ends[0][i], ends[1][i]].sort((a, b) => a - b);
      const part = [Math.max(first, low), Math.min(last, high)];
      return part[1] - part[0] < 0.03 * (high - low) ? [low, high] : part;
    }));
    hide();
  });
  svg.addEventListener('pointerleave', hide);
  svg.addEventListener('dblclick', (event) => {
    const panel = panels.find((one) => one.contains(placeOf(event)));
    if (panel) zoom(panel, SHARE);
  });
}
