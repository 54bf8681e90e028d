/**
 * Return a function that has something done with the browser's next frame, once, however often it is called before:
 * what is not seen need not be done.
 */
export function withNextFrame(act: () => void): () => void {
  let pending = 0;
  return () => {
    pending ||= requestAnimationFrame(() => {
      pending = 0;
      act();
    });
  };
}
