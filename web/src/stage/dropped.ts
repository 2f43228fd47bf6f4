/** What was dropped on the page. */

export interface Dropped {
  files: File[];
  /** Names of folders, which a browser hands over as files that cannot be read. */
  folders: string[];
}

/** Look what a drop holds; the browser shows that only as long as the event lasts. */
export function droppedWith({ items }: DataTransfer): Dropped {
  const dropped: Dropped = { files: [], folders: [] };
  for (const item of items) {
    const entry = item.kind === "file" ? item.webkitGetAsEntry() : null;
    const file = item.getAsFile();
    if (entry?.isDirectory) dropped.folders.push(entry.name);
    else if (file) dropped.files.push(file);
  }
  return dropped;
}
