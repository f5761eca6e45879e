/** Runs a job for the latest wish only: never two at a time, never more often than every `restMs`. */
export class Latest<T> {
  private wish: { value: T } | null = null;
  private running: AbortController | null = null;

  constructor(
    private readonly job: (value: T, signal: AbortSignal) => Promise<void>,
    private readonly restMs: number,
  ) {}

  /** Do the job for `value`, at once if nothing runs, else as soon as what runs is done. */
  want(value: T): void {
    this.wish = { value };
    if (!this.running) void this.run();
  }

  /** Forget what is wanted and give up what runs. */
  cancel(): void {
    this.wish = null;
    this.running?.abort();
    this.running = null;
  }

  private async run(): Promise<void> {
    const controller = new AbortController();
    this.running = controller;
    while (this.wish && this.running === controller) {
      const { value } = this.wish;
      this.wish = null;
      const rest = new Promise((resolve) => setTimeout(resolve, this.restMs));
      await this.job(value, controller.signal);
      await rest;
    }
    if (this.running === controller) this.running = null;
  }
}
