// Connection of the control side: opened with the token, and again when it is lost.

import type { Answer, Command, ControlMessage, JogEnd, Reached, ReleaseReason, Seen, Welcome } from "./control_messages";
import type { TeachBeat, TeachState } from "./teach_messages";

const RETRY_MS = 1000;
const REJECTED = 1008; // WSCloseCode.POLICY_VIOLATION
const STORED = "robotd-token"; // of this tab, so that it survives a reload

export interface ControlReceiver {
  onOpen(welcome: Welcome): void;
  onPanel(state: Partial<TeachState>): void;
  onAnswer(answer: Answer): void;
  onJogEnd(end: JogEnd): void;
  onSlow(reason: string): void;
  onReached(reached: Reached): void;
  onError(text: string): void;
  onClosed(reason: string, isRejected: boolean): void;
}

// Take the token out of the address, where others would see it, and keep it for this tab.
export function takeToken(): string {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (given) {
    sessionStorage.setItem(STORED, given);
    history.replaceState(null, "", location.pathname + location.search);
  }
  return given ?? sessionStorage.getItem(STORED) ?? "";
}

export class ControlLink {
  private socket: WebSocket | undefined;
  private retry: ReturnType<typeof setTimeout> | undefined;
  private isOpen = false;
  private lastId = 0;

  constructor(
    private readonly receiver: ControlReceiver,
    private readonly seen: () => Seen | null, // what the page shows now
  ) {}

  open(token: string): void {
    this.close();
    const socket = new WebSocket(`ws://${location.host}/control`);
    this.socket = socket;
    socket.onopen = () => socket.send(JSON.stringify({ token }));
    socket.onmessage = ({ data }) => {
      if (socket === this.socket) this.receive(JSON.parse(data as string) as ControlMessage, token);
    };
    socket.onclose = ({ code, reason }) => {
      if (socket !== this.socket) return;
      this.isOpen = false;
      const isRejected = code === REJECTED;
      if (isRejected) sessionStorage.removeItem(STORED);
      else this.retry = setTimeout(() => this.open(token), RETRY_MS);
      this.receiver.onClosed(reason || "the connection is lost", isRejected);
    };
  }

  close(): void {
    clearTimeout(this.retry);
    this.isOpen = false;
    const { socket } = this;
    this.socket = undefined;
    socket?.close();
  }

  // Send a command; the answer has the number that is returned. 0: there is no connection.
  send(command: Command): number {
    if (!this.isOpen) return 0;
    this.lastId += 1;
    this.put({ id: this.lastId, seen: this.seen(), ...command });
    return this.lastId;
  }

  jog(hold: number, joint: string, velocity: number, step: number | null): void {
    this.put({ type: "jog", seen: this.seen(), hold, joint, velocity, step });
  }

  jogTool(hold: number, group: string, frame: string, linear: number[], angular: number[]): void {
    this.put({ type: "jog_tool", seen: this.seen(), hold, group, frame, linear, angular });
  }

  moveTool(hold: number, group: string, pose: number[], line: boolean, velocity: number): void {
    this.put({ type: "move_tool", seen: this.seen(), hold, group, pose, line, velocity });
  }

  // Ask for the posture of a target; null: for where the tool is.
  reach(group: string, pose: number[] | null, isFinal: boolean): void {
    this.lastId += 1;
    this.put({ type: "reach", id: this.lastId, group, pose, is_final: isFinal });
  }

  drive(hold: number, linear: number, lateral: number, angular: number): void {
    this.put({ type: "drive", seen: this.seen(), hold, linear, lateral, angular });
  }

  teach(hold: number, beat: TeachBeat): void {
    this.put({ seen: this.seen(), hold, ...beat });
  }

  release(hold: number, reason: ReleaseReason): void {
    this.put({ type: "release", hold, reason });
  }

  private put(message: object): void {
    if (this.isOpen) this.socket!.send(JSON.stringify(message));
  }

  private receive(message: ControlMessage, token: string): void {
    switch (message.type) {
      case "welcome":
        this.isOpen = true;
        sessionStorage.setItem(STORED, token);
        this.receiver.onOpen(message);
        break;
      case "panel":
        this.receiver.onPanel(message.state);
        break;
      case "answer":
        this.receiver.onAnswer(message);
        break;
      case "jog":
        this.receiver.onJogEnd(message);
        break;
      case "slow":
        this.receiver.onSlow(message.text);
        break;
      case "reach":
        this.receiver.onReached(message);
        break;
      case "error":
        this.receiver.onError(message.text);
        break;
    }
  }
}
