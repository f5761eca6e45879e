import { useEffect, useState } from "preact/hooks";

const QUIET = 4;

interface Code {
  size: number;
  path: string;
}

/** A text as a QR code; its encoder is loaded when the first one is shown. */
export function Qr({ of, label }: { of: string; label: string }) {
  const [code, setCode] = useState<Code | null>(null);
  useEffect(() => {
    let isShown = true;
    void import("uqr").then(({ encode }) => {
      const { size, data } = encode(of, { ecc: "M", border: QUIET });
      const cells = data.flatMap((row, y) => row.flatMap((dark, x) => (dark ? `M${x} ${y}h1v1h-1z` : [])));
      if (isShown) setCode({ size, path: cells.join("") });
    });
    return () => {
      isShown = false;
    };
  }, [of]);
  if (!code) return <div class="qr" aria-busy="true" />;
  return (
    <svg class="qr" viewBox={`0 0 ${code.size} ${code.size}`} role="img" aria-label={label}>
      <path d={code.path} />
    </svg>
  );
}
