import { pause } from "../model/clock";

/** Runs a job for the latest value only: one at a time, and at most once per `minIntervalMs`. */
export class Latest<T> {
  private pending: { value: T } | null = null;
  private running: AbortController | null = null;

  constructor(
    private readonly job: (value: T, signal: AbortSignal) => Promise<void>,
    private readonly minIntervalMs: number,
  ) {}

  /** Run the job for `value`: now, or after the running job; null cancels both. */
  submit(value: T | null): void {
    if (value === null) return this.cancel();
    this.pending = { value };
    if (!this.running) void this.run();
  }

  /** Whether a newer value waits. */
  get isWaiting(): boolean {
    return this.pending !== null;
  }

  /** Drop the waiting value and abort the running job. */
  cancel(): void {
    this.pending = null;
    this.running?.abort();
    this.running = null;
  }

  private async run(): Promise<void> {
    const controller = new AbortController();
    this.running = controller;
    while (this.pending && this.running === controller) {
      const { value } = this.pending;
      this.pending = null;
      const interval = pause(this.minIntervalMs);
      await this.job(value, controller.signal);
      await interval;
    }
    if (this.running === controller) this.running = null;
  }
}
