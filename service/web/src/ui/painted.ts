/** Wait until what is drawn now has been seen: the frame after the next one has begun. */
export function painted(): Promise<void> {
  return new Promise((resolve) => {
    requestAnimationFrame(() => {
      requestAnimationFrame(() => {
        resolve();
      });
    });
  });
}

/** Wait until the page has nothing else to do, a moment at most. */
export function idle(): Promise<void> {
  return new Promise((resolve) => {
    if (typeof requestIdleCallback === 'function')
      requestIdleCallback(
        () => {
          resolve();
        },
        { timeout: 400 },
      );
    else setTimeout(resolve, 300); // Safari
  });
}
