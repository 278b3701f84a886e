// Connection to the server; it is opened again when it is lost.

import type { Message } from "./messages";

const RETRY_MS = 1000;
const TOO_MANY = 1013; // WSCloseCode.TRY_AGAIN_LATER

export interface Receiver {
  onMessage(message: Message): void;
  onSamples(data: ArrayBuffer): void;
  onLost(reason: string): void;
}

export function connect(receiver: Receiver): void {
  const socket = new WebSocket(`ws://${location.host}/ws${location.search}`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => {
    if (typeof data === "string") receiver.onMessage(JSON.parse(data) as Message);
    else receiver.onSamples(data as ArrayBuffer);
  };
  socket.onclose = ({ code, reason }) => {
    receiver.onLost(code === TOO_MANY ? reason : "The connection to robotd is lost");
    setTimeout(() => connect(receiver), RETRY_MS);
  };
}
