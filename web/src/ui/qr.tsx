import { useAsked } from "./parts";

const QUIET = 4;

/** A text as a QR code; its encoder is loaded when the first one is shown. */
export function Qr({ of, label }: { of: string; label: string }) {
  const code = useAsked(async () => {
    const { size, data } = (await import("uqr")).encode(of, { ecc: "M", border: QUIET });
    const cells = data.flatMap((row, y) => row.flatMap((dark, x) => (dark ? `M${x} ${y}h1v1h-1z` : [])));
    return { size, path: cells.join("") };
  }, [of]);
  if (!code) return <div class="qr" aria-busy="true" />;
  return (
    <svg class="qr" viewBox={`0 0 ${code.size} ${code.size}`} role="img" aria-label={label}>
      <path d={code.path} />
    </svg>
  );
}
