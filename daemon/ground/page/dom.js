// Builds elements, and changes the page only where something differs.
export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

export function content(id) {
  return document.querySelector(`#${id} .content`);
}

export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// Replaces the children only if `key` has changed: focus and selection stay where nothing changes.
export function replace(parent, key, make) {
  if (parent.dataset.key === key) return;
  const focused = parent.contains(document.activeElement) ? document.activeElement.dataset.focus : undefined;
  parent.dataset.key = key;
  parent.replaceChildren(...make());
  if (focused) parent.querySelector(`[data-focus="${focused}"]`)?.focus();
}
