// Elements of the panel.

/** An element with properties and children. */
export function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

/** A checkbox with its name. */
export function toggle(name, checked, change) {
  const box = element('input', {type: 'checkbox', checked});
  box.addEventListener('change', () => change(box.checked));
  return element('label', {}, box, name);
}

/** A slider with its name and its value; `set` shows another value without calling `change`. */
export function slider(name, [low, high, step], show, change) {
  const input = element('input', {type: 'range', min: low, max: high, step, value: 0});
  const output = element('output');
  const set = value => {
    if (document.activeElement !== input || input.valueAsNumber !== value) input.value = value;
    output.value = show(value);
  };
  input.setAttribute('aria-label', name);
  input.addEventListener('input', () => {
    output.value = show(input.valueAsNumber);
    change(input.valueAsNumber);
  });
  const row = element('label', {className: 'slider', title: name}, element('span', {textContent: name}), input, output);
  set(0);
  return {row, set, value: () => input.valueAsNumber};
}

/** Buttons of which one is chosen; `choose` marks one without calling `change`. */
export function choice(names, change) {
  const buttons = names.map(name => element('button', {textContent: name, type: 'button'}));
  const choose = chosen => buttons.forEach((button, i) => button.setAttribute('aria-pressed', names[i] === chosen));
  buttons.forEach((button, i) => button.addEventListener('click', () => {
    choose(names[i]);
    change(names[i]);
  }));
  return {buttons, choose};
}
