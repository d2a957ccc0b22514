// How panes share the room that there is.

/** As many columns as make the panes largest, and the height that each may have. */
export function arranged(panes: number, width: number, shape: number): { columns: number; room: number } {
  const height = Math.max(300, Math.min(innerHeight, 1200) * 0.72);
  let best = { columns: 1, room: height };
  let widest = 0;
  for (let columns = 1; columns <= Math.min(panes, 4); columns++) {
    const rows = Math.ceil(panes / columns);
    const room = height / rows - 40;
    const side = Math.min(width / columns - 10, room / shape);
    if (side > widest * 1.02) [widest, best] = [side, { columns, room }];
  }
  return best;
}
