// The activity list: scrolls to new entries, unless a person has scrolled up to read.
globalThis.moments = (() => {
  const NEAR = 60; // pixels from the end that still count as the end
  let shown = 0; // the previous height of the list

  const follow = (id) => {
    const list = getElement(id)?.$el ?? document.querySelector(".moments");
    if (!list) return;
    const wasAtEnd = list.scrollTop + list.clientHeight >= shown - NEAR || list.scrollHeight < shown;
    shown = list.scrollHeight;
    if (wasAtEnd) list.scrollTop = list.scrollHeight;
  };

  return { follow };
})();
