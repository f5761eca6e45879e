/** Addresses for another device: of the view on the road, and for the app or dongle that sends. */

/** Names and addresses that only this device reaches. */
const LOOPBACK = /^(localhost|.*\.localhost|127(\.\d+){3}|\[::1\])$/;

/** The address of a service that was typed, with its scheme and without its end; null where it is none. */
export function serviceAddress(typed: string): URL | null {
  const text = typed.trim();
  try {
    return new URL(/^https?:\/\//.test(text) ? text : `http://${text}`);
  } catch {
    return null;
  }
}

/** Whether no other device reaches an address. */
export function isOnlyHere({ hostname }: URL): boolean {
  return LOOPBACK.test(hostname);
}

/** Where an app sends, with the token of the car. */
export function senderAddress(service: URL, token: string): string {
  const address = new URL("v1/telemetry", folderOf(service));
  if (token) address.searchParams.set("token", token);
  return address.href;
}

/** The page as it opens the view of a car, with the token of the service; what stands behind # is not sent. */
export function viewAddress(service: URL, car: string, token: string): string {
  const view = new URLSearchParams({ drive: car, ...(token ? { token } : {}) });
  return `${folderOf(service).href}#${view}`;
}

/** The car and the token of an address for a phone; null for any other. */
export function viewFrom(hash: string): { car: string; token: string } | null {
  const view = new URLSearchParams(hash.replace(/^#/, ""));
  const car = view.get("drive");
  return car ? { car, token: view.get("token") ?? "" } : null;
}

function folderOf({ origin, pathname }: URL): URL {
  return new URL(pathname.endsWith("/") ? pathname : `${pathname}/`, origin);
}
